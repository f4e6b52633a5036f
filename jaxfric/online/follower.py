"""A plain object for a control loop: one call a sample, parameters and changes as they come."""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..models import Model
from ..terms.base import AbstractTerm
from . import chart, moments
from .chart import Chart
from .moments import GAP, NODES, WHOLE, State, Sums, merged
from .solving import Solution, friction_only, solve

# Strokes of each direction before strokes are compared with what was identified from them.
SETTLED = 8


class Change(NamedTuple):
    """A change of friction: `time` of detection, s; `direction`, 1 or −1; `strokes` since it seems
    to have begun; `excess`, the last one's mean force over the reference, N, signed with the
    direction: positive is more friction; `share` of the reference's mean force.
    """

    time: float
    direction: int
    strokes: int
    excess: float
    share: float


class Follower:
    """Friction followed sample by sample: constant memory and time, no acceleration, no mass.

    The arithmetic is that of [`update`][jaxfric.online.update], in plain Python, which is quicker
    one sample at a time. After `SETTLED` strokes of each direction the curve identified so far
    becomes the reference of the charts; a change forgets nearly all and begins anew. A faster
    sample than `fastest` widens the nodes, and a reference that reaches so far is learned anew.

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
        first = moments.start(slowest, fastest, **self._how)  # type: ignore[arg-type]
        self._nodes = np.asarray(first.nodes, float)
        self._reach()
        self._height, self._keep, self._window = float(first.height), keep, window
        self._last: tuple[float, float, float] | None = None
        self._interval = 0.0
        size = len(self._speeds)
        self._total = Sums(np.zeros((2, size)), np.zeros((2, size)), np.zeros(2))
        self._ring: list[list[Sums]] = [[], []]
        self._usual = [0.0, 0.0]
        self._anew()
        self._curve()  # compiled before the first sample, not between two

    def _anew(self) -> None:
        """What was before counts as a tenth of a stroke: until new ones come it is all there is."""
        for side in (0, 1):
            self._ring[side] = self._ring[side][-1:]
            seconds = float(self._total.weight[side].sum())
            kept = min(1.0, 0.1 * self._usual[side] / seconds) if seconds > 0 else 0.0
            for values in self._total:
                values[side] = kept * values[side]
        self._count = [0, 0]
        self._inside = [False, False]
        self._stroke = [self._empty(), self._empty()]
        self._learn(SETTLED)

    def _reach(self) -> None:
        """What depends on the nodes alone."""
        self._speeds = self._nodes.tolist()
        self._slowest, self._fastest = self._speeds[0], self._speeds[-1]
        self._scale = (len(self._speeds) - 1) / math.log(self._fastest / self._slowest)

    def _widen(self) -> None:
        """Nodes up to fastest²/slowest, as [`wider`][jaxfric.online.moments.wider] has them."""
        ratio = self._speeds[1] / self._slowest
        self._nodes = self._slowest * (self._nodes / self._slowest) ** 2
        self._reach()

        def moved(weight, load, square) -> Sums:
            weight, load = (merged(np.asarray(x), ratio, np) for x in (weight, load))
            return Sums(weight, load, square)

        self._total = moved(*self._total)
        self._ring = [[moved(*stroke) for stroke in side] for side in self._ring]
        strokes = (moved(*stroke) for stroke in self._stroke)
        self._stroke = [[s.weight.tolist(), s.load.tolist(), s.square] for s in strokes]
        self._learn(max(self._count) + SETTLED)

    def _learn(self, until: int) -> None:
        """No reference until so many strokes of each direction are closed."""
        self._settled = until
        self._reference: np.ndarray | None = None
        self._charts = [Chart(0.0, 0.0, 0.0, 0.0, 0.0)] * 2
        self._rising = [0, 0]

    def _empty(self) -> list:
        """Time and impulse at the nodes, and the square of the force."""
        return [[0.0] * len(self._speeds), [0.0] * len(self._speeds), 0.0]

    @property
    def fastest(self) -> float:
        """The speed up to which speeds are told apart, m/s; a faster sample raises it."""
        return self._fastest

    @property
    def strokes(self) -> tuple[int, int]:
        """Closed strokes since the last change, forward and backward."""
        return self._count[0], self._count[1]

    def add(self, time: float, velocity: float, force: float) -> Change | None:
        """One sample, s, m/s, N; what has changed, if it has. Samples that are not finite count
        as missing.
        """
        if not math.isfinite(time + velocity + force):
            return None
        while abs(velocity) > self._fastest:
            self._widen()
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
        if self._reference is None:
            if min(self._count) >= self._settled:
                self._reference = self._curve()
            return None
        compared = self._reference[side]
        excess = float(load.sum() - weight @ compared) / max(seconds, 1e-300)
        if not whole or not math.isfinite(excess):
            return None
        return self._chart(side, time, excess, float(weight @ compared) / seconds)

    def _forget(self, side: int, stroke: Sums, seconds: float) -> None:
        total = self._total
        if self._window:
            ring = self._ring[side]
            ring.append(stroke)
            del ring[: -self._window]
            for values, parts in zip(total, zip(*ring, strict=True), strict=True):
                values[side] = np.sum(parts, axis=0)
            return
        kept = math.exp(-seconds / self._keep)
        for values, new in zip(total, stroke, strict=True):
            values[side] = kept * values[side] + new

    def _chart(self, side: int, time: float, excess: float, before: float) -> Change | None:
        moved, alarm = chart._add(self._charts[side], excess, self._height, np)
        self._charts[side] = Chart(*map(float, moved))
        self._rising[side] = self._rising[side] + 1 if max(moved.up, moved.down) > 0 else 0
        if not alarm:
            return None
        sign, count = 1 - 2 * side, self._rising[side]
        more = sign * excess
        self._anew()
        return Change(time, sign, count, more, more / abs(before) if before else math.nan)

    def _curve(self) -> np.ndarray:
        model = self.solution().model
        both = jnp.stack([jnp.asarray(self._nodes), -jnp.asarray(self._nodes)])
        return np.asarray(model.friction(both), float)

    def solution(self) -> Solution:
        """The parameters from what has been seen and not forgotten; zero of an unseen direction."""
        return solve(self.term, self.state())

    def state(self) -> State:
        """The same as a [`State`][jaxfric.online.State], without the stroke under way."""
        keep, nodes = self._how["keep"], int(self._how["nodes"])
        state = moments.start(self._slowest, self._fastest, keep=keep, nodes=nodes)
        total = jax.tree.map(lambda x: jnp.asarray(x, state.nodes.dtype), self._total)
        count, usual = (jnp.asarray(x, state.nodes.dtype) for x in (self._count, self._usual))
        interval = jnp.asarray(self._interval, state.nodes.dtype)
        return state._replace(total=total, strokes=count, usual=usual, interval=interval)
