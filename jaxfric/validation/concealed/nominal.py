"""The motion that a machine is asked for, by which the sizes of concealed effects are set."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from .machines import Plan

Truth = dict[str, Any]
TURN = 2 * np.pi


class Nominal(NamedTuple):
    """A motion and the force that the healthy machine needs for it.

    `time` s, `x` m, `v`, `a`, `u` N, each `(N,)`; `way`: direction, 0 at rest; `dry`: the
    Stribeck bump of each sample, N; `top` m/s, 98 % of the speeds are below it; `coulomb` N;
    `physics` and `plan` of the machine.
    """

    time: np.ndarray
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    u: np.ndarray
    way: np.ndarray
    top: float
    coulomb: float
    physics: Mapping[str, float]
    plan: Plan

    @property
    def mass(self) -> float:
        """The inertia of the healthy machine, kg."""
        return self.physics["mass"]

    @property
    def substep(self) -> float:
        """The simulator's step, s."""
        return 1 / (self.plan.sample_rate * self.plan.substeps)

    @property
    def bandwidth(self) -> float:
        """Of the position loop, rad/s."""
        return float(np.sqrt(self.physics["kp"] / self.mass))


def _unbounded(n: Nominal) -> tuple[float, float]:
    return 0.0, np.inf


def _as_it_is(truth: Truth, n: Nominal) -> Truth:
    return truth


def no_physics(truth: Truth, base: Mapping[str, float]) -> dict[str, float]:
    """What is a force along the motion alone changes nothing of the simulator."""
    return {}


class Columns(NamedTuple):
    """Of a run, each `(N,)`: a load, N, and what friction has more, N and N·s/m."""

    load: Any = 0.0
    coulomb: Any = 0.0
    viscous: Any = 0.0


class Kind(NamedTuple):
    """One kind of concealed effect.

    `draw(rng, nominal, size)`: its parameters; `force(truth, nominal)`: its force along a motion,
    N, to first order where it is no force; `physics(truth, base)`: the simulator's parameters;
    `where(truth)`: a sentence. With `centred`, the size counts the deviation of the force from its
    mean only, since the baseline's constants take up the mean. Where the loop shapes the force too
    much for the set-point to tell its size, `tuned` names the parameter that is corrected by a
    simulation, between `bounds(nominal)`; `complete` fills in what follows from it. With `impacts`,
    the size is that of the mean over the loop's time constant, in motion: a blow is high and says
    nothing, and at rest nobody knows on which flank the load lies.

    Of the machine: `loud`, it shows by the phase of the loop, or where the force of inertia is
    large; `slow`, it wants a slow loop; `tied`, both directions of the healthy machine are alike;
    `bump`, whether that has a Stribeck curve, where it matters: a pronounced one, or none.

    Of its force: `follows` from the motion at a sample; `inside` what the simulator takes for
    friction; `total(truth, nominal)`, all of it, where `force` is a part; `planted`, it is one of
    the recorded position, velocity and time alone; `added`, to the force of a machine that moves as
    it would without. `over(truth, nominal, run)`: what acts because of the time; `unrepeated`, in
    each run at moments of its own; `channels(truth, plan, run, clock)` that record it. With
    `logged(truth, clock, signal)`, it is the logger that makes of the position what this says, with
    `recorded(truth, clock, signal)` of the force, and the axis feels nothing.
    """

    draw: Callable[[Generator, Nominal, float], Truth]
    force: Callable[[Truth, Nominal], np.ndarray]
    physics: Callable[[Truth, Mapping[str, float]], dict[str, float]]
    where: Callable[[Truth], str]
    centred: bool = False
    tuned: str = ""
    bounds: Callable[[Nominal], tuple[float, float]] = _unbounded
    complete: Callable[[Truth, Nominal], Truth] = _as_it_is
    impacts: bool = False
    loud: bool = False
    slow: bool = False
    tied: bool = False
    bump: bool | None = None
    follows: bool = True
    inside: bool = False
    planted: bool = False
    added: bool = False
    unrepeated: bool = False
    total: Callable[[Truth, Nominal], np.ndarray] | None = None
    over: Callable[[Truth, Nominal, int], Columns] | None = None
    channels: Callable[[Truth, Plan, int, np.ndarray], dict[str, np.ndarray]] | None = None
    logged: Callable[[Truth, np.ndarray, np.ndarray], np.ndarray] | None = None
    recorded: Callable[[Truth, np.ndarray, np.ndarray], np.ndarray] | None = None

    def measure(self, truth: Truth, nominal: Nominal) -> float:
        """The size: root mean square of the force in parts of the Coulomb level."""
        force = self.force(truth, nominal)
        return rms(force - np.mean(force) if self.centred else force) / nominal.coulomb


def named(**names: str) -> Callable[[Truth, Mapping[str, float]], dict[str, float]]:
    """Physics from truth by a table of names: the simulator's = the truth's."""
    return lambda truth, base: {left: float(truth[right]) for left, right in names.items()}


def rms(x: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


def bump(physics: Mapping[str, float], speed: np.ndarray, way: np.ndarray) -> np.ndarray:
    """The Stribeck bump at speeds, m/s, in directions: its magnitude, N."""
    ratio = speed / np.where(way > 0, physics["bump_speed+"], physics["bump_speed-"])
    shapes = np.exp(-(ratio**2)), 1 / (1 + ratio**2), np.exp(-ratio), np.exp(-np.sqrt(ratio))
    height = np.where(way > 0, physics["bump+"], physics["bump-"])
    return height * shapes[int(physics["bump_shape"])]


def friction(physics: Mapping[str, float], v: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Friction of the healthy machine with its sign, and the constant force, N."""
    coulomb = np.where(way > 0, physics["coulomb+"], physics["coulomb-"])
    viscous = np.where(way > 0, physics["viscous+"], physics["viscous-"])
    speed = np.abs(v)
    return way * (coulomb + viscous * speed + bump(physics, speed, way)) + physics["offset"]


def direction(v: np.ndarray, top: float) -> np.ndarray:
    """Sign of the velocity, zero below a thousandth of the top speed (a dwell)."""
    return np.sign(v) * (np.abs(v) > 1e-3 * top)


def nominal(time, x, v, coulomb, physics, plan) -> Nominal:
    """The set-point's motion with all that follows from it."""
    top = float(np.quantile(np.abs(v), 0.98))
    a, way = np.gradient(v, time), direction(v, top)
    u = physics["mass"] * a + friction(physics, v, way)
    return Nominal(time, x, v, a, u, way, top, coulomb, physics, plan)


def scaled(kind: Kind, name: str, truth: Truth, n: Nominal, size: float, most=np.inf) -> Truth:
    """The truth with the parameter `name`, to which the force is proportional, that makes `size`.

    `most` limits the parameter: what would not be physical any more is not made.
    """
    unit = kind.measure({**truth, name: 1.0}, n)
    return {**truth, name: float(min(size / unit, most)) if unit > 0 else 0.0}


def solved(kind: Kind, truth: Truth, n: Nominal, size: float) -> Truth:
    """The truth with the parameter `kind.tuned`, with which the force grows, that makes `size`.

    By bisection of its logarithm between `kind.bounds`; the nearer one where neither reaches.
    """
    low, high = np.log(kind.bounds(n))
    for _ in range(25):
        middle = 0.5 * (low + high)
        small = kind.measure({**truth, kind.tuned: float(np.exp(middle))}, n) < size
        low, high = (middle, high) if small else (low, middle)
    return kind.complete({**truth, kind.tuned: float(np.exp(0.5 * (low + high)))}, n)


def reversals(n: Nominal) -> list[tuple[int, int]]:
    """First sample and the one after the last of each stretch in one direction."""
    way = np.where(n.way == 0, np.nan, n.way)
    known = np.flatnonzero(~np.isnan(way))
    turns = known[1:][way[known[1:]] != way[known[:-1]]]
    edges = [0, *turns.tolist(), way.size]
    return [(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True) if b > a]


def travelled(n: Nominal) -> np.ndarray:
    """Distance since the last reversal, m, `(N,)`; from the start far enough to be in slip."""
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(n.x)))])
    since = np.empty_like(path)
    for first, last in reversals(n):
        since[first:last] = path[first:last] - path[first]
    start, stop = reversals(n)[0]
    since[start:stop] += n.plan.stroke
    return since
