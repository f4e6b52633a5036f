"""Recording a machine twice: once to identify, once held out."""

from typing import NamedTuple

import numpy as np

from ..recording import Recording
from . import physics, schedule
from .drawing import KINDS
from .machines import Machine, reference
from .nominal import Nominal, direction, rms


class Run(NamedTuple):
    """Both recordings of a machine, and what nobody knows who only has them.

    `recording`, `holdout`: with `position` as counted, `force` as measured and the channel
    `reference`, without velocity; `neighbour_velocity` with `cross_axis`. `hidden`,
    `hidden_holdout`: the force of each effect by name, N, `(N,)`: the part of the command beyond
    the healthy machine's, mean over the sample that the command is held.
    """

    recording: Recording
    holdout: Recording
    hidden: dict[str, np.ndarray]
    hidden_holdout: dict[str, np.ndarray]
    true: tuple[physics.Motion, physics.Motion]


def record(machine: Machine) -> Run:
    """Both recordings of a machine in closed loop, always the same for the same machine.

    The held-out one has a set-point and noise of its own, and often another kind of motion.

    The arrays have the caller's precision; the simulation has double precision.
    """
    clocks = [_clock(machine, run) for run in (0, 1)]
    stages = [_stage(machine, run, clock) for run, clock in enumerate(clocks)]
    inputs = [stage[0] for stage in stages]
    true = physics.run([dict(machine.physics)] * 2, inputs, machine.plan.substeps)
    found = [_hide(machine, clocks[i], true[i], stages[i][1], i) for i in (0, 1)]
    logs = [_log(machine, clocks[i], inputs[i], true[i], i) for i in (0, 1)]
    return Run(*logs, *found, tuple(true))


def _rng(machine, run, what):
    return np.random.default_rng((machine.seed, 2, run, what))


def _clock(machine: Machine, run: int) -> np.ndarray:
    """The true times of the samples, s: even ones, each off by up to the jitter."""
    count, rate = machine.plan.count, machine.plan.sample_rate
    off = _rng(machine, run, 0).uniform(-1, 1, count) * machine.noise.jitter
    return (np.arange(count) + off - off[0]) / rate


def _coloured(rng, count, samples):
    """First-order autoregression with unit variance and that correlation time in samples."""
    keep = float(np.exp(-1 / samples))
    kicks = rng.normal(size=count) * np.sqrt(1 - keep**2)
    kicks[0] = rng.normal()
    # Blocks short enough for the powers of `keep` to stay far from underflow.
    block = max(1, int(min(count, 20 * samples)))
    found, last = np.empty(count), 0.0
    for start in range(0, count, block):
        part = kicks[start : start + block].copy()
        part[0] += keep * last
        powers = keep ** np.arange(part.size)
        found[start : start + block] = powers * np.cumsum(part / powers)
        last = found[start + part.size - 1]
    return found


def _stage(machine: Machine, run: int, clock: np.ndarray):
    """Inputs of the simulator, and the load that the effects alone make."""
    plan, noise = machine.plan, machine.noise
    goal, speed = reference(plan, machine.seed, run)
    even = np.arange(plan.count) / plan.sample_rate
    goal, speed = np.interp(clock, even, goal), np.interp(clock, even, speed)
    interval = np.append(np.diff(clock), 1 / plan.sample_rate)
    # The mean of a slow load over a sample is its value in the middle.
    n = _motion(machine, clock + 0.5 * interval)
    timed = schedule.columns(machine.truth, n, run)
    correlation = noise.correlation * plan.sample_rate
    process = noise.process * _coloured(_rng(machine, run, 1), plan.count, correlation)
    blur = noise.encoder * _rng(machine, run, 2).normal(size=plan.count)
    columns = (interval, goal, speed, timed.load + process, timed.coulomb, timed.viscous, blur)
    return physics.Inputs(*columns), timed.load


def _motion(machine: Machine, time, x=None, v=None, a=None) -> Nominal:
    """A motion of a machine in the form that the effects' forces are functions of."""
    zero = np.zeros_like(time)
    x, v, a = (zero if each is None else each for each in (x, v, a))
    top = float(np.quantile(np.abs(v), 0.98))
    way = direction(v, top)
    return Nominal(time, x, v, a, zero, way, top, machine.coulomb, machine.physics, machine.plan)


# Effects that are friction of the simulator's baseline, and so no part of `Motion.hidden`.
_INSIDE = {"asymmetric_friction", "stribeck"}

# Effects whose force at a sample does not follow from the motion at that sample.
_DYNAMIC = {
    "presliding", "frictional_lag", "backlash", "compliance", "transport_delay", "actuator_lag",
    "actuator_deadband", "actuator_saturation", "gain_asymmetry", "position_dependent_delay",
    "hysteretic_spring", "load_dependent_friction", "acceleration_dependent_friction",
}  # fmt: skip


def _hide(machine: Machine, clock, true: physics.Motion, load, run):
    """The force of each effect; what does not follow from the motion gets what the others leave.

    Two such effects at once share it: each is given half.
    """
    names = machine.effects
    n = _driven(machine, clock, true)
    known = {name: _known(name, machine, n, run) for name in names if name not in _DYNAMIC}
    inside = [known[name] for name in names if name in _INSIDE]
    total = sum(inside, true.hidden + load)
    if len(names) == 1:
        return {names[0]: total}
    rest = total - sum(known.values(), np.zeros_like(total))
    share = 1 / max(len(names) - len(known), 1)
    return {name: known.get(name, share * rest) for name in names}


def _driven(machine, clock, true):
    """The true motion in the middle of each sample."""
    interval = np.append(np.diff(clock), 1 / machine.plan.sample_rate)
    change = np.append(np.diff(true.velocity), 0.0)
    v = true.velocity + 0.5 * change
    x = true.position + 0.5 * interval * true.velocity
    return _motion(machine, clock + 0.5 * interval, x, v, change / interval)


def _known(name, machine, n, run):
    truth = machine.truth[name]
    if name in ("disturbance_pulses", "cross_axis"):
        return schedule.columns({name: truth}, n, run).load
    force = KINDS[name].force(truth, n)
    if name == "asymmetric_friction":
        return force + truth["coulomb_asymmetry"] * np.abs(n.way)
    return force


def _log(machine: Machine, clock, inputs, true, run) -> Recording:
    force = machine.noise.force * _rng(machine, run, 3).normal(size=clock.size)
    channels = {"reference": inputs.goal}
    if "cross_axis" in machine.effects:
        truth = machine.truth["cross_axis"]
        speed, _ = schedule.neighbour(truth, machine.plan, run, clock)
        noise = 1e-3 * rms(speed) * _rng(machine, run, 4).normal(size=clock.size)
        channels["neighbour_velocity"] = speed + noise
    name = f"machine {machine.seed}, {('identification', 'held out')[run]}"
    return Recording(clock, true.force + force, true.counted, channels=channels, source=name)
