"""Which of several effects a recording speaks for: each in place of the others, row by row.

What a second recording is made for (`separation.separate`): the improved model with the found
effect, and with each of its rivals instead, is identified from it anew; what they leave of the rows
of the weak form is compared.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .. import signals
from ..data.recording import Recording, require
from ..models import Model
from ..terms.base import AbstractTerm, Sum, summands
from ..terms.effects import effect
from ..terms.sample import Scales
from . import curves
from .identifying import identify
from .projections import WeakForm

# Differences of the information criterion above ten are "very strong" (Kass & Raftery 1995).
STRONG = 10.0


class Standing(NamedTuple):
    """One effect: what it leaves, norm(u − û)/norm(u) of the rows, and by how much its information
    criterion is `above` that of the best, no more than what it leaves alone accounts for.
    """

    effect: str
    filtered_force_error: float
    above: float


class Decision(NamedTuple):
    """The effects, the best first."""

    standings: tuple[Standing, ...]

    @property
    def effect(self) -> str:
        """The effect with the least information criterion."""
        return self.standings[0].effect

    @property
    def alike(self) -> tuple[str, ...]:
        """The other effects that the recording does not tell from the best."""
        return tuple(each.effect for each in self.standings[1:] if each.above <= STRONG)

    @property
    def decided(self) -> bool:
        """Whether the best is told from each other one."""
        return not self.alike


def decide(model: Model, name: str, rivals: Sequence[str], recording: Recording) -> Decision:
    """Which of a found effect and its rivals accounts for a recording.

    **Arguments:** `model`, the improved one with a term of the effect `name`; `rivals`, the names
    of what it may be confused with; `recording`, signals of shape `(N,)`.

    **Raises:** `ValueError` for a batch, or a model without a term of the effect.
    """
    require(recording, "decide")
    log = signals.prepare(recording)
    scales = signals.scales(log)
    base = without(model, name, scales)
    width = signals.kernel_half_width(log)
    fits = [
        _fit(each, base + term, log, width)
        for each in (name, *rivals)
        for term in shapes(each, scales, log)
    ]
    return _decided(fits)


def shapes(name: str, scales: Scales, log: Recording | None = None) -> list[AbstractTerm]:
    """The terms of an effect that a motion alone determines."""
    have = {"position", "velocity", "time", "acceleration", *(log.channels if log else ())}
    return [term for term in effect(name).shapes(scales) if term.coordinates <= have]


def without(model: Model, name: str, scales: Scales) -> Sum:
    """The sum of a model's terms less the last of an effect, as a structure to be fitted."""
    place = own(model, name, scales)
    return Sum(tuple(part for i, part in enumerate(summands(model.term)) if i != place))


def own(model: Model, name: str, scales: Scales) -> int:
    """The place, among a model's terms, of the last of an effect."""
    kinds = {_kind(term) for term in effect(name).shapes(scales)}
    places = [i for i, term in enumerate(summands(model.term)) if _kind(term) in kinds]
    if not places:
        raise ValueError(f"The model has no term of the effect {name!r} to tell from another.")
    return places[-1]


def _kind(term: AbstractTerm) -> str:
    """The classes that a term is made of."""
    inner = [_kind(part) for part in (getattr(term, "positive", None),) if part is not None]
    return "/".join([type(term).__name__, *inner])


class _Fit(NamedTuple):
    """An effect, what the rows in slip leave, N, `(J,)`, their force, the number of parameters."""

    effect: str
    left: np.ndarray
    force: np.ndarray
    parameters: int


def _fit(name: str, term: AbstractTerm, log: Recording, width: int) -> _Fit:
    found = identify(term, log, projection=WeakForm(width))
    rows = curves.rows(found, log)
    # What a model has no value for explains nothing.
    left = rows.measured - np.nan_to_num(rows.predicted)
    count = len(term.affine) + len(term.nonlinear)
    return _Fit(name, left[rows.slip], rows.measured[rows.slip], count)


def _decided(fits: Sequence[_Fit]) -> Decision:
    """The effects by the Bayesian information criterion n log(S) + k log(n) (Schwarz 1978).

    n is the number of independent rows: those there are over the correlation length of what the
    least fit leaves, so that overlapping kernels, slow loads and missing terms are no evidence.
    Nor is it that an effect has more parameters: what fits as well is not told from the best.
    """
    power = [max(float(np.mean(fit.left**2)), 1e-300) for fit in fits]
    count = independent(fits[int(np.argmin(power))].left)
    score: dict[str, tuple[float, float, float]] = {}
    for fit, size in zip(fits, power, strict=True):
        misfit = count * float(np.log(size))
        each = misfit + fit.parameters * float(np.log(count))
        error = float(np.sqrt(size / max(float(np.mean(fit.force**2)), 1e-300)))
        score[fit.effect] = min(score.get(fit.effect, (np.inf,) * 3), (each, misfit, error))
    ordered = sorted(score.items(), key=lambda entry: entry[1])
    best, least, _ = ordered[0][1]
    return Decision(
        tuple(
            Standing(name, error, max(min(each - best, misfit - least), 0.0))
            for name, (each, misfit, error) in ordered
        )
    )


def independent(left: np.ndarray) -> float:
    """The number of independent values in a series, 2 at least.

    Its length over 1 + 2 Σ ρ, the sum to the first pair of autocorrelations that is not positive
    (initial positive sequence; Geyer 1992).
    """
    centred = left - left.mean()
    size = 2 * centred.size
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    correlation = np.fft.irfft(spectrum, size)[: centred.size]
    if not correlation[0] > 0:
        return float(max(centred.size, 2))
    correlation = correlation / correlation[0]
    pairs = correlation[1:-1:2] + correlation[2::2]
    ends = np.flatnonzero(pairs <= 0)
    total = 1 + 2 * float(pairs[: ends[0] if ends.size else pairs.size].sum())
    return max(centred.size / max(total, 1.0), 2.0)
