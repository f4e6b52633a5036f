"""The zero of a held-out recording's position, where one position is the integral of a velocity."""

import dataclasses

import numpy as np

from ..checks import Remark
from ..identification.uncertainty import Estimate
from ..units import POSITION, spell
from . import verification
from .evidence import Evidence
from .findings import Findings
from .motion import Motion
from .problem import with_holdout
from .quantities import quantity
from .regression import Fit

# Places that are tried: eight in the shortest wave, whose minimum is half as wide, 64 at least, and
# so many at most that they take some seconds; then around the best, four times as fine each time,
# until 1/2000 of the shortest wave.
IN_A_WAVE, FEWEST, MOST = 8, 64, 512
FINER, ROUNDS = 4, 4


def zero_of(findings: Findings, holdout: Motion) -> float | None:
    """Where the zero of a held-out recording lies in the recording, m; `None` where the position of
    both is recorded, or where no term reads it.

    An integral counts from its own beginning. Where that is on the axis is the place at which the
    model leaves least; nothing else is fitted.
    """
    problem, selection = findings.undelayed
    recorded = problem.evidence.located and holdout.recording.position_every != 0
    if recorded or not _read(selection.last):
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
    """Places, m, at which the strokes of both recordings overlap; of one wave alone its period."""
    low, high = evidence.limits.low - held.limits.high, evidence.limits.high - held.limits.low
    read = _read(model)
    waves = [n for n in read if verification.wavelike(model, n)]
    periods = [_period(model, n) for n in waves]
    if len(read) == len(waves) == 1:
        low, high = 0.0, periods[0]
    shortest = [
        period / (len(model.terms[n].affine) // 2) for n, period in zip(waves, periods, strict=True)
    ]
    fine = (high - low) * IN_A_WAVE / min(shortest) if shortest else 0.0
    return np.linspace(low, high, int(np.clip(fine, FEWEST, MOST)) + 1)


def _read(model: Fit) -> list[int]:
    """The numbers of the terms that read the position."""
    return [n for n, term in enumerate(model.terms) if "position" in term.coordinates]


def _period(model: Fit, number: int) -> float:
    """The period of a wave over position, m."""
    term, beta = model.terms[number], model.betas[number]
    values = {p.name: float(b) for p, b in zip(term.nonlinear, beta, strict=True)}
    low, high = term.extent(values)["position"]
    return high - low


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
    evidence = findings.problem.evidence
    if not _read(findings.selection.last) or (evidence.located and place is None):
        return []
    text = (
        "No position is recorded: it is the integral of the velocity, zero where the recording "
        "begins. An offset of the velocity lets it drift."
    )
    if evidence.located:
        text = "On the held-out recording the position is the integral of the velocity."
    if place is not None:
        unit = spell(POSITION, evidence.motion.unit_names)
        spelt = quantity(Estimate(np.float64(place), np.float64(0.0), unit))
        text += f" The held-out recording's zero lies at {spelt}, where the model fits it best."
    return [Remark("position_integrated", text, False)]
