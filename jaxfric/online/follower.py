"""A plain object for a control loop: one call a sample, parameters and changes as they come."""

import math
from collections import deque
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..models import Model
from ..terms.base import AbstractTerm
from . import changepoint, chart, moments, precision
from .chart import LEARNING, SETTLED, Chart
from .moments import ABOVE, GAP, NODES, WHOLE, State, Sums
from .solving import Solution, friction_only, solve


class Change(NamedTuple):
    """A change of friction: `time` of detection, s; `direction`, 1 or −1; `strokes` since it seems
    to have begun; `excess`, N, the mean force of these over that of equally fast ones before, or
    of the last one over the reference, signed with the direction: positive is more friction;
    `share` of the mean force before.
    """

    time: float
    direction: int
    strokes: int
    excess: float
    share: float


class Follower:
    """Friction followed sample by sample: constant memory and time, no acceleration, no mass.

    The arithmetic is that of [`update`][jaxfric.online.update], in plain Python, which is quicker
    one sample at a time. From the fifth stroke on the last ones of a direction are compared with
    each other, which finds large changes at once. After `SETTLED` strokes of each direction the
    curve identified so far becomes the reference of the charts, which find small changes that
    last. Each has half of the false alarms. After a change the next stroke of each direction
    begins anew.

    Two samples in succession beyond `fastest` widen the nodes; a lone one counts as missing.
    Strokes beyond the speeds that a reference was identified for stay off its chart; of as many as
    made the first reference the next one is made.

    **Arguments:** `model`, a name or a sum of functions of velocity; `slowest`, `fastest`, `keep`,
    `window`, `false_alarms` as for [`start`][jaxfric.online.start].
    """

    def __init__(
        self,
        model: AbstractTerm | Model | str = "coulomb-viscous",
        *,
        slowest: float,
        fastest: float,
        keep: float = math.inf,
        window: int = 0,
        false_alarms: float = 1e-4,
        nodes: int = NODES,
    ):
        self.term = friction_only(model)
        self._how = {"keep": keep, "window": window, "false_alarms": false_alarms, "nodes": nodes}
        moments.start(slowest, fastest, **self._how)  # type: ignore[arg-type]
        self._nodes = np.geomspace(slowest, fastest, nodes)
        self._reach()
        self._rate, self._keep, self._window = 0.5 * false_alarms, keep, window
        self._height, self._beyond = chart.threshold(self._rate), False
        self._last: tuple[float, float, float] | None = None
        self._interval = 0.0
        size = len(self._speeds)
        self._total = Sums(np.zeros((2, size)), np.zeros((2, size)), np.zeros(2))
        self._groups = Sums(*(np.zeros((precision.GROUPS, *x.shape)) for x in self._total))
        self._ring: list[list[Sums]] = [[], []]
        self._usual = [0.0, 0.0]
        self._anew()
        self._curve(self.solution().model)  # compiled before the first sample, not between two

    def _anew(self) -> None:
        """What was before is all there is until the first new stroke of a direction."""
        self._count = [0, 0]
        self._recent = [deque[tuple[float, float]](maxlen=changepoint.SPAN) for _ in (0, 1)]
        self._inside = [False, False]
        self._stroke = [self._empty(), self._empty()]
        self._learn(SETTLED)

    def _reach(self) -> None:
        """What depends on the nodes alone."""
        self._speeds = self._nodes.tolist()
        self._slowest, self._fastest = self._speeds[0], self._speeds[-1]
        self._scale = (len(self._speeds) - 1) / math.log(self._fastest / self._slowest)

    def _widen(self, speed: float) -> None:
        """Nodes up to `ABOVE` times a speed, as [`wider`][jaxfric.online.moments.wider] does."""
        before = self._nodes
        self._nodes = np.geomspace(self._slowest, ABOVE * speed, len(before))
        self._reach()
        share = moments.hats(self._nodes, before)

        def moved(weight, load, square) -> Sums:
            return Sums(np.asarray(weight) @ share, np.asarray(load) @ share, square)

        self._total, self._groups = moved(*self._total), moved(*self._groups)
        self._ring = [[moved(*stroke) for stroke in side] for side in self._ring]
        strokes = (moved(*stroke) for stroke in self._stroke)
        self._stroke = [[s.weight.tolist(), s.load.tolist(), s.square] for s in strokes]
        if not self._compared:
            self._learn(max(self._count) + SETTLED)
        for side, known in enumerate(self._known):
            if known is not None:
                self._reference[side] = self._curve(known)[side]

    def _learn(self, until: int) -> None:
        """No reference until so many strokes of each direction are closed."""
        self._settled, self._compared = until, False
        self._known: list[Model | None] = [None, None]
        self._reference = np.zeros((2, len(self._speeds)))
        self._charts = [Chart(0.0, 0.0, 0.0, 0.0, 0.0)] * 2
        self._rising, self._farther, self._limit = [0, 0], [0, 0], [self._fastest] * 2

    def _refer(self, side: int) -> None:
        """What is identified now becomes the reference of a direction, up to the fastest node."""
        known = self._known[side] = self.solution().model
        self._reference[side] = self._curve(known)[side]
        self._charts[side] = Chart(0.0, 0.0, 0.0, 0.0, 0.0)
        self._rising[side], self._farther[side], self._limit[side] = 0, 0, self._fastest

    def _empty(self) -> list:
        """Time and impulse at the nodes, and the square of the force."""
        return [[0.0] * len(self._speeds), [0.0] * len(self._speeds), 0.0]

    @property
    def fastest(self) -> float:
        """The speed up to which speeds are told apart, m/s; faster samples raise it."""
        return self._fastest

    @property
    def strokes(self) -> tuple[int, int]:
        """Closed strokes since the last change, forward and backward."""
        return self._count[0], self._count[1]

    @property
    def learning(self) -> bool:
        """Whether small changes would not be detected yet."""
        return not self._compared or min(each.number for each in self._charts) < LEARNING

    @property
    def changes_from(self) -> tuple[int, int]:
        """From which stroke of each direction on large changes are detected, and small ones."""
        count = min(self._count)
        if not self._compared:
            return changepoint.BEGIN, self._settled + LEARNING + 1
        charted = min(int(each.number) for each in self._charts)
        return changepoint.BEGIN, count + max(0, LEARNING - charted) + 1

    def add(self, time: float, velocity: float, force: float) -> Change | None:
        """One sample, s, m/s, N; what has changed, if it has. Samples that are not finite count
        as missing.
        """
        if not math.isfinite(time + velocity + force):
            return None
        if abs(velocity) > self._fastest:
            self._beyond = not self._beyond
            if self._beyond:
                return None
            self._widen(abs(velocity))
        self._beyond = False
        last, self._last = self._last, (time, velocity, force)
        if last is None:
            return None
        step = time - last[0]
        usual = self._interval or step
        if not 0 < step <= GAP * usual:
            self._inside = [False, False]
            self._stroke = [self._empty(), self._empty()]
            return None
        self._interval = usual + 0.02 * (step - usual)
        change = None
        for side in (0, 1):
            sign = 1.0 - 2.0 * side
            left, right = sign * last[1] - self._slowest, sign * velocity - self._slowest
            if left <= 0 and right <= 0:
                continue
            if left <= 0:
                self._inside[side] = True
                self._share(side, right, force, (1 - left / (left - right)) * step)
            elif right <= 0:
                if self._inside[side]:
                    self._share(side, left, last[2], left / (left - right) * step)
                    change = self._close(side, time) or change
                    self._stroke[side] = self._empty()
                self._inside[side] = False
            elif self._inside[side]:
                self._share(side, left, last[2], 0.5 * step)
                self._share(side, right, force, 0.5 * step)
        return change

    def _share(self, side: int, above: float, force: float, time: float) -> None:
        """A sample's time and impulse between the two nodes beside its speed."""
        weight, load, _ = stroke = self._stroke[side]
        speeds = self._speeds
        speed = self._slowest + above
        place = min(int(math.log(speed / self._slowest) * self._scale), len(speeds) - 2)
        part = (speed - speeds[place]) / (speeds[place + 1] - speeds[place])
        part = min(max(part, 0.0), 1.0) * time
        weight[place] += time - part
        weight[place + 1] += part
        load[place] += (time - part) * force
        load[place + 1] += part * force
        stroke[2] += time * force * force

    def _close(self, side: int, time: float) -> Change | None:
        """A stroke into the sums and onto the chart."""
        weight, load = np.array(self._stroke[side][0]), np.array(self._stroke[side][1])
        stroke = Sums(weight, load, self._stroke[side][2])
        seconds = float(weight.sum())
        whole = seconds > WHOLE * self._usual[side]
        self._forget(side, stroke, seconds)
        self._count[side] += 1
        self._usual[side] += (seconds - self._usual[side]) / min(self._count[side], 50)
        if whole and (change := self._split(side, time, stroke, seconds)):
            return change
        if not self._compared:
            if min(self._count) >= self._settled:
                self._compared = True
                for each in (0, 1):
                    self._refer(each)
            return None
        if self._is_farther(side, weight):
            return None
        compared = self._reference[side]
        excess = float(load.sum() - weight @ compared) / max(seconds, 1e-300)
        if not whole or not math.isfinite(excess):
            return None
        return self._chart(side, time, excess, float(weight @ compared) / seconds)

    def _is_farther(self, side: int, weight: np.ndarray) -> bool:
        """Whether a stroke is faster than any that the reference was identified for."""
        first = int(np.searchsorted(self._nodes, self._limit[side] * (1 + 1e-9))) + 1
        # What is slower than the limit is shared up to the first node beyond it.
        if not weight[first:].any():
            return False
        self._farther[side] += 1
        if self._farther[side] >= SETTLED:
            self._refer(side)
        return True

    def _split(self, side: int, time: float, stroke: Sums, seconds: float) -> Change | None:
        """The last strokes of a direction beside each other."""
        recent = self._recent[side]
        speed = float(stroke.weight @ self._nodes) / seconds
        recent.append((speed, float(stroke.load.sum()) / seconds))
        speeds, forces = np.array(recent).T
        found = changepoint.split(speeds, forces, self._rate)
        if found is None:
            return None
        return self._changed(side, time, found.strokes, found.shift, found.before)

    def _forget(self, side: int, stroke: Sums, seconds: float) -> None:
        total, group = self._total, self._count[side] % precision.GROUPS
        kept = math.exp(-seconds / self._keep) if self._count[side] else 0.0
        if self._window:
            ring = self._ring[side] if self._count[side] else []
            self._ring[side] = ring
            ring.append(stroke)
            del ring[: -self._window]
            for values, parts in zip(total, zip(*ring, strict=True), strict=True):
                values[side] = np.sum(parts, axis=0)
            return
        for values, new in zip(total, stroke, strict=True):
            values[side] = kept * values[side] + new
        for groups, new in zip(self._groups, stroke, strict=True):
            if kept != 1:
                groups[:, side] *= kept
            groups[group, side] += new

    def _chart(self, side: int, time: float, excess: float, before: float) -> Change | None:
        moved, alarm = chart._add(self._charts[side], excess, self._height, np)
        self._charts[side] = Chart(*map(float, moved))
        self._rising[side] = self._rising[side] + 1 if max(moved.up, moved.down) > 0 else 0
        if not alarm:
            return None
        return self._changed(side, time, self._rising[side], excess, before)

    def _changed(self, side: int, time: float, count: int, excess: float, before: float) -> Change:
        sign = 1 - 2 * side
        more = sign * excess
        self._anew()
        return Change(time, sign, count, more, more / abs(before) if before else math.nan)

    def _curve(self, model: Model) -> np.ndarray:
        """Its friction at the nodes, N, signed, `(2, K)`."""
        both = jnp.stack([jnp.asarray(self._nodes), -jnp.asarray(self._nodes)])
        return np.asarray(model.friction(both), float)

    def solution(self) -> Solution:
        """The parameters from what has been seen and not forgotten; zero of an unseen direction."""
        return solve(self.term, self.state())

    def assess(self) -> precision.Assessment:
        """The parameters with their standard errors, and what speaks against them."""
        groups = self._groups
        if self._window:
            groups = precision.dealt(self._ring, self._count, self._total)
        return precision.assess(self.term, self.state(), groups, self.solution())

    def state(self) -> State:
        """The same as a [`State`][jaxfric.online.State], without the stroke under way."""
        keep, nodes = self._how["keep"], int(self._how["nodes"])
        state = moments.start(self._slowest, self._fastest, keep=keep, nodes=nodes)
        total = jax.tree.map(lambda x: jnp.asarray(x, state.nodes.dtype), self._total)
        count, usual = (jnp.asarray(x, state.nodes.dtype) for x in (self._count, self._usual))
        interval = jnp.asarray(self._interval, state.nodes.dtype)
        return state._replace(total=total, strokes=count, usual=usual, interval=interval)
