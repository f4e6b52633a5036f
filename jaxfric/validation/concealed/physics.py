"""A machine in closed loop, written a second time and apart from [`jaxfric.simulation`][].

What conceals an effect must not be the program that looks for it: this simulator shares no code
with the library's plant and terms, only their equations. One compiled program serves every
machine, for each effect is an argument that is zero where the effect is absent. Each sample is
cut into substeps; in each the position moves half, the velocity is kicked by the forces there,
and the position moves the other half. Friction can stop a body but not turn it round (Karnopp,
"Computer simulation of stick-slip friction in mechanical dynamic systems", ASME J. Dyn. Syst.
Meas. Control 107(1), 1985, with the band of zero velocity shrunk to nothing).
"""

from functools import partial

import jax
import numpy as np

from .stepping import LONGEST, Inputs, Motion, one

# Every scalar of the physics and its value where there is none of it. Forces are on the side of
# the motor: u = M a + friction + field + …
ABSENT = {
    # one body: inertia, constant force, friction of each direction
    "mass": 1.0, "offset": 0.0,
    "coulomb+": 1.0, "viscous+": 0.0, "bump+": 0.0, "bump_speed+": 1.0,
    "coulomb-": 1.0, "viscous-": 0.0, "bump-": 0.0, "bump_speed-": 1.0,
    "bump_shape": 0.0,  # 0 Gaussian, 1 Lorentzian, 2 exponential, 3 exponent a half
    # friction of another kind
    "drag": 0.0, "thinning": 0.0, "thinning_speed": 1.0,
    "power": 0.0, "power_speed": 1.0, "exponent": 1.0,
    "load_friction": 0.0, "acceleration_friction": 0.0, "acceleration_scale": 1.0,
    "presliding": 0.0, "presliding_distance": 1.0, "friction_lag": 0.0,
    "still": 0.0,  # speed below which a bristle's creep counts as rest in `Motion.hidden`
    # functions of position
    "unbalance": 0.0, "unbalance_period": 1.0, "unbalance_phase": 0.0,
    "cogging1": 0.0, "cogging2": 0.0, "cogging3": 0.0, "pitch": 1.0,
    "cogging_phase1": 0.0, "cogging_phase2": 0.0, "cogging_phase3": 0.0,
    "spring": 0.0, "spring_rest": 0.0, "cubic": 0.0, "cubic_centre": 0.0,
    "upper_stop": 0.0, "upper_stop_at": 0.0, "lower_stop": 0.0, "lower_stop_at": 0.0,
    "wavy_friction": 0.0, "wavy_friction_period": 1.0, "wavy_friction_phase": 0.0,
    "spot": 0.0, "spot_at": 0.0, "spot_width": 1.0,
    "wavy_mass": 0.0, "wavy_mass_period": 1.0, "wavy_mass_phase": 0.0,
    "hysteresis": 0.0, "hysteresis_centre": 0.0, "hysteresis_distance": 1.0,
    # actuator
    "delay": 0.0, "delay_swing": 0.0, "delay_period": 1.0, "lag": 0.0,
    "deadband": 0.0, "saturation": 0.0, "knee": 1.0, "gain": 0.0,
    # second body behind a spring, with a gap
    "load_share": 0.0, "load_friction_share": 0.0,
    "stiffness": 0.0, "damping": 0.0, "half_gap": 0.0,
    # further definitions, of `variants`
    "smooth_speed": 0.0, "presliding_shape": 0.0, "bristle_damping": 0.0, "lag_stages": 1.0,
    "deadband_shape": 0.0, "saturation_shape": 0.0, "reaction_friction": 0.0,
    "triangle": 0.0, "second": 0.0, "pitch2": 1.0, "cogging2_phase": 0.0, "ripple": 0.0,
    "fall": 0.0, "fall_from": 0.0, "fall_distance": 1.0,
    "play": 0.0, "play_share": 0.0, "play_friction_share": 0.0,
    # loop and sensor
    "kp": 0.0, "ki": 0.0, "kd": 0.0, "velocity_filter": 1.0, "limit": np.inf, "resolution": 1.0,
}  # fmt: skip

# Those that need the larger program.
FURTHER = (
    "smooth_speed", "presliding_shape", "lag_stages", "deadband_shape", "saturation_shape",
    "triangle", "second", "ripple", "play", "fall",
)  # fmt: skip


def run(parameters: list[dict[str, float]], inputs: list[Inputs], substeps: int) -> list[Motion]:
    """Several runs of equal length at once, in double precision whatever the caller's setting."""
    count = inputs[0].goal.shape[0]
    if count > LONGEST:
        raise ValueError(f"A run of {count} samples: the simulator takes {LONGEST} at most.")
    padded = [Inputs(*(np.pad(x, (0, LONGEST - count)) for x in each)) for each in inputs]
    columns = Inputs(*(np.stack(rows) for rows in zip(*padded, strict=True)))
    scalars = {k: np.array([p.get(k, v) for p in parameters], float) for k, v in ABSENT.items()}
    unknown = {k for p in parameters for k in p} - set(ABSENT)
    if unknown:
        raise ValueError(f"The simulator has no parameter {', '.join(sorted(unknown))}.")
    two = bool(np.any(scalars["load_share"] > 0))
    more = any(np.any(scalars[name] != ABSENT[name]) for name in FURTHER)
    with jax.enable_x64(True):
        found = _runs(scalars, columns, np.int32(count), np.int32(substeps), two, more)
        host = [np.asarray(x)[:, :count] for x in found]
    return [Motion(*(x[i] for x in host)) for i in range(len(inputs))]


@partial(jax.jit, static_argnames=("two", "more"))
def _runs(scalars, columns, count, substeps, two, more):
    each = jax.vmap(partial(one, two=two, more=more), in_axes=(0, 0, None, None))
    return each(scalars, columns, count, substeps)
