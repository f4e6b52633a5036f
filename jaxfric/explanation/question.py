"""What is asked of a recording: its rows, aligned, and what the baseline leaves of them."""

from typing import NamedTuple

import numpy as np

from ..data.recording import Recording
from ..terms.base import AbstractTerm
from ..terms.effects import traits
from ..terms.effects.late import TransportDelay
from .candidates import Field
from .chance import blocks
from .evidence import Evidence, Motion, gather, motion_of
from .predictions import with_predictions
from .regression import Fit, fit
from .reversals import yields

# Alignments that differ by less than this part of a sample make no difference worth another search.
ALIGNED = 0.1


# Between a kernel and one of twice the width: a third wider.
BETWEEN = 4 / 3
# Through that one and through the widest; `None` where too little would be left.
Wider = tuple[Evidence | None, Evidence | None]


class Question(NamedTuple):
    """A recording through a kernel and one of twice the width, and its base fit.

    `between`: through a kernel a third wider, where there is one; `delay`: how much later the
    force was taken, s; `block`: of each row; `structure`: the baseline; `fields`: the candidates
    with their columns, and, kept, those of other rows of this motion; `within`: where rows reach
    across reversals, the question with those that do not; `held`: rows of the held-out recording,
    once everything has been chosen without it.
    """

    evidence: Evidence
    wide: Evidence | None
    between: Evidence | None
    base: Fit
    block: np.ndarray
    structure: AbstractTerm
    fields: tuple[Field, ...]
    delay: float
    within: "Question | None" = None
    held: Evidence | None = None

    @property
    def reversals(self) -> bool:
        """Whether rows reach across reversals, where the axis moves instead of sticking."""
        return self.within is not None

    @property
    def field(self) -> Field:
        """The candidates, with their columns."""
        return self.fields[0]

    @property
    def wider(self) -> Wider:
        """Through a kernel a third wider, and twice as wide."""
        return self.between, self.wide


def ask(
    recording: Recording | Motion,
    structure: AbstractTerm,
    known: Fit | None = None,
    before: Question | None = None,
) -> Question:
    """The rows of a recording, force and motion aligned.

    **Arguments:** `known`: the model to align by, by default the baseline; `before`: a question
    about the same baseline, whose columns serve again if only the force has been shifted since.
    """
    motion = motion_of(recording)
    evidence = gather(motion)
    if before is not None:
        return _aligned(motion, evidence, structure, known, before.fields)
    field = Field(evidence, structure)
    try:
        asked = _aligned(motion, evidence, structure, known, (field,))
    except BaseException:
        field.close()
        raise
    if asked.field is not field:
        field.close()
        asked = asked._replace(fields=asked.fields[:1])
    return asked


def opened(recording: Recording | Motion, asked: Question) -> Question | None:
    """The question with rows across reversals too, where the axis moves there instead of sticking.

    `None` where it sticks.
    """
    motion, width, delay = motion_of(recording), asked.evidence.width, asked.delay
    if not yields(motion, asked.evidence, asked.base):
        return None
    evidence = gather(motion, width, delay, True)
    wide = _wider(motion, evidence, delay, True)
    question = _put(motion, evidence, wide, asked.structure, asked.base, asked.fields, delay, True)
    return question._replace(within=asked)


def beside(asked: Question, holdout: Recording | Motion) -> Question:
    """The question with a held-out recording's rows, by the same kernel, s, and alignment, s."""
    reach = asked.evidence.reach
    held = gather(motion_of(holdout), delay=asked.delay, reversals=asked.reversals, reach=reach)
    return asked._replace(held=held)


def _aligned(motion, evidence: Evidence, structure, known, fields) -> Question:
    wide, delay, sample = _wider(motion, evidence), 0.0, evidence.limits.interval
    known = fit([structure], evidence) if known is None else known
    # To first order a delay is a column; the first estimate is good to a fifth of a sample.
    for _ in range(3):
        last = delay
        delay -= _lateness([evidence] if wide is None else [evidence, wide], known)
        if abs(delay) > sample:
            delay = -0.5 * sample
        evidence = gather(motion, evidence.width, delay)
        wide = None if wide is None else gather(motion, wide.width, delay)
        if abs(delay - last) < 0.5 * ALIGNED * sample:
            break
    return _put(motion, evidence, wide, structure, known, fields, delay, False)


def _put(
    motion, evidence: Evidence, wide, structure, known: Fit, fields, delay, across
) -> Question:
    base = fit([structure], evidence, known.betas[:1])
    block = blocks(evidence.elapsed[evidence.centre], evidence.reach)
    field = next((f for f in fields if f.serves(evidence)), None) or Field(evidence, structure)
    kept = (field, *(f for f in fields if f is not field))
    between = _wider(motion, evidence, delay, across, BETWEEN)
    return Question(evidence, wide, between, base, block, structure, kept, delay)


def _wider(
    recording: Motion, narrow: Evidence, delay=0.0, across=False, factor=2.0
) -> Evidence | None:
    """The recording through a wider kernel; `None` if whole steps between the nodes allow none, or
    too few rows would be left to judge by.
    """
    try:
        wide = gather(recording, round(factor * narrow.width), delay, across)
        blocks(wide.elapsed[wide.centre], wide.reach)
    except ValueError:
        return None
    return wide if wide.width > narrow.width else None


def _lateness(views: list[Evidence], known: Fit) -> float:
    """How much earlier the force is than belongs to the same instant as the position, s.

    A force that is held from sample to sample acts half a sample late, a controller that needs the
    cycle for its computation one more: within a sample either way it is a matter of logging, which
    nobody calls a fault. What is beyond is left to be found. The wider kernel decides where the
    two differ, since noise of the encoder moves the narrow one only.
    """
    sample, delays = views[0].limits.interval, []
    kept = [i for i, term in enumerate(known.terms) if not traits(term).delays]
    terms, betas = [known.terms[i] for i in kept], [known.betas[i] for i in kept]
    for evidence in views:
        seen = with_predictions(evidence, known)
        now = fit(terms, seen, betas, 6)
        seen = with_predictions(seen, now)
        both = fit([*terms, TransportDelay()], seen, [*now.betas, np.zeros(0)], 6)
        delays.append(float(both.alphas[-1][0]))
    return delays[0] if abs(delays[0] - delays[-1]) < 0.5 * sample else delays[-1]
