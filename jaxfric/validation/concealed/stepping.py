"""The stepping of [`physics`][]: loop, actuator, friction and bodies."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from . import variants

LONGEST = 65536  # samples that fit into the compiled program


class Inputs(NamedTuple):
    """What changes from sample to sample, each `(N,)`.

    `interval` to the next sample, s; `goal`, `goal_speed`: the set-point; `load`: force that
    depends on time alone, N; `coulomb`, `viscous`: what is added to friction; `noise` of the
    encoder before it counts.
    """

    interval: np.ndarray
    goal: np.ndarray
    goal_speed: np.ndarray
    load: np.ndarray
    coulomb: np.ndarray
    viscous: np.ndarray
    noise: np.ndarray


class Motion(NamedTuple):
    """What came out, each `(N,)`.

    `force`: commanded, held from its sample to the next; `counted`: position by the encoder;
    `position`, `velocity`: true, at the sample; `hidden`: mean over the sample of what the
    command is beyond M a + friction + offset, without that of `Inputs.load`.
    """

    force: np.ndarray
    counted: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    hidden: np.ndarray


class _Body(NamedTuple):
    position: jax.Array
    velocity: jax.Array


class _Memory(NamedTuple):
    """State beside the bodies: actuator, bristles, lagged speed (twice), smoothed acceleration.

    With `variants`: a second stage of the actuator, LuGre's bristle and its rate, Maxwell slip.
    """

    force: jax.Array
    bristle: jax.Array
    hysteresis: jax.Array
    speed1: jax.Array
    speed2: jax.Array
    acceleration: jax.Array
    force2: jax.Array | None = None
    before: jax.Array | None = None
    rate: jax.Array | None = None
    elements: jax.Array | None = None


class _Level(NamedTuple):
    dry: jax.Array
    wet: jax.Array
    base: jax.Array


def one(p, inputs, count, substeps, two, more):
    """One run with scalar parameters `p`: every [`Motion`][] padded to `LONGEST`.

    `two`: with a second body; `more`: with the further definitions of `variants`.
    """
    zero = jnp.zeros(())
    start = _Body(inputs.goal[0], inputs.goal_speed[0])
    way = jnp.sign(start.velocity)
    memory = _Memory(zero, way, way, zero, zero, zero)
    if more:
        slipping = jnp.full(len(variants.ELEMENTS), way)
        memory = memory._replace(force2=zero, before=way, rate=zero, elements=slipping)
    loop = (start.position, start.velocity, zero)
    outputs = Motion(*(jnp.zeros(LONGEST) for _ in Motion._fields))

    def sample(k, carry):
        motor, load, memory, loop, outputs = carry
        now = Inputs(*(column[k] for column in inputs))
        before = inputs.interval[jnp.maximum(k - 1, 0)]
        command, counted, loop = _control(p, loop, motor.position, now, before)
        forces = outputs.force.at[k].set(command)
        acting = _late(p, forces, k, motor.position, now.interval)
        motor, load, memory, hidden = _advance(
            p, (motor, load, memory), now, command, acting, substeps, two, more
        )
        fresh = (command, counted, carry[0].position, carry[0].velocity, hidden)
        rows = zip(outputs[1:], fresh[1:], strict=True)
        outputs = Motion(forces, *(rows_.at[k].set(value) for rows_, value in rows))
        return motor, load, memory, loop, outputs

    return jax.lax.fori_loop(0, count, sample, (start, start, memory, loop, outputs))[-1]


def _control(p, loop, position, now, before):
    """PID on encoder counts, the velocity by filtered backward difference."""
    last, speed, integral = loop
    counted = jnp.round((position + now.noise) / p["resolution"]) * p["resolution"]
    speed = speed + p["velocity_filter"] * ((counted - last) / before - speed)
    error = now.goal - counted
    summed = integral + error * now.interval
    asked = p["kp"] * error + p["ki"] * summed + p["kd"] * (now.goal_speed - speed)
    command = jnp.clip(asked, -p["limit"], p["limit"])
    return command, counted, (counted, speed, jnp.where(command == asked, summed, integral))


def _late(p, forces, k, position, interval):
    """The two commands that act during a sample, and when in it the second takes over (0–1)."""
    swing = jnp.sin(2 * jnp.pi * position / p["delay_period"])
    samples = (p["delay"] + p["delay_swing"] * (1 + swing)) / interval
    whole = jnp.floor(samples)
    newest = k - whole.astype(jnp.int32)
    older, newer = forces[jnp.maximum(newest - 1, 0)], forces[jnp.maximum(newest, 0)]
    return older, newer, samples - whole


def _advance(p, state, now, command, acting, substeps, two, more):
    parts = substeps.astype(now.interval.dtype)
    span = now.interval / parts
    older, newer, takeover = acting
    keep = jnp.where(p["lag"] > 0, jnp.exp(-span / jnp.where(p["lag"] > 0, p["lag"], 1.0)), 0.0)
    half = 0.5 * p["friction_lag"]
    slow = jnp.where(half > 0, jnp.exp(-span / jnp.where(half > 0, half, 1.0)), 0.0)

    def substep(i, carry):
        motor, load, memory, total = carry
        force = jnp.where((i.astype(parts.dtype) + 0.5) / parts >= takeover, newer, older)
        memory = _remember(p, memory, motor, force, keep, slow, span)
        if more:
            level = _dry(p, jnp.sign(motor.velocity), jnp.abs(motor.velocity))
            memory = variants.remember(p, memory, motor.velocity, keep, span, level)
        motor, load, memory, hidden = _kick(p, motor, load, memory, now, span, two, more)
        return motor, load, memory, total + hidden

    motor, load, memory, total = jax.lax.fori_loop(0, substeps, substep, (*state, jnp.zeros(())))
    # The delivered force is part of `total` with its sign, so that the command is added once.
    return motor, load, memory, command + total / parts


def _remember(p, memory, motor, force, keep, slow, span):
    speed, way = jnp.abs(motor.velocity), jnp.sign(motor.velocity)
    first = speed + slow * (memory.speed1 - speed)
    moved = speed * span
    return memory._replace(
        force=force + keep * (memory.force - force),
        bristle=way + (memory.bristle - way) * jnp.exp(-moved / p["presliding_distance"]),
        hysteresis=way + (memory.hysteresis - way) * jnp.exp(-moved / p["hysteresis_distance"]),
        speed1=first,
        speed2=first + slow * (memory.speed2 - first),
    )


def _delivered(p, force):
    """What is left of a command: the laws u = f + δ sign f, + c max(|f| − U, 0), + κ max(f, 0)."""
    size = jnp.maximum(jnp.abs(force) - p["deadband"], 0.0)
    beyond = jnp.maximum(size - p["knee"], 0.0)
    size = size - beyond * p["saturation"] / (1 + p["saturation"])
    return jnp.sign(force) * size / jnp.where(force > 0, 1 + p["gain"], 1.0)


def _dry(p, way, speed):
    """Dry friction at a speed, and its part without the bump, N."""
    coulomb = _side(p, "coulomb", way)
    return coulomb + _side(p, "bump", way) * _bump(p, speed, _side(p, "bump_speed", way)), coulomb


def _kick(p, motor, load, memory, now, span, two, more):
    """One substep of both bodies, and what stands beside M a + friction + offset in it."""
    middle = motor.position + 0.5 * span * motor.velocity
    given = variants.delivered(p, memory, middle) if more else _delivered(p, memory.force)
    mass, field = _field(p, middle, motor.velocity, memory)
    if more:
        field = field + variants.field(p, middle)
    pull, load_after = _second(p, motor, load, now, span) if two else (0.0, load)
    free = given - field - p["offset"] - now.load - pull
    moving = motor.velocity != 0
    way = jnp.where(moving, jnp.sign(motor.velocity), jnp.sign(free))
    level = _friction(p, way, motor.velocity, middle, given, memory, now)
    elastic = p["presliding"] > 0
    dry = jnp.where(elastic, memory.bristle, way) * level.dry
    if more:
        touching = variants.engaged(p, motor, load, way)
        alone = 1 - touching
        mass = mass - alone * p["play_share"] * p["mass"]
        less = 1 - alone * p["play_friction_share"]
        level = level._replace(dry=less * level.dry, wet=less * level.wet)
        elastic = elastic | (p["smooth_speed"] > 0)
        dry = variants.dry_force(p, way, motor.velocity, memory, level, _side(p, "coulomb", way))
    friction = dry + way * level.wet
    friction = friction + way * _of_reaction(p, way, free - friction)
    stuck = ~moving & ~elastic & (jnp.abs(free) <= level.dry + level.wet)
    resistance = variants.resistance(p, motor.velocity, level) if more else 0.0
    rate = jnp.where(stuck, 0.0, (free - friction) / (mass + span * resistance))
    if more:
        friction = friction + span * resistance * rate
    velocity = motor.velocity + rate * span
    stops = moving & ~elastic & (velocity * motor.velocity < 0)
    velocity = jnp.where(stops, 0.0, velocity)
    rate = (velocity - motor.velocity) / span
    blow = 0.0
    if more:
        place, slower = variants.dragged(p, load, middle, velocity, touching, span)
        load_after = load_after._replace(
            position=jnp.where(p["play"] > 0, place, load_after.position)
        )
        blow, velocity = (slower - velocity) / span, slower
    after = _Body(middle + 0.5 * span * velocity, velocity)
    # A stuck axis hides any force: its friction counts as the baseline's.
    rests = stuck | stops | (elastic & (jnp.abs(motor.velocity) < p["still"]))
    beyond = jnp.where(rests, 0.0, friction - way * level.base)
    hidden = field + pull + beyond - given + (mass - p["mass"]) * rate - p["mass"] * blow
    smooth = memory.acceleration + (rate - memory.acceleration) * jnp.minimum(span / 2e-3, 1.0)
    return after, load_after, memory._replace(acceleration=smooth), hidden


def _field(p, x, v, memory):
    """Inertia of the motor's body, and force that depends on position."""
    turn = 2 * jnp.pi
    wave = turn * x / p["wavy_mass_period"] + p["wavy_mass_phase"]
    mass = p["mass"] * (1 - p["load_share"]) + p["wavy_mass"] * jnp.sin(wave)
    slope = p["wavy_mass"] * turn / p["wavy_mass_period"] * jnp.cos(wave)
    angle = turn * x / p["pitch"]
    field = (
        0.5 * slope * v**2
        + p["unbalance"] * jnp.sin(turn * x / p["unbalance_period"] + p["unbalance_phase"])
        + p["cogging1"] * jnp.sin(angle + p["cogging_phase1"])
        + p["cogging2"] * jnp.sin(2 * angle + p["cogging_phase2"])
        + p["cogging3"] * jnp.sin(3 * angle + p["cogging_phase3"])
        + p["spring"] * (x - p["spring_rest"])
        + p["cubic"] * (x - p["cubic_centre"]) ** 3
        + p["upper_stop"] * jnp.maximum(x - p["upper_stop_at"], 0.0)
        + p["lower_stop"] * jnp.minimum(x - p["lower_stop_at"], 0.0)
        + p["hysteresis"] * jnp.abs(x - p["hysteresis_centre"]) * memory.hysteresis
    )
    return mass, field


def _bump(p, speed, width):
    ratio = speed / width
    bell = jnp.where(p["bump_shape"] == 1.0, 1 / (1 + ratio**2), 0.0)
    power = jnp.where(p["bump_shape"] == 2.0, ratio, ratio**2)
    power = jnp.where(p["bump_shape"] == 3.0, jnp.sqrt(ratio), power)
    decay = jnp.exp(-power)
    return jnp.where(p["bump_shape"] == 1.0, bell, decay)


def _side(p, name, way):
    return jnp.where(way > 0, p[name + "+"], p[name + "-"])


def _friction(p, way, v, x, force, memory, now):
    """Friction's magnitude: `dry` (what a bristle carries), `wet`; `base`: all that is healthy."""
    speed = jnp.abs(v)
    carried = jnp.where(p["presliding"] > 0, memory.bristle, way)
    share = 1 - p["load_friction_share"]
    late = _bump(p, memory.speed2, _side(p, "bump_speed", carried))
    dry = _side(p, "coulomb", carried) + _side(p, "bump", carried) * late
    prompt = _bump(p, speed, _side(p, "bump_speed", way))
    viscous = _side(p, "viscous", way) * speed
    base = _side(p, "coulomb", way) + _side(p, "bump", way) * prompt + viscous
    wave = 2 * jnp.pi * x / p["wavy_friction_period"] + p["wavy_friction_phase"]
    spot = jnp.exp(-0.5 * ((x - p["spot_at"]) / p["spot_width"]) ** 2)
    power = jnp.exp(p["exponent"] * jnp.log(jnp.maximum(speed / p["power_speed"], 1e-30)))
    fast = jnp.abs(memory.acceleration)
    extra = (
        now.coulomb
        + now.viscous * speed
        + p["drag"] * speed**2
        + p["thinning"] * speed / (1 + speed / p["thinning_speed"])
        + p["power"] * power
        + p["wavy_friction"] * jnp.sin(wave)
        + p["spot"] * spot
        + p["load_friction"] * jnp.abs(force) / (1 + p["load_friction"] * way * jnp.sign(force))
        + p["acceleration_friction"] * fast / (fast + p["acceleration_scale"])
    )
    return _Level(share * dry, share * viscous + extra, base)


def _of_reaction(p, way, left):
    """Friction by the force of inertia r, μ abs(r), where r and it are what is `left`."""
    return (
        p["reaction_friction"] * jnp.abs(left) / (1 + p["reaction_friction"] * way * jnp.sign(left))
    )


def _second(p, motor, load, now, span):
    """Force of the coupling on the motor, and the load a substep later."""
    stretch = motor.position - load.position
    beyond = stretch - jnp.clip(stretch, -p["half_gap"], p["half_gap"])
    touching = (beyond != 0) | (p["half_gap"] == 0)
    force = p["stiffness"] * beyond + p["damping"] * (motor.velocity - load.velocity)
    # Flanks push and do not pull.
    force = jnp.where(touching, force, 0.0)
    force = jnp.where((p["half_gap"] > 0) & (force * beyond < 0), 0.0, force)
    moving = load.velocity != 0
    way = jnp.where(moving, jnp.sign(load.velocity), jnp.sign(force))
    speed = jnp.abs(load.velocity)
    dry = _side(p, "coulomb", way) + _side(p, "bump", way) * _bump(
        p, speed, _side(p, "bump_speed", way)
    )
    level = p["load_friction_share"] * (dry + _side(p, "viscous", way) * speed)
    stuck = ~moving & (jnp.abs(force) <= level)
    rate = jnp.where(stuck, 0.0, (force - way * level) / (p["mass"] * p["load_share"]))
    velocity = load.velocity + rate * span
    velocity = jnp.where(moving & (velocity * load.velocity < 0), 0.0, velocity)
    position = load.position + 0.5 * span * (load.velocity + velocity)
    return force, _Body(position, velocity)
