"""What a law sees of a recording: one sample, its magnitudes, and the names of parameters."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data.recording import Recording
from ..units import DIMENSIONLESS, FREQUENCY, Dimension

UNKNOWN = float("nan")
"""Of a nonlinear parameter: to be identified."""


class Sample(eqx.Module):
    """One sample of a recording as a law of physics sees it: every field is a scalar.

    `time` s; `position` m; `velocity` m/s; `channels`: further signals by role. In a batch of
    samples (inside the library) every field has the same leading shape.
    """

    time: Float[Array, ""]
    position: Float[Array, ""]
    velocity: Float[Array, ""]
    channels: dict[str, Float[Array, ""]] = eqx.field(default_factory=dict)


def samples(recording: Recording) -> Sample:
    """The samples of a recording, each field of shape `(N,)`.

    Without a recorded position the field is NaN, so that a term that needs it fails loudly.
    """
    absent = jnp.full_like(recording.time, jnp.nan)
    position = absent if recording.position is None else recording.position
    if recording.velocity is None:
        raise ValueError(
            "This recording has no velocity yet: pass it through jaxfric.signals.prepare first."
        )
    return Sample(recording.time, position, recording.velocity, dict(recording.channels))


class Scales(NamedTuple):
    """What a recording says about magnitudes; the source of every default bound.

    `slowest`: the smallest speed resolved as slip, m/s. `fastest`: the 98 % quantile of the
    speed, m/s. `low`, `high`: the range of the position, m. `force`: root mean square, N.
    `start`: the first time stamp, s. `duration`: s. `interval`: the typical sampling interval, s.
    `peak`: the largest force of either sign, N. All scalars.
    """

    slowest: Float[Array, ""]
    fastest: Float[Array, ""]
    low: Float[Array, ""]
    high: Float[Array, ""]
    force: Float[Array, ""]
    start: Float[Array, ""]
    duration: Float[Array, ""]
    interval: Float[Array, ""]
    peak: Float[Array, ""]


class Burden(NamedTuple):
    """What a term takes of a machine: the load behind a spring, the memory of a bump, a worn place.

    `inertia`, kg, and `friction`, N, of which a machine has no more; `give`, m, by which a spring
    gives way under that friction; `curved`: whether the friction is a part of a Stribeck curve;
    `lighter`: β with the inertia divided by a number, where the data tell it badly; `resonance`,
    Hz, at which a load swings.
    """

    inertia: float
    friction: float
    give: float = 0.0
    curved: bool = False
    lighter: Callable[[float], np.ndarray] | None = None
    resonance: float = 0.0


class Resolution(NamedTuple):
    """How finely the cost has to be looked at along a parameter β: points of equal steps in β^p.

    - `power`: p; 1 for equal steps, −1 for equal steps of 1/β, 0 for equal steps of log β.
    - `per`: points per unit of `over(scales)` · β^p; for p = 0 per octave; with `beside` per length
      of that other parameter of the same law; with none of these over the whole range.
    - `over`: what makes β^p a number of features (the stroke over a pitch: cycles).
    - `usual`: points where a recording's scales are not known yet, inside `jax.jit`.
    - `beside`: the other parameter, a length of the same dimension (a spot's width for its place).
    """

    power: int = 0
    per: float = 4.0
    over: Callable[[Scales], Array] | None = None
    usual: int = 32
    beside: str | None = None


class Parameter(NamedTuple):
    """A parameter's name, dimension and, where it is searched for, its compact set and its grid.

    A dimension that is no product of force, position and time, a mass beside an angle, is the name
    of its unit.

    `bounds` maps the [`Scales`][] of a recording to `(lower, upper)`, the set B of Kim, Kim & Ha
    (2004), assumption (A.3); `logarithmic` says whether its natural scale is a ratio. `resolution`
    says how near to each other two minima of the cost can be; `None` for a cost that is smooth over
    octaves, or over a fraction of the range where the scale is no ratio. `repeats`: whether it is
    the period of a wave over position or time, or its frequency. `moment`: whether it is the time
    of a change, which a few rows about it tell; `lasting`: or how long after the one before it that
    is over again.
    """

    name: str
    dimension: Dimension | str = DIMENSIONLESS
    bounds: Callable[[Scales], tuple[Array, Array]] | None = None
    logarithmic: bool = True
    resolution: Resolution | None = None
    repeats: bool = False
    moment: bool = False
    lasting: bool = False

    def period(self, value: float) -> float | None:
        """The period of the wave whose period or frequency it is; `None` for another parameter."""
        if not self.repeats:
            return None
        return 1 / value if self.dimension == FREQUENCY else value
