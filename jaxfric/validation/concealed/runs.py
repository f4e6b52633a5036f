"""Recording a machine twice: once to identify, once held out."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...data.recording import Recording
from . import physics
from .definitions import LOG
from .kinds import kind
from .machines import Machine, reference
from .nominal import Columns, Kind, Nominal, direction, rms
from .others import low_pass


class Run(NamedTuple):
    """Both recordings of a machine, and what nobody knows who only has them.

    `recording`, `holdout`: with `position` as counted, `force` as measured and the channel
    `reference`, without velocity; `neighbour_velocity` with `cross_axis`. `hidden`,
    `hidden_holdout`: the force of each effect by name, N, `(N,)`: the part of the command beyond
    the healthy machine's, mean over the sample that the command is held. `true`: both motions.
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
    runs = simulate([(machine, 0), (machine, 1)])
    logs = [_log(machine, run, number) for number, run in enumerate(runs)]
    first, second = runs
    return Run(logs[0], logs[1], first.hidden, second.hidden, (first.true, second.true))


class Simulated(NamedTuple):
    """One run: the clock s `(N,)`, the simulator's inputs and outputs, each effect's force N."""

    clock: np.ndarray
    inputs: physics.Inputs
    true: physics.Motion
    hidden: dict[str, np.ndarray]


def simulate(runs: Sequence[tuple[Machine, int]]) -> list[Simulated]:
    """Machines with one plan, each with the number of its run: 0 to identify, 1 held out."""
    clocks = [_clock(machine, run) for machine, run in runs]
    staged = [_stage(*which, clock) for which, clock in zip(runs, clocks, strict=True)]
    inputs = [stage[0] for stage in staged]
    substeps = runs[0][0].plan.substeps
    true = physics.run([dict(machine.physics) for machine, _ in runs], inputs, substeps)
    found = []
    for i, (machine, run) in enumerate(runs):
        hidden = _hide(machine, clocks[i], true[i], staged[i][1], run)
        added = _added(machine, clocks[i], true[i])
        force = sum(added.values(), true[i].force)
        seen, late = _logged(machine, clocks[i], true[i]._replace(force=force))
        found.append(Simulated(clocks[i], inputs[i], seen, hidden | added | late))
    return found


def _rng(machine, run, what):
    return np.random.default_rng((machine.seed, 2, run, what))


def _clock(machine: Machine, run: int) -> np.ndarray:
    """The true times of the samples, s: even ones, each off by up to the jitter."""
    count, rate = machine.plan.samples, machine.plan.sample_rate
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
    even = np.arange(plan.samples) / plan.sample_rate
    goal, speed = np.interp(clock, even, goal), np.interp(clock, even, speed)
    interval = np.append(np.diff(clock), 1 / plan.sample_rate)
    # The mean of a slow load over a sample is its value in the middle.
    n = _motion(machine, clock + 0.5 * interval)
    timed = _timed(machine, n, run)
    correlation = noise.correlation * plan.sample_rate
    process = noise.process * _coloured(_rng(machine, run, 1), plan.samples, correlation)
    blur = noise.encoder * _rng(machine, run, 2).normal(size=plan.samples)
    columns = (interval, goal, speed, timed.load + process, timed.coulomb, timed.viscous, blur)
    return physics.Inputs(*columns), timed.load


def _kind(machine: Machine, name: str) -> Kind:
    return kind(name, machine.truth[name].get("definition", ""))


def _timed(machine: Machine, n: Nominal, run: int) -> Columns:
    """What acts over a run because of the time; `n` needs the run's `time` and `plan` only."""
    zero = np.zeros_like(n.time)
    total = Columns(zero, zero, zero)
    for name, truth in machine.truth.items():
        over = _kind(machine, name).over
        if over is not None:
            total = Columns(*(a + b for a, b in zip(total, over(truth, n, run), strict=True)))
    return total


def _motion(machine: Machine, time, x=None, v=None, a=None) -> Nominal:
    """A motion of a machine in the form that the effects' forces are functions of."""
    zero = np.zeros_like(time)
    x, v, a = (zero if each is None else each for each in (x, v, a))
    top = float(np.quantile(np.abs(v), 0.98))
    way = direction(v, top)
    return Nominal(time, x, v, a, zero, way, top, machine.coulomb, machine.physics, machine.plan)


def _hide(machine: Machine, clock, true: physics.Motion, load, run):
    """The force of each effect; what does not follow from the motion gets what the others leave.

    Two such effects at once share it: each is given half.
    """
    kinds = {name: _kind(machine, name) for name in machine.effects}
    names = [
        name for name, own in kinds.items() if not own.added and not (own.logged or own.recorded)
    ]
    n = _driven(machine, clock, true)
    known = {name: _known(name, machine, n, run) for name in names if kinds[name].follows}
    inside = [known[name] for name in names if kinds[name].inside]
    total = sum(inside, true.hidden + load)
    if len(names) == 1:
        return {names[0]: total}
    rest = total - sum(known.values(), np.zeros_like(total))
    share = 1 / max(len(names) - len(known), 1)
    return {name: known.get(name, share * rest) for name in names}


def _added(machine: Machine, clock, true: physics.Motion) -> dict[str, np.ndarray]:
    """The force of each effect that the machine's motion does not feel."""
    kinds = {name: _kind(machine, name) for name in machine.effects}
    kinds = {name: own for name, own in kinds.items() if own.added}
    if not kinds:
        return {}
    n = _driven(machine, clock, true)._replace(u=true.force)
    return {name: own.force(machine.truth[name], n) for name, own in kinds.items()}


def _logged(machine: Machine, clock, true: physics.Motion):
    """The run with position and force as the logger has them, and the force of each effect that is
    its.

    What the logged position needs is the force as late as it is.
    """
    hidden = {}
    for name, truth in machine.truth.items():
        logged, recorded = _kind(machine, name).logged, _kind(machine, name).recorded
        if recorded is not None:
            force = recorded(truth, clock, true.force)
            hidden[name] = force - true.force
            true = true._replace(force=force)
        if logged is not None:
            hidden[name] = true.force - logged(truth, clock, true.force)
            true = true._replace(counted=logged(truth, clock, true.counted))
    return true, hidden


def _driven(machine, clock, true):
    """The true motion in the middle of each sample."""
    interval = np.append(np.diff(clock), 1 / machine.plan.sample_rate)
    change = np.append(np.diff(true.velocity), 0.0)
    v = true.velocity + 0.5 * change
    x = true.position + 0.5 * interval * true.velocity
    return _motion(machine, clock + 0.5 * interval, x, v, change / interval)


def _known(name, machine, n, run):
    truth, own = machine.truth[name], _kind(machine, name)
    if own.over is not None:
        load, coulomb, viscous = own.over(truth, n, run)
        return load + coulomb * n.way + viscous * n.v
    return (own.total or own.force)(truth, n)


def _log(machine: Machine, found: Simulated, run: int) -> Recording:
    clock = found.clock
    force = machine.noise.force * _rng(machine, run, 3).normal(size=clock.size)
    channels = {"reference": found.inputs.goal}
    for effect, truth in machine.truth.items():
        recorded = _kind(machine, effect).channels
        for role, signal in recorded(truth, machine.plan, run, clock).items() if recorded else ():
            noise = 1e-3 * rms(signal) * _rng(machine, run, 4).normal(size=clock.size)
            channels[role] = signal + noise
    name = f"machine {machine.seed}, {('identification', 'held out')[run]}"
    true, logged = found.true, machine.definitions.get(LOG, "")
    position, velocity = true.counted, None
    if logged == "held_position":
        position = position[np.arange(clock.size) // HELD * HELD]
    elif logged == "filtered_velocity":
        velocity = _by_drive(machine, clock, position)
    return Recording(clock, true.force + force, position, velocity, channels=channels, source=name)


# So many samples of the force to one of the position, where the log holds that.
HELD = 3


def _by_drive(machine: Machine, clock: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """The velocity that the drive's own loop works with."""
    rate = np.diff(counted, prepend=counted[0]) / np.diff(clock, prepend=2 * clock[0] - clock[1])
    return low_pass(rate, np.full(clock.size, machine.physics["velocity_filter"]))
