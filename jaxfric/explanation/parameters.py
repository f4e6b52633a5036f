"""Parameters of fitted terms with their standard errors, as people name them."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np

from .. import programs
from ..identification.uncertainty import Estimate
from ..models import Model
from ..terms.base import AbstractTerm, Sum, summands
from ..terms.effects import Wave, wave
from ..terms.sample import Scales
from ..units import spell
from .intervals import spread
from .regression import Fit
from .significance import BLOCKS
from .slow_changes import along, over_record, range_of


def whole(current: Fit) -> AbstractTerm:
    """All the terms of a fit as one sum, their β in place."""
    known = [
        t.with_beta(jnp.asarray(b)) if len(b) else t
        for t, b in zip(current.terms, current.betas, strict=True)
    ]
    return Sum(tuple(leaf for term in known for leaf in summands(term)))


def model(current: Fit, units, taken_later: float = 0.0) -> Model:
    """The fit as a model, of rows whose force was taken so much later, s."""
    known = Model(whole(current), jnp.asarray(np.concatenate(current.alphas)), units)
    return known.with_force_delay(-taken_later) if taken_later else known


def estimates(
    current: Fit, block: np.ndarray, units: dict[str, str], limits: Scales | None = None
) -> list[dict[str, Estimate]]:
    """The parameters of each term of a fit, waves by amplitude and phase too; with the `limits` of
    the recording what changes slowly by how much it changes as well.
    """
    known = spread(current, block)
    matrix, freedom = known.covariance, known.degrees_of_freedom(np.eye(len(known.covariance)))
    result = []
    for n, term in enumerate(current.terms):
        index = current.indices(n)
        values = [*current.alphas[n], *current.betas[n]]
        plain = {
            p.name: Estimate(
                np.float64(value),
                np.float64(np.sqrt(matrix[i, i])),
                spell(p.dimension, units),
                float(freedom[i]),
            )
            for p, value, i in zip((*term.affine, *term.nonlinear), values, index, strict=True)
        }
        found = plain | _waves(term, values, matrix[np.ix_(index, index)], plain)
        if limits is not None and n:
            found |= along(current, n, known, units, limits)
            found |= over_record(current, n, known, units, limits)
            found |= range_of(current, n, known, units, limits)
        result.append(found)
    return result


def tested(estimate: Estimate) -> Estimate:
    """The estimate as a finding is tested: with a degree of freedom for each block of the record.

    That there is a force at all has been tested by flips of whole blocks. Of a force that acts in
    two reversals the interval is wider, since it has two degrees; that is no reason to doubt it.
    """
    return estimate._replace(degrees_of_freedom=max(estimate.degrees_of_freedom, BLOCKS))


def may_be_none(
    term: AbstractTerm, own: dict[str, Estimate], other: dict[str, Estimate] | None = None,
    as_told: bool = False,
) -> bool:  # fmt: skip
    """Whether of all that its force is proportional to, of waves of the amplitudes too, there is no
    interval that leaves out zero.

    `other`: the same by other rows, of another recording or through a kernel of twice the width,
    which have to agree with it, as those that see little of it do, or to leave out zero on the same
    side. They contradict each other by the intervals that are told, of few blocks by few degrees of
    freedom. `as_told`: zero, too, by these instead of those of [`tested`][].
    """

    def sure(name: str) -> bool:
        low, high = (own[name] if as_told else tested(own[name])).interval()
        if low * high <= 0 or other is None:
            return bool(low * high > 0)
        least, most = tested(other[name]).interval()
        apart = abs(float(own[name].value) - float(other[name].value))
        half, theirs = (float(each[name].half_width()) for each in (own, other))
        return bool(apart <= np.hypot(half, theirs) or (least > 0 if low > 0 else most < 0))

    names = [name for name in own if name.startswith("amplitude")]
    return not any(sure(name) for name in (*names, *(p.name for p in term.affine)))


_wave = programs.compiled(wave)


def _waves(term, values, matrix, plain) -> dict[str, Estimate]:
    """Amplitude and phase of every pair of sine and cosine."""
    found = {}
    names = [p.name for p in term.affine]
    for i, name in enumerate(names):
        if not name.endswith("_sin"):
            continue
        harmonic = name.removesuffix("_sin").partition("_harmonic")[2]
        suffix = f"_harmonic{harmonic}" if harmonic else ""
        pair = _wave(*map(np.asarray, values[i : i + 2]), matrix[i : i + 2, i : i + 2])
        unit, pair = plain[name].unit, Wave(*map(np.asarray, pair))
        freedom = min(plain[n].degrees_of_freedom for n in names[i : i + 2])
        found[f"amplitude{suffix}"] = Estimate(pair.amplitude, pair.amplitude_error, unit, freedom)
        found[f"phase{suffix}"] = Estimate(pair.phase, pair.phase_error, "rad", freedom)
    return found


def with_smoothing(ours: dict[str, Estimate], wide: dict[str, Estimate]) -> dict[str, Estimate]:
    """Estimates whose errors contain what another width of the kernel changes.

    Smoothing grows with the width; what the encoder's noise does to a column, and the rows beside
    a reversal, go the other way. What a kernel of twice the width, `wide`, changes beyond its own
    noise is an error of the method, to be counted as it is (Barlow 2002). What it does not show
    (parameters with no finite error there) it says nothing about.
    """
    return _widened(ours, wide, lambda own, there, apart: apart**2 - there**2)


def with_elsewhere(ours: dict[str, Estimate], there: dict[str, Estimate]) -> dict[str, Estimate]:
    """Estimates whose errors contain what another recording of the same machine says.

    No law is quite the machine's, and what it lacks moves the parameters from motion to motion by
    more than the noise does. Where two values are further apart than their errors allow, each has
    beside its own error one of the variance between recordings, here its moment estimate
    (DerSimonian & Laird 1986). What a recording does not show, it says nothing about: parameters
    with no finite error there stay.
    """
    return _widened(ours, there, lambda own, there, apart: (apart**2 - own**2 - there**2) / 2)


def _widened(
    ours: dict[str, Estimate],
    theirs: dict[str, Estimate],
    variance: Callable[[float, float, float], float],
) -> dict[str, Estimate]:
    """Estimates with errors beyond their own.

    `variance` says from both standard errors and the distance of the two values by how much.
    """

    def both(name: str, own: Estimate) -> Estimate:
        there = theirs.get(name)
        if there is None:  # a wave that repeats by those, say
            return own
        apart = float(there.value - own.value)
        if name.startswith("phase") or name.endswith("_phase"):
            apart = float(np.angle(np.exp(1j * apart)))
        more = variance(float(own.standard_error), float(there.standard_error), apart)
        if not (np.isfinite(more) and more > 0):
            return own
        error = np.hypot(own.standard_error, np.sqrt(more))
        return own._replace(standard_error=np.float64(error))

    return {name: both(name, estimate) for name, estimate in ours.items()}
