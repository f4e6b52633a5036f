"""How many steps the integration takes a sample."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .. import signals
from ..data.recording import Recording, anonymous
from ..models import Model
from .memory import Augmented, holds
from .plant import Plant, Surroundings, slowest
from .setpoint import set_point

# Between two samples the actuator force is constant, so the acceleration changes only as fast as
# the terms let it: at their rates λ = |∂F/∂v|/M and √(|∂F/∂x|/M). A midpoint step of h = 0.1/λ
# errs by (hλ)³/6, which over a time constant (ten steps) is 0.2 % of the motion.
RATE_PER_STEP = 0.1
# Bounds the cost where a friction curve is (nearly) vertical beside zero velocity.
MOST_SUBSTEPS = 64
# Inside jax.jit the rates are not known when the program is built.
TRACED_SUBSTEPS = 8
# Speeds, relative to the fastest of the reference, at which the rates are looked at.
_SPEEDS = tuple(10.0 ** (-k / 2) for k in range(9))


def default_substeps(
    model: Model, reference: Recording, smooth: float | Float[Array, ""] | None = None
) -> int:
    """Integration steps a sample that make the midpoint rule accurate to a few parts in a thousand.

    The sampling interval times the fastest rate of the model at positions and (down to a ten
    thousandth of) velocities of the reference, over 0.1; between 1 and 64. Inside `jax.jit`: 8.
    """
    if signals.is_traced((model, reference, smooth)):
        return TRACED_SUBSTEPS
    with jax.ensure_compile_time_eval():
        mass, slopes = jax.tree.map(np.asarray, rates(model, reference, smooth))
        with np.errstate(all="ignore"):  # what is not finite gets the most steps
            damping, stiffness = (np.nan_to_num(np.abs(slope)) / mass for slope in slopes)
            rate = float(np.max(np.maximum(damping, np.sqrt(stiffness))))
        steps = float(signals.interval(reference)) * rate / RATE_PER_STEP
    if not math.isfinite(steps):
        return MOST_SUBSTEPS
    return min(max(math.ceil(steps), 1), MOST_SUBSTEPS)


def rates(model, reference: Recording, smooth):
    """Inertia, ∂F/∂v and ∂F/∂x at states of the reference, each `(256, 2 speeds + 1)`."""
    return _rates(model, anonymous(reference), smooth)


@eqx.filter_jit
def _rates(model, reference, smooth):
    dtype = reference.time.dtype
    axis = model.without("predicted_")
    model, smooth = cast((axis, None if smooth is None else jnp.asarray(smooth)), dtype)
    plant = plant_of(model, smooth)
    together = reference.segment[1:] == reference.segment[:-1]
    goal, velocity = set_point(reference, True, together)
    speeds = jnp.nanmax(jnp.abs(velocity)) * jnp.asarray(_SPEEDS, dtype)
    speeds = jnp.maximum(speeds, slowest(dtype))
    rest = [] if smooth is None else [jnp.zeros(1, dtype)]
    grid = jnp.concatenate([speeds, -speeds, *rest])
    chosen = np.linspace(0, goal.shape[0] - 1, 256).astype(int)
    channels = {name: channel[chosen] for name, channel in reference.channels.items()}
    each_speed = jax.vmap(plant.rates, in_axes=(None, 0, None))
    surroundings = Surroundings(reference.time[chosen], channels)
    return jax.vmap(each_speed, in_axes=(0, None, 0))(goal[chosen], grid, surroundings)


def plant_of(model, smooth):
    """The plant of a model: with states for its memory where it has any."""
    return Augmented(model) if holds(model) else Plant(model, smooth)


def cast(tree, dtype):
    """Every floating-point leaf in the recording's precision."""

    def one(leaf):
        inexact = eqx.is_array_like(leaf) and jnp.issubdtype(jnp.asarray(leaf).dtype, jnp.floating)
        return jnp.asarray(leaf, dtype) if inexact else leaf

    return jax.tree.map(one, tree)
