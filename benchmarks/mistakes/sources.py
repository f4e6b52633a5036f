"""Healthy machines from several sources, so that nothing is made to fit one of them.

Half of the sources are to develop with; the other half is only scored.
"""

import importlib.util
from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from jaxfric.validation import concealed

from . import bench, joint, library
from .logs import PLAIN, TRUE_VELOCITY, Log, Pair

# A longer log is cut to one of these lengths: few programs are compiled.
LENGTHS = (8_000, 4_000)
# The fastest linear drives reach 20 m/s; a machine drawn faster is made smaller, all else alike.
FASTEST = 20.0
MODELS = ("gaussian", "coulomb-viscous")


def draw_concealed(rng: Generator) -> Pair:
    """A machine of `jaxfric.validation.concealed` with nothing concealed."""
    machine = concealed.draw(int(rng.integers(2**31)))
    while machine.baseline not in MODELS or machine.plan.samples > 2 * LENGTHS[0]:
        machine = concealed.draw(int(rng.integers(2**31)))
    run = concealed.record(machine)
    names = dict(PLAIN[rng.integers(len(PLAIN))], reference="reference")
    p, plan = machine.physics, machine.plan
    count = next(length for length in LENGTHS if length <= plan.samples)
    speed = np.diff(run.true[0].position[:count]) * plan.sample_rate
    top = float(np.quantile(np.abs(speed), 0.98))
    truth = {"inertia": p["mass"], "viscous+": p["viscous+"], "viscous-": p["viscous-"]}
    truth |= {f"coulomb{s}": p[f"coulomb{s}"] + w * p["offset"] for s, w in (("+", 1), ("-", -1))}
    if machine.baseline != "coulomb-viscous":
        truth |= {f"stribeck_force{s}": p[f"bump{s}"] for s in "+-"}
    hard = float(np.quantile(np.abs(np.diff(speed)), 0.98) * plan.sample_rate)
    cycle = plan.period * plan.sample_rate / 5  # its motions have up to five times its frequency
    about = f"concealed: {plan.kinds[0]}, {plan.sample_rate:.4g} Hz, {cycle:.3g} samples a cycle"
    logs = []
    for recording, true in zip(run[:2], run.true, strict=True):
        columns = {
            "time": recording.time, "position": recording.position, "force": recording.force,
            "reference": recording.channels["reference"],
            "velocity": true.velocity + 1e-3 * top * rng.normal(size=plan.samples),
            TRUE_VELOCITY: true.velocity,
        }  # fmt: skip
        columns = {role: np.asarray(x, float)[:count] for role, x in columns.items()}
        # The force is held from its sample to the next: the mean of both neighbours is centred.
        force = np.asarray(columns["force"])
        columns["force"] = 0.5 * (force + np.append(force[0], force[:-1]))
        logs.append(Log(columns, names, truth, top, hard, cycle, machine.baseline, about))
    return Pair(*logs)


def draw_bench(rng: Generator) -> Pair:
    """A machine of NumPy alone under feedback of its state."""
    return bench.draw(rng, bench.BENCH)


def draw_cascade(rng: Generator) -> Pair:
    """A machine of NumPy alone under cascaded loops, from 20 Hz to 20 kHz."""
    return bench.draw(rng, bench.CASCADE)


SEEN: tuple[Callable[[Generator], Pair], ...] = (draw_concealed, draw_bench)
UNSEEN: tuple[Callable[[Generator], Pair], ...] = (library.draw, draw_cascade)
if importlib.util.find_spec("mujoco") is not None:
    UNSEEN = (*UNSEEN, joint.draw)


def draw(rng: Generator, number: int, unseen: bool) -> Pair:
    """A machine of one of the sources, which take turns; its log has every column."""
    sources = UNSEEN if unseen else SEEN
    pair = sources[number % len(sources)](rng)
    if pair.log.top <= FASTEST:
        return pair
    return Pair(*(log.scaled(position=FASTEST / pair.log.top) for log in pair))
