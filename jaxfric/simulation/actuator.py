"""Between the command and the axis: a dead time, a lag, and what an actuator makes of a force.

A model's terms that read the signal `predicted_force` say which command u the force f needs,
u = h(f). In a simulation the command is given, and f is what arrives: h is solved for it.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..models import Model
from ..terms.actuator import PREDICTED, REACTION
from ..terms.base import Sum
from ..terms.effects import traits
from ..units import DIMENSIONLESS
from .plant import Scalar, Surroundings, slowest

# The solution is bracketed by 16 intervals five times over, to a millionth of the force, and lies
# on the straight line between the ends: the laws bend at single forces only.
_ROUNDS, _POINTS = 5, 17
# No law takes more off a force than leaves a tenth of it: a gain that is lower is no actuator's.
_LEAST = 0.1
# Inside jax.jit, where the delay is not known when the program is built, it may be as many samples.
_TRACED_DEPTH = 128


class History(NamedTuple):
    """What is on its way: `age` and `impulse` of the commands up to each of the last samples.

    Both relative to the present one, s and N·s, `(depth,)`, the oldest first; `lagged`, N.
    """

    age: Array
    impulse: Array
    lagged: Array


class Actuator(eqx.Module):
    """What a model says of its actuator; `faults` holds the terms that are functions of f, `whole`
    the force limit.
    """

    faults: Model | None
    whole: Model
    delay: Scalar
    lag: Scalar
    depth: int = eqx.field(static=True)

    def start(self) -> History:
        """Nothing on its way."""
        zeros = jnp.zeros(self.depth, jnp.result_type(self.delay))
        return History(zeros, zeros, jnp.zeros((), zeros.dtype))

    def begin(self, history: History, restart: Array, command: Scalar, span: Scalar) -> History:
        """The history at a sample; a segment starts as if its first command had always been."""
        steps = jnp.arange(1 - self.depth, 1, dtype=history.age.dtype)
        age = steps * jnp.where(span > 0, jnp.maximum(span, self.delay), 1 + self.delay)
        fresh = History(age, age * command, command)
        return jax.tree.map(lambda new, old: jnp.where(restart, new, old), fresh, history)

    def acting(self, history: History, command: Scalar, since: Scalar, span: Scalar):
        """The force after dead time and lag: its mean over `span` from `since` on, and then."""
        ages = jnp.append(history.age, since + span)
        impulses = jnp.append(history.impulse, (since + span) * command)
        ends = jnp.stack([since, since + span]) - self.delay
        first, last = jnp.interp(ends, ages, impulses)
        mean = jnp.where(span > 0, (last - first) / jnp.where(span > 0, span, 1.0), command)
        share = span / jnp.where(self.lag > 0, self.lag, 1.0)
        long = (self.lag > 0) & (span > 0)
        kept = jnp.where(long, -jnp.expm1(-share) / jnp.where(long, share, 1.0), 0.0)
        away = history.lagged - mean
        after = mean + away * jnp.where(long, jnp.exp(-share), 0.0)
        lagged = jnp.where(span > 0, after, history.lagged)
        return mean + away * kept, history._replace(lagged=lagged)

    def pass_on(self, history: History, command: Scalar, span: Scalar) -> History:
        """The history a sample later."""
        age = jnp.append(history.age[1:] - span, 0.0)
        impulse = jnp.append(history.impulse[1:], 0.0) - span * command
        return History(age, impulse.at[-1].set(0.0), history.lagged)

    def arriving(self, force: Scalar, position: Scalar, rest: Surroundings) -> Array:
        """The force that the axis feels: one, or `(2,)` where it moves forward or backward."""
        force = self.whole.arriving(force)
        if self.faults is None:
            return force
        most = jnp.abs(force) + _levels(self.faults)
        low = -most / _LEAST * jnp.ones(2, force.dtype)
        high, share = -low, jnp.linspace(0.0, 1.0, _POINTS, dtype=force.dtype)

        def narrow(_, ends):
            low, high = ends
            tried = low[:, None] + share[None] * (high - low)[:, None]
            below = self._command(tried, position, rest) <= force
            at = jnp.clip(jnp.sum(below, axis=1) - 1, 0, _POINTS - 2)
            return tuple(jnp.take_along_axis(tried, (at + i)[:, None], 1)[:, 0] for i in (0, 1))

        ends = jax.lax.stop_gradient((low, high))
        low, high = jax.lax.stop_gradient(jax.lax.fori_loop(0, _ROUNDS, narrow, ends))
        left, right = jnp.moveaxis(self._command(jnp.stack([low, high], 1), position, rest), 1, 0)
        rise = jnp.where(right > left, right - left, 1.0)
        return low + jnp.clip((force - left) / rise, 0.0, 1.0) * (high - low)

    def _command(self, force: Float[Array, "2 n"], position: Scalar, rest: Surroundings):
        """h(f), N, of forces with which the axis moves forward and backward."""
        assert self.faults is not None
        slow = slowest(force.dtype)
        velocity = jnp.broadcast_to(jnp.stack([slow, -slow])[:, None], force.shape)
        motion = rest.motion(position, jnp.ravel(velocity))
        channels = motion.channels | {PREDICTED: jnp.ravel(force)}
        motion = eqx.tree_at(lambda r: r.channels, motion, channels)
        return force + jnp.reshape(self.faults.force(motion), force.shape)


def parted(model: Model, interval: float | None) -> tuple[Model, Actuator | None]:
    """The axis without its actuator, and the actuator; `None` where the model says nothing of it.

    `interval`: the shortest time between samples, s; `None` inside `jax.jit`.
    """
    pairs = model.pairs()
    if model.force_limit is None and not any(PREDICTED in t.coordinates for t, _ in pairs):
        return model, None
    times = {"delay": jnp.zeros_like(model.alpha[0]), "lag": jnp.zeros_like(model.alpha[0])}
    faults = []
    for term, alpha in pairs:
        if PREDICTED in term.coordinates:
            effect = traits(term)
            if effect.logged:
                continue
            if effect.late:
                times["delay" if effect.shift else "lag"] += alpha[0]
            else:
                faults.append((term, alpha))
    depth = _TRACED_DEPTH if interval is None else 2 + math.ceil(_count(times["delay"], interval))
    terms = tuple(term for term, _ in faults)
    held = None
    if terms:
        held = Model(Sum(terms), jnp.concatenate([alpha for _, alpha in faults]), model.units)
    axis = model.only(lambda term: PREDICTED not in term.coordinates)
    return axis, Actuator(held, model, times["delay"], times["lag"], depth)


def _count(delay: Scalar, interval: float) -> float:
    """The samples that a delay spans."""
    return max(float(delay), 0.0) / interval if interval > 0 else 0.0


def _levels(faults: Model) -> Scalar:
    """The sum of the parameters that are forces themselves, N."""
    sizes = [
        jnp.abs(value)
        for parameter, value in zip(faults.term.affine, faults.alpha, strict=True)
        if parameter.dimension != DIMENSIONLESS
    ]
    return sum(sizes, jnp.zeros_like(faults.alpha[0]))


def check(model: Model) -> None:
    """Raise `ValueError` for a law that needs less than a tenth of a force as its command, or for
    friction that takes all of its load.
    """
    for term, alpha in model.pairs():
        if REACTION in term.coordinates and not float(jnp.max(jnp.abs(alpha))) < 1:
            raise ValueError(
                f"{term.affine[0].name} is {float(alpha[0]):.3g}: an axis whose friction is all of "
                "its load locks itself. Identify anew, or leave out the term."
            )
        if PREDICTED not in term.coordinates:
            continue
        for parameter, value in zip(term.affine, alpha, strict=True):
            if parameter.dimension == DIMENSIONLESS and float(value) < _LEAST - 1:
                raise ValueError(
                    f"{parameter.name} is {float(value):.3g}: no actuator needs less than a tenth "
                    "of its force as command. Identify anew, or leave out the term."
                )
