"""Correcting the size of an effect that the closed loop shapes, by one simulation."""

import dataclasses

import numpy as np

from .kinds import kind as kind_of
from .machines import Machine
from .nominal import Nominal, Truth, rms
from .runs import simulate

# Both ways from the parameter that the set-point's motion suggests.
_STEP = 2.0


# A size is drawn from a range of a decade: a sixth more or less is as drawn.
_CLOSE = 0.15
_ROUNDS = 4
# What is hardly there, a stop that is just not reached, would make the power law a cliff; between
# sizes so far apart it says little.
_HARDLY = 0.1
_FAR = 10.0
# The size of an effect with which the loop bursts, in parts of the Coulomb level.
BURST = 1e3


def tune(machine: Machine, name: str, truth: Truth, n: Nominal, size: float) -> Truth:
    """The truth of one effect with `Kind.tuned` such that its force has the size in closed loop.

    The size in `truth` is what was reached: it can differ where the parameter meets a bound.
    """
    step = _STEP
    for _ in range(_ROUNDS):
        truth, between, known = _improved(machine, name, truth, n, size, step)
        if known:
            break
        step = np.sqrt(step) if between else _STEP
    return truth


def _improved(machine, name, truth, n, size, step):
    """A better truth; whether its size lies between two that were simulated, and is known by them.

    Two machines with the parameter a step smaller and larger, and only this effect, run the
    identification's motion; size over parameter is taken as a power law between and, by no more
    than another step, beyond them.
    """
    kind = kind_of(name, truth["definition"])
    low, high = kind.bounds(n)
    first = truth[kind.tuned]
    tried = np.clip([first / step, first * step], low, high)
    truths = [kind.complete({**truth, kind.tuned: float(value)}, n) for value in tried]
    sizes = np.maximum(_sizes(machine, name, truths), _HARDLY * size)
    span = np.diff(np.log(tried))[0]
    # A size that does not grow with the parameter says nothing about where to look for more.
    slope = max(np.diff(np.log(sizes))[0] / span, 0.1)
    wanted = tried[0] * (size / sizes[0]) ** (1 / slope)
    value = float(np.clip(wanted, max(low, tried[0] / step), min(high, tried[1] * step)))
    reached = float(sizes[0] * (value / tried[0]) ** slope)
    between = tried[0] * np.exp(-_CLOSE) < value < tried[1] * np.exp(_CLOSE)
    better = kind.complete({**truth, kind.tuned: value}, n) | {"size": reached}
    known = between and sizes[1] < _FAR * sizes[0]
    return better, between, known or value in (low, high)


def _sizes(machine, name, truths):
    """Of the effect's force in the closed loop, in parts of the Coulomb level."""
    kind = kind_of(name, truths[0]["definition"])
    twins = [
        dataclasses.replace(
            machine,
            effects=(name,),
            physics={**machine.physics, **kind.physics(truth, machine.physics)},
            truth={name: truth},
        )
        for truth in truths
    ]
    found = simulate([(twin, 0) for twin in twins])
    # A loop that bursts is too large an effect.
    with np.errstate(over="ignore", invalid="ignore"):
        sizes = np.array([in_loop(machine, name, f.hidden[name], f.true.velocity) for f in found])
    return np.clip(np.nan_to_num(sizes, nan=np.inf), 1e-6, BURST)


def in_loop(machine: Machine, name: str, force: np.ndarray, velocity: np.ndarray) -> float:
    """Size of an effect's force along a run in closed loop, in parts of the Coulomb level."""
    if kind_of(name).impacts:
        physics = machine.physics
        window = machine.plan.sample_rate / np.sqrt(physics["kp"] / physics["mass"])
        count = max(round(window), 1)
        force = np.convolve(force, np.full(count, 1 / count), "same")
        force = force * (np.abs(velocity) > physics["still"])
    return rms(force) / machine.coulomb
