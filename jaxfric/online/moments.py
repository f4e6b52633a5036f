"""D(β) and h(β) of eq. (13), accumulated sample by sample over velocity-closed cycles.

A stroke, from where the speed rises above the slowest slip to where it falls below it again, begins
and ends at one velocity, so that acceleration is orthogonal to every function of velocity over it
(Kim, Kim & Ha 2004, Lemma 1). What (13) needs of it for every β are the time W and the impulse U
at each of a fixed set of speeds: D = Σ W g gᵀ, h = Σ U g. So memory and time a sample are constant,
whatever the model and its grid.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from . import chart
from .chart import Chart

# Speeds a direction, between which a sample is shared linearly: 1 % apart over a ratio of 200. A
# curve is then off by h²/6 of its second derivative, which bumps and lines that resemble each other
# make up to 0.1 % of a parameter (1.5 % with 128). Memory: 4 numbers a speed and direction.
NODES = 512
# Of a longer step the velocity between two samples is not known: the stroke is thrown away.
GAP = 5.0
# Nodes reach so many times as far as the fastest sample: a motion that grows step by step widens
# them once an octave.
ABOVE = 2.0
# A stroke of less than this share of the usual time is chatter at the slowest slip.
WHOLE = 0.25


class Sums(NamedTuple):
    """Time `weight`, s, and impulse `load`, N·s, at each node, `(..., K)`; `square`, ∫u² dt, N²·s,
    `(...)`.
    """

    weight: Float[Array, "... K"]
    load: Float[Array, "... K"]
    square: Float[Array, "..."]


class State(NamedTuple):
    """All that is kept of a stream; a pytree of arrays of fixed shape.

    - `nodes`: speeds, m/s, `(K,)`, rising geometrically from the slowest slip; faster samples
      widen them. `beyond`: whether the last sample was faster.
    - `total`: the `Sums` of closed strokes in each direction, `(2, K)`, forward first.
    - `stroke`: those of the stroke under way; `inside`: whether its beginning was seen, `(2,)`.
    - `ring`: the last strokes of each direction where a window forgets, `(2, n, K)`; else `n` = 0.
    - `strokes`: closed strokes, `(2,)`; `usual`: their mean duration, s, `(2,)`.
    - `keep`: time constant of forgetting in slip time of a direction, s (infinite: never).
    - `last`: time, velocity and force of the last sample, `(3,)`; `interval`: the mean step, s.
    - `reference`: force at the nodes that strokes are compared with, N, `(2, K)`; NaN: none yet.
    - `chart`: of each direction's mean excess over it; `height`: its threshold.
    """

    nodes: Float[Array, " K"]
    total: Sums
    stroke: Sums
    inside: Bool[Array, " 2"]
    ring: Sums
    strokes: Float[Array, " 2"]
    usual: Float[Array, " 2"]
    keep: Float[Array, ""]
    last: Float[Array, " 3"]
    interval: Float[Array, ""]
    reference: Float[Array, "2 K"]
    chart: Chart
    height: Float[Array, ""]
    beyond: Bool[Array, ""]


class News(NamedTuple):
    """What a sample brought, each `(2,)`: a closed stroke, its mean force less the reference, N,
    and whether the chart says that friction has changed.
    """

    closed: Bool[Array, " 2"]
    excess: Float[Array, " 2"]
    changed: Bool[Array, " 2"]


def start(
    slowest: float,
    fastest: float,
    *,
    keep: float = np.inf,
    window: int = 0,
    false_alarms: float = 1e-4,
    nodes: int = NODES,
) -> State:
    """The state before the first sample.

    **Arguments:** `slowest`, the smallest speed that counts as slip, m/s (four deviations of the
    velocity's noise); `fastest`, the highest speed that is expected, m/s (two faster samples
    in succession widen the nodes); `keep`, slip time after which a stroke weighs 1/e, s; or
    `window`, how many strokes of each direction count; `false_alarms`, of the change detection, a
    stroke of a direction.

    **Raises:** `ValueError` for speeds, times or rates that are none.
    """
    if not 0 < slowest < fastest < np.inf:
        raise ValueError(f"start needs 0 < slowest < fastest, m/s; not {slowest!r}, {fastest!r}.")
    if not keep > 0 or window < 0 or nodes < 4 or (window and np.isfinite(keep)):
        raise ValueError(
            f"keep={keep!r} is a time over zero, s, window={window!r} a number of strokes, and one "
            "of the two forgets; nodes is 4 or more."
        )
    height = jnp.asarray(chart.threshold(false_alarms), float)
    two, none = jnp.zeros(2), jnp.zeros((2, nodes))
    sums, zero = Sums(none, none, two), jnp.zeros(())
    ring = Sums(*(jnp.zeros((2, window, *s.shape[1:])) for s in sums))
    speeds = jnp.asarray(np.geomspace(slowest, fastest, nodes), float)
    last = jnp.full(3, jnp.nan)
    inside, unknown = jnp.zeros(2, bool), jnp.full((2, nodes), jnp.nan)
    return State(
        speeds, sums, sums, inside, ring, two, two, jnp.asarray(keep, float), last, zero, unknown,
        chart.empty(two), height, jnp.zeros((), bool),
    )  # fmt: skip


def reference(state: State, force: Float[Array, "2 K"]) -> State:
    """The state with a curve at its nodes to compare strokes with, N (signed); charts anew."""
    return state._replace(reference=force, chart=chart.empty(state.strokes))


def hats(nodes: Float[np.ndarray, " K"], speed: Float[np.ndarray, " N"]) -> np.ndarray:
    """The shares of the nodes in speeds between them, `(N, K)`."""
    place = np.clip(np.searchsorted(nodes, speed, side="right") - 1, 0, len(nodes) - 2)
    part = np.clip((speed - nodes[place]) / (nodes[place + 1] - nodes[place]), 0.0, 1.0)
    share, row = np.zeros((len(speed), len(nodes))), np.arange(len(speed))
    share[row, place], share[row, place + 1] = 1 - part, part
    return share


def wider(state: State, speed: Float[Array, ""]) -> State:
    """The state on nodes up to `ABOVE` times a speed, m/s; a reference has to be given anew.

    A sum at a node is shared between the two new ones beside it as samples of its speed are: time,
    impulse and mean speed stay what they were.
    """
    nodes = state.nodes
    low, step = nodes[0], jnp.log(ABOVE * speed / nodes[0]) / (nodes.size - 1)
    wide = low * jnp.exp(step * jnp.arange(nodes.size, dtype=nodes.dtype))
    place = jnp.clip(jnp.searchsorted(wide, nodes, side="right") - 1, 0, nodes.size - 2)
    part = jnp.clip((nodes - wide[place]) / (wide[place + 1] - wide[place]), 0.0, 1.0)

    def shared(x: Array) -> Array:
        up, empty = jnp.broadcast_to(part, x.shape) * x, jnp.zeros_like(x)
        return empty.at[..., place].add(x - up).at[..., place + 1].add(up)

    def moved(sums: Sums) -> Sums:
        return Sums(shared(sums.weight), shared(sums.load), sums.square)

    state = state._replace(
        nodes=wide, total=moved(state.total), stroke=moved(state.stroke), ring=moved(state.ring)
    )
    return reference(state, jnp.full_like(state.reference, jnp.nan))


def update(state: State, sample: Float[Array, " 3"]) -> tuple[State, News]:
    """The state after one sample (time s, velocity m/s, force N), and what it brought.

    A pure function of fixed shapes: it runs in `jax.lax.scan(update, state, samples)`, samples of
    shape `(N, 3)`, and under `jax.jit` and `jax.vmap`.
    """
    time, velocity, _ = sample
    known = jnp.all(jnp.isfinite(sample))
    fast = known & (jnp.abs(velocity) > state.nodes[-1])
    widened = fast & state.beyond
    beyond = jnp.where(known, fast & ~widened, state.beyond)
    state = jax.lax.cond(widened, wider, lambda s, _: s, state, jnp.abs(velocity))
    known = known & ~beyond  # a lone sample beyond all others counts as missing
    step = time - state.last[0]
    usual = jnp.where(state.interval > 0, state.interval, step)
    linked = (step > 0) & (step <= GAP * usual) & known
    sign = jnp.asarray([1.0, -1.0], velocity.dtype)
    slowest = state.nodes[0]
    left, right = sign * state.last[1] - slowest, sign * velocity - slowest
    entered, ended = (left <= 0) & (right > 0), (left > 0) & (right <= 0)
    inside = linked & (state.inside | entered)
    cross = jnp.clip(left / jnp.where(left == right, 1.0, left - right), 0.0, 1.0)
    a, b = jnp.where(left > 0, 0.0, cross), jnp.where(right > 0, 1.0, cross)
    length = jnp.where(inside & ((left > 0) | (right > 0)), b - a, 0.0) * step
    length = jnp.where(length > 0, length, 0.0)
    late = jnp.where(entered, 1.0, jnp.where(ended, 0.0, 0.5 * (a + b)))
    ends = (state.last, sample)
    weights = (length * (1 - late), length * late)
    grown = _grown(state.stroke, state.nodes, sign, ends, weights)
    closed = inside & ended
    state = state._replace(stroke=grown)
    # A stroke that a gap broke off is thrown away.
    broken = known & state.inside & ~inside
    after, news = _closed(state, closed, broken)
    # The mean step forgets, so that it follows a clock that changes.
    interval = jnp.where(linked, usual + 0.02 * (step - usual), state.interval)
    return after._replace(
        inside=jnp.where(known, inside & ~closed, state.inside),
        last=jnp.where(known, sample, state.last),
        interval=interval,
        beyond=beyond,
    ), news


def _grown(sums: Sums, nodes, sign, ends, weights) -> Sums:
    """The sums with two samples shared between the nodes beside their speeds."""
    ratio = jnp.log(nodes[1] / nodes[0])
    weight, load, square = sums
    for (_, velocity, force), share in zip(ends, weights, strict=True):
        share, force = jnp.where(share > 0, share, 0.0), jnp.where(jnp.isfinite(force), force, 0.0)
        speed = jnp.clip(jnp.nan_to_num(sign * velocity), nodes[0], nodes[-1])
        place = jnp.clip(jnp.floor(jnp.log(speed / nodes[0]) / ratio), 0, nodes.size - 2)
        low = place.astype(jnp.int32)
        part = jnp.clip((speed - nodes[low]) / (nodes[low + 1] - nodes[low]), 0.0, 1.0)
        side = jnp.arange(2)
        for index, amount in ((low, share * (1 - part)), (low + 1, share * part)):
            weight = weight.at[side, index].add(amount)
            load = load.at[side, index].add(amount * force)
        square = square + share * force**2
    return Sums(weight, load, square)


def _closed(state: State, closed, broken) -> tuple[State, News]:
    """The state with the strokes that are closed, and the charts of their excess."""

    def close(state: State):
        stroke = state.stroke
        time = jnp.sum(stroke.weight, axis=1)
        whole = closed & (time > WHOLE * state.usual)
        safe = jnp.where(time > 0, time, 1.0)
        compared = jnp.where(stroke.weight != 0, stroke.weight * state.reference, 0.0)
        excess = (jnp.sum(stroke.load, axis=1) - jnp.sum(compared, axis=1)) / safe
        charted = whole & jnp.isfinite(excess)
        moved, alarm = chart.add(state.chart, jnp.where(charted, excess, 0.0), state.height)
        moved = jax.tree.map(lambda new, old: jnp.where(charted, new, old), moved, state.chart)
        kept = jnp.where(closed, jnp.exp(-time / state.keep), 1.0)
        total, ring = _forgotten(state, stroke, closed, kept)
        count = state.strokes + closed.astype(state.strokes.dtype)
        usual = jnp.where(
            closed, state.usual + (time - state.usual) / jnp.minimum(count, 50.0), state.usual
        )
        news = News(closed, jnp.where(charted, excess, jnp.nan), charted & alarm)
        over = closed | broken
        left = jax.tree.map(lambda s: jnp.where(_column(over, s), 0.0, s), stroke)
        more = {"ring": ring, "strokes": count, "usual": usual, "chart": moved}
        return state._replace(total=total, stroke=left, **more), news

    def go_on(state: State):
        nothing = jnp.zeros(2, bool)
        return state, News(nothing, jnp.full_like(state.usual, jnp.nan), nothing)

    return jax.lax.cond(jnp.any(closed | broken), close, go_on, state)


def _column(values: Array, like: Array) -> Array:
    """Values of the two directions, to stand beside an array of more dimensions."""
    return values[(...,) + (None,) * (like.ndim - 1)]


def _forgotten(state: State, stroke: Sums, closed, kept) -> tuple[Sums, Sums]:
    """The sums with a closed stroke more, older ones faded or out of the window."""
    size = state.ring.weight.shape[1]
    if size == 0:
        total = jax.tree.map(
            lambda old, new: _column(kept, old) * old + jnp.where(_column(closed, new), new, 0.0),
            state.total, stroke,
        )  # fmt: skip
        return total, state.ring
    place = (state.strokes % size).astype(jnp.int32)
    side = jnp.arange(2)

    def put(ring, new):
        return ring.at[side, place].set(jnp.where(_column(closed, new), new, ring[side, place]))

    ring = jax.tree.map(put, state.ring, stroke)
    # Summed anew each time, so that no rounding piles up.
    return jax.tree.map(lambda r: jnp.sum(r, axis=1), ring), ring
