"""Further definitions of what [`stepping`][] has one of; compiled in where a machine has them.

The usual machine's program holds none of this, so that it stays as it is, number by number.
"""

import jax.numpy as jnp

# Elements side by side of Maxwell-slip friction, each with its share of the force, and the
# distance at which it slips in parts of the drawn one (Al-Bender, Lampaert & Swevers, IEEE TAC
# 50(11), 2005): a spread about one, so that the loop is round and not a corner.
ELEMENTS = (0.25, 0.6, 1.15, 2.0)
LUGRE, MAXWELL = 1.0, 2.0  # of a bristle; 0 is Dahl's
PARTIAL, CLIP, TANH = 0.0, 1.0, 2.0  # of a limit; of a dead-band PARTIAL is the hard one


def remember(p, memory, v, keep, span, level):
    """States beside the usual ones, a substep later.

    `level`: the dry friction at this velocity, N, with `coulomb` its part without the bump.
    """
    dry, coulomb = level
    moved = v * span / p["presliding_distance"]
    # dz/dt = v − σ0 abs(v) z/g(v), z in units of Fc/σ0 (Canudas de Wit et al. 1995, eq. 1).
    ratio = coulomb / dry
    settled = jnp.sign(v) / ratio
    lugre = settled + (memory.before - settled) * jnp.exp(-jnp.abs(moved) * ratio)
    rate = (lugre - memory.before) / span
    bristle = jnp.where(p["presliding_shape"] == LUGRE, lugre, memory.bristle)
    elements = jnp.clip(memory.elements + moved / jnp.array(ELEMENTS), -1.0, 1.0)
    bristle = jnp.where(p["presliding_shape"] == MAXWELL, jnp.mean(elements), bristle)
    second = memory.force + keep * (memory.force2 - memory.force)
    return memory._replace(
        before=lugre, rate=rate, bristle=bristle, elements=elements, force2=second
    )


def delivered(p, memory, x):
    """What is left of a command: dead-band, limit, gain, and a force constant by place."""
    force = jnp.where(p["lag_stages"] == 2.0, memory.force2, memory.force)
    size = jnp.abs(force)
    gap = jnp.maximum(p["deadband"], 1e-30)
    soft = size - p["deadband"] * jnp.tanh(size / gap)
    size = jnp.where(p["deadband_shape"] == TANH, soft, jnp.maximum(size - p["deadband"], 0.0))
    beyond = jnp.maximum(size - p["knee"], 0.0)
    partial = size - beyond * p["saturation"] / (1 + p["saturation"])
    shape, bent = p["saturation_shape"], p["knee"] * jnp.tanh(size / p["knee"])
    limited = jnp.where(shape == TANH, bent, jnp.minimum(size, p["knee"]))
    size = jnp.where(shape == PARTIAL, partial, limited)
    ripple = 1 + p["ripple"] * jnp.sin(2 * jnp.pi * x / p["pitch2"] + p["cogging2_phase"])
    constant = 1 - p["fall"] * ((x - p["fall_from"]) / p["fall_distance"]) ** 2
    return jnp.sign(force) * size / jnp.where(force > 0, 1 + p["gain"], 1.0) / ripple * constant


def field(p, x):
    """Cogging that is a triangle, and a second one at another pitch."""
    turn = 2 * jnp.pi
    wave = jnp.sin(turn * x / p["pitch"] + p["cogging_phase1"])
    triangle = p["triangle"] * 2 / jnp.pi * jnp.arcsin(wave)
    return triangle + p["second"] * jnp.sin(turn * x / p["pitch2"] + p["cogging2_phase"])


def dry_force(p, way, v, memory, level, coulomb):
    """Dry friction with its sign, N: by direction, by bristles, or smooth about zero velocity."""
    carried = jnp.where(p["presliding"] > 0, memory.bristle, way) * level.dry
    stiffness = coulomb / p["presliding_distance"]
    # Damping of a bristle by its own rate: the usual σ1 = √(σ0 M), times what is drawn.
    damping = p["bristle_damping"] * jnp.sqrt(stiffness * p["mass"]) * p["presliding_distance"]
    lugre = memory.bristle * coulomb + damping * memory.rate
    carried = jnp.where((p["presliding_shape"] == LUGRE) & (p["presliding"] > 0), lugre, carried)
    smooth = jnp.tanh(v / jnp.maximum(p["smooth_speed"], 1e-30)) * level.dry
    return jnp.where(p["smooth_speed"] > 0, smooth, carried)


def resistance(p, v, level):
    """Of smooth friction, N·s/m: the step is implicit in it, so that none is too steep."""
    speed = jnp.maximum(p["smooth_speed"], 1e-30)
    ratio = jnp.abs(v) / speed
    slope = jnp.where(ratio > 1e-3, jnp.tanh(ratio) / jnp.maximum(ratio, 1e-3), 1.0)
    return jnp.where(p["smooth_speed"] > 0, level.dry * slope / speed, 0.0)


def engaged(p, motor, load, way):
    """Whether the motor is at the flank of an ideal play that it moves, or pushes, against."""
    apart = motor.position - load.position
    flank = jnp.abs(apart) >= p["play"] * (1 - 1e-6)
    return ((p["play"] == 0) | (flank & (way * apart > 0))).astype(apart.dtype)


def dragged(p, load, middle, v, touching, span):
    """Where the load lies a half-step after `middle`, and the motor's speed then.

    The load moves only with the motor. Where that meets a flank, the load, which rests, takes its
    part of the momentum.
    """
    ahead = middle + 0.5 * span * v - load.position
    met = (p["play"] > 0) & (jnp.abs(ahead) > p["play"]) & (touching == 0)
    slower = jnp.where(met, v * (1 - p["play_share"]), v)
    x = middle + 0.5 * span * slower
    place = jnp.clip(load.position, x - p["play"], x + p["play"])
    return jnp.where(met, x - jnp.sign(ahead) * p["play"], place), slower
