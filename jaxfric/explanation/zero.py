"""Where the position of a held-out recording begins that is the integral of its velocity."""

import dataclasses

import numpy as np

from ..checks import Remark
from ..identification.uncertainty import Estimate
from ..terms.base import AbstractTerm
from ..units import POSITION, spell
from . import verification
from .evidence import Evidence
from .findings import Findings
from .motion import Motion
from .problem import with_holdout
from .quantities import quantity
from .regression import Fit

# Places that are tried: so many in the shortest wave, whose minimum is half as wide, and at most so
# many; then around the best, four times as fine each time.
IN_A_WAVE, MOST = 8, 512
FINER, ROUNDS = 4, 4


def zero_of(findings: Findings, holdout: Motion) -> float | None:
    """The position at which a held-out recording without one begins, m; `None` where no finding
    reads it, or where it is recorded.

    Each such recording counts from its own beginning. Where that is on the axis is the place at
    which the model leaves least; nothing else is fitted.
    """
    problem, selection = findings.undelayed
    placed = [t for t in selection.last.terms if "position" in t.coordinates]
    if holdout.recording.position_every != 0 or not placed:
        return None
    held = with_holdout(problem, holdout).held
    assert held is not None

    def best(places: np.ndarray) -> float:
        return min(places, key=lambda place: _error(selection.last, held, float(place)))

    places = _places(selection.last, problem.evidence, held)
    step, found = float(places[1] - places[0]), best(places)
    for _ in range(ROUNDS):
        found = best(found + step * np.linspace(-1, 1, 2 * FINER + 1))
        step /= FINER
    return float(found)


def _places(model: Fit, evidence: Evidence, held: Evidence) -> np.ndarray:
    """Every place, m, where the strokes of both recordings overlap; of waves alone one period."""
    own = [_periods(term, beta) for term, beta in zip(model.terms, model.betas, strict=True)]
    waves = [period for periods in own for period in periods]
    read = [periods for t, periods in zip(model.terms, own, strict=True) if _reads(t)]
    low, high = evidence.limits.low - held.limits.high, evidence.limits.high - held.limits.low
    if all(read):
        low, high = 0.0, max(waves)
    fine = (high - low) * IN_A_WAVE / min(waves) if waves else 0
    return np.linspace(low, high, int(np.clip(fine, MOST / 8, MOST)) + 1)


def _reads(term: AbstractTerm) -> bool:
    return "position" in term.coordinates


def _periods(term: AbstractTerm, beta: np.ndarray) -> list[float]:
    """The shortest waves over position of a term, m, by its parameters; none of another."""
    pairs = zip(term.nonlinear, beta, strict=True)
    found = [float(p.period(b)) for p, b in pairs if p.repeats and p.dimension == POSITION]
    return [each / max(1, len(term.affine) // 2) for each in found]


def _error(model: Fit, held: Evidence, place: float) -> float:
    position = held.motion.position + place
    return verification.error(
        model, held._replace(motion=dataclasses.replace(held.motion, position=position))
    )


def beginning_at(motion: Motion, place: float) -> Motion:
    """The motion with its position counted from another place, m."""
    recording, padded = (
        dataclasses.replace(log, position=log.position + place)
        for log in (motion.recording, motion.padded)
    )
    return motion._replace(recording=recording, padded=padded)


def integrated(findings: Findings, place: float | None) -> list[Remark]:
    """That positions are integrals of the velocity, where a term reads them; `place`, of
    [`zero_of`][].
    """
    selection, evidence = findings.selection, findings.problem.evidence
    if evidence.located or not any(map(_reads, selection.last.terms)):
        return []
    text = (
        "No position is recorded: it is the integral of the velocity, zero where the recording "
        "begins. An offset of the velocity lets it drift."
    )
    if place is not None:
        unit = spell(POSITION, evidence.motion.unit_names)
        spelt = quantity(Estimate(np.float64(place), np.float64(0.0), unit))
        text += f" The held-out recording begins at {spelt}, where the model fits it best."
    return [Remark("position_integrated", text, False)]
