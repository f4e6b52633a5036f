"""Drawing a machine, and what is concealed in it, from a seed."""

import copy
import dataclasses
import zlib
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.random import Generator

from .definitions import LOG, STICK, definition, usual
from .kinds import kind
from .machines import (
    SHAPES,
    Machine,
    draw_band,
    draw_friction,
    draw_loop,
    draw_noise,
    draw_plan,
    log_uniform,
    reference,
    tied,
)
from .nominal import Kind, nominal
from .physics import ABSENT
from .sticking import fewest, sticking
from .tuning import BURST, tune

# How often a loop that bursts is made half as fast before it is given up.
_SLOWER = 4


def draw(
    seed: int,
    effects: Sequence[str] = (),
    size: float | tuple[float, float] = (0.02, 0.30),
    definitions: Mapping[str, str] | None = None,
) -> Machine:
    """A machine drawn at random, with the effects named concealed in it.

    **Arguments:** `seed`, zero or more: the same seed is the same machine, whatever is concealed,
    but for what an effect needs to be seen (a large inertia, a slow loop); `effects`, names out of
    [`names`][] or [`OUTSIDE`][]; `size`, the root mean square of an effect's force over the
    set-point's motion in parts of the Coulomb level: one number, or the range of a log-uniform
    draw. What would not be physical any more is not made, so that the size in `Machine.truth` can
    be smaller; `definitions`, of an effect, `stick` or `log`: by which physics, where that is not
    the usual.

    A loop that bursts with the effect is made slower.

    **Raises:** `ValueError` for an effect that there is none of, or one named twice, or for a loop
    that bursts however slow.
    """
    effects, asked = tuple(effects), dict(definitions or {})
    kinds = _checked(effects, asked)
    rng = np.random.default_rng((seed, 0))
    plan = draw_plan(rng, seed)._replace(fewest=fewest(asked.get(STICK, "")))
    time = np.arange(plan.samples) / plan.sample_rate
    x, v = reference(plan, seed, 0)
    coulomb, top = log_uniform(rng, 1e-5, 3e3), float(np.quantile(np.abs(v), 0.98))
    baseline, friction = _friction(rng, kinds, coulomb, top)
    omega = draw_band(rng, plan, slowest=any(kind.slow for kind in kinds))

    def driven(rng, omega) -> Machine:
        # Coulomb friction may bend the loop by a twentieth of the stroke.
        mass = max(_mass(rng, v, time, coulomb, kinds), 20 * coulomb / (plan.stroke * omega**2))
        loop, noise = draw_loop(rng, mass, coulomb, omega, plan)
        physics = {**ABSENT, "mass": mass, **friction, **loop, "still": 1e-3 * top}
        # Far above what the motion needs: a limit that is met would be an effect of its own.
        hardest = mass * float(np.quantile(np.abs(np.gradient(v, time)), 0.999))
        physics["limit"] = 8 * coulomb + 3 * hardest
        blur = draw_noise(rng, coulomb, noise)
        n = nominal(time, x, v, coulomb, physics, plan)
        physics = physics | sticking(asked.get(STICK, ""), n)
        own = {of: asked[of] for of in (STICK, LOG) if of in asked}
        healthy = Machine(seed, (), baseline, coulomb, physics, plan, blur, {}, own)
        return _with(healthy, effects, n._replace(physics=physics), size, asked)

    for _ in range(_SLOWER):
        machine = driven(copy.deepcopy(rng), omega)
        if all(truth["size"] < BURST for truth in machine.truth.values()):
            return machine
        # Nobody runs a loop that bursts: whoever tunes it lowers its gains.
        omega /= 2
    raise ValueError(f"The loop of machine {seed} with {', '.join(effects)} bursts.")


def _friction(rng, kinds, coulomb: float, top: float) -> tuple[str, dict[str, float]]:
    """The name of the baseline that fits the healthy machine, and its friction."""
    shape = _shape(rng, kinds)
    friction, baseline = draw_friction(rng, coulomb, top, shape), shape or "coulomb-viscous"
    if any(kind.tied for kind in kinds):
        friction, baseline = tied(friction), f"symmetric-{baseline}"
    if any(kind.bump for kind in kinds):
        friction = _pronounced(friction, coulomb, top)
    return baseline, friction


def _with(machine: Machine, effects, n, size, asked) -> Machine:
    """The machine with effects, one after the other: each knows the friction of those before."""
    for name in effects:
        truth = _conceal(machine, name, n, size, asked.get(name, ""))
        own = kind(name, truth["definition"])
        physics = {**machine.physics, **own.physics(truth, machine.physics)}
        both = (*machine.effects, name), {**machine.truth, name: truth}
        machine = dataclasses.replace(machine, effects=both[0], physics=physics, truth=both[1])
        n = n._replace(physics=physics)
    return machine


def _checked(effects, asked) -> list[Kind]:
    if len(set(effects)) < len(effects):
        raise ValueError(f"An effect is named twice: {', '.join(effects)}.")
    for of, name in asked.items():
        definition(of, name)
        if of not in (*effects, STICK, LOG):
            raise ValueError(f"Definition {name} of {of}, which is not concealed: name it.")
    return [kind(name, asked.get(name, "")) for name in effects]


def _shape(rng: Generator, kinds: Sequence[Kind]) -> str | None:
    """The healthy machine's Stribeck curve, or `None`; as an effect wants it, where one does."""
    choice = (*SHAPES, None)[rng.integers(4)]
    wanted = {kind.bump for kind in kinds}
    if False in wanted:
        return None
    return SHAPES[0] if True in wanted and choice is None else choice


def _pronounced(friction, coulomb, top):
    """A high and wide bump: a narrow one is passed before its lag shows."""
    wide = {f"bump{s}": max(friction[f"bump{s}"], 0.45 * coulomb) for s in "+-"}
    wide |= {f"bump_speed{s}": max(friction[f"bump_speed{s}"], 0.1 * top) for s in "+-"}
    return friction | wide


def _mass(rng: Generator, v, time, coulomb, kinds) -> float:
    """The force of inertia (98 % of it) is 0.3 to 5 times Coulomb friction."""
    ratio = log_uniform(rng, 0.3, 5.0)
    if any(kind.loud for kind in kinds):
        ratio = max(ratio, 1.5 + 0.5 * ratio)
    return ratio * coulomb / float(np.quantile(np.abs(np.gradient(v, time)), 0.98))


def _conceal(machine, name, n, size, by):
    rng = np.random.default_rng((machine.seed, 1, zlib.crc32(name.encode())))
    low, high = size if isinstance(size, tuple) else (size, size)
    own, wanted = kind(name, by), log_uniform(rng, low, high)
    truth = own.draw(rng, n, wanted)
    forms = (str(truth.get(key, "")) for key in ("shape", "form"))
    truth["definition"] = by or usual(name, next((form for form in forms if form), ""))
    if own.tuned:
        truth = tune(machine, name, truth, n, wanted)
    return {"size": own.measure(truth, n), **truth, "where": own.where(truth)}
