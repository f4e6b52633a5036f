"""The two ways to free the axis equation from acceleration; both end in rows of one regression.

`ClosedWindows` keeps samples in windows whose end velocities are equal: there acceleration is
orthogonal to every function of velocity (Kim, Kim & Ha 2004, Lemma 1), so inertia is left out.
`WeakForm` passes everything through a smooth compact kernel, on which the time derivative sits
(modulating functions, Shinbrot 1957; Messenger & Bortz 2021); inertia stays as one more column.
"""

from abc import abstractmethod

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..checks.motion import RARE
from ..data.recording import Recording
from ..signals import continuous, interval, kernel, kernel_slope, kernel_weights
from ..terms.base import AbstractTerm
from ..terms.sample import Scales

# Levels of velocity tried for the ends of a window, between the first and the last velocity of a
# segment: outside that range windows only get shorter.
WINDOW_LEVELS = 17
# Offsets of a kernel whose shares are added in one pass over the rows: a third of the time.
UNROLLED = 8


class Rows(eqx.Module):
    """Rows of the regression u ≈ Σ g α, and the linear map that makes them from samples.

    - `target`: the projected force, N, shape `(J,)`.
    - `positive`, `negative`: weights of the rows in each direction of slip, s, `(J,)`.
    - `moving`: weights of the rows over which errors are taken: reversals too, rest not, `(J,)`.
    - `time`: s, `(J,)`.
    - `windows`: how many windows (or, in the weak form, slip stretches) were used.
    - `covered`: share of the valid slip that the rows use: of its time or, in closed windows, the
      root of that of its squared speed in a direction that is not rare, whichever is least. By so
      much viscous friction is better known from all of the slip.
    """

    target: Float[Array, " J"]
    positive: Float[Array, " J"]
    negative: Float[Array, " J"]
    moving: Float[Array, " J"]
    time: Float[Array, " J"]
    windows: Float[Array, ""]
    covered: Float[Array, ""]
    _filter: "Filter | None" = None

    @property
    def sampled(self) -> bool:
        """Whether the rows are the samples themselves, not passed through a kernel."""
        return self._filter is None

    @property
    def reach(self) -> int:
        """Samples that a row reaches each way from its time."""
        return 0 if self._filter is None else self._filter.reach

    def project(
        self, columns: Float[Array, "N p"], momentum: Float[Array, "N p"] | None = None
    ) -> Float[Array, "J p"]:
        """Columns as rows of the regression, shape `(J, p)`; `momentum` enters differentiated."""
        return columns if self._filter is None else self._filter.apply(columns, momentum)

    def rate(self, momentum: Float[Array, " N"]) -> Float[Array, " J"]:
        """The time derivative of one momentum as rows of the weak form, `(J,)`."""
        return self._filter.rate(momentum[:, None])[:, 0]

    def thinned(self, recording: Recording, step: int) -> tuple["Rows", Recording]:
        """The same rows from one of so many samples, and these samples: for a first look.

        `step` divides the kernel's half-width and the distance of two kernels.
        """
        if step == 1 or self._filter is None:
            return self, recording
        some = jax.tree.map(lambda x: x[::step], recording)
        coarse = make_filter(some, interval(some), self._filter.reach // step)
        return eqx.tree_at(lambda r: r._filter, self, coarse), some

    def columns(self, term: AbstractTerm | None, recording: Recording) -> Float[Array, "J p"]:
        """The rows of a term's columns, `(J, p)`; no columns where there is no term."""
        if term is None:
            return jnp.zeros((self.target.shape[0], 0), self.target.dtype)
        momentum = term.momentum(recording) if term.inertial else None
        return self.project(term.columns(recording), momentum)

    def force(
        self, term: AbstractTerm, alpha: Float[Array, " p"], recording: Recording
    ) -> Float[Array, " J"]:
        """The rows of a term's force, N, less its known part; `alpha`: its affine parameters."""
        momentum = (term.momentum(recording) @ alpha)[:, None] if term.inertial else None
        return self.project((term.columns(recording) @ alpha)[:, None], momentum)[:, 0]

    def offset(self, term: AbstractTerm, recording: Recording) -> Float[Array, " J"]:
        """The rows of a term's known part f0, `(J,)`."""
        return self.project(term.offset(recording)[:, None])[:, 0]

    def relative(self, left: Float[Array, " J"]) -> Float[Array, ""]:
        """norm(left)/norm(force) over the rows in motion: the relative force error."""
        ours, whole = (jnp.sum(self.moving * x**2) for x in (left, self.target))
        return jnp.sqrt(ours / jnp.where(whole > 0, whole, 1.0))


class AbstractProjection(eqx.Module):
    """A way to rows; `keeps_inertia` tells whether acceleration is in them."""

    keeps_inertia: eqx.AbstractClassVar[bool]

    @abstractmethod
    def rows(self, recording: Recording, scales: Scales) -> Rows:
        """The rows of a prepared recording with its scales."""


class ClosedWindows(AbstractProjection):
    """Samples in slip, inside windows that end with the velocity at which they began.

    In every segment the longest window is taken, its ends interpolated to the crossing of the
    common end velocity; the windows are pooled.
    """

    keeps_inertia = False

    def rows(self, recording: Recording, scales: Scales) -> Rows:
        """The rows of a prepared recording: its samples, weighted by the time they stand for."""
        begin, end = _windows(recording, scales)
        positive, negative, slip = _slip_time(recording, scales, begin, end)
        used = jnp.sum(positive) + jnp.sum(negative)
        first = jnp.concatenate([jnp.ones(1, bool), jnp.diff(recording.segment) != 0])
        windows = jnp.sum(first & (end > begin))
        moving = jnp.where(jnp.abs(recording.velocity) > scales.slowest, scales.interval, 0.0)
        moving = jnp.where(recording.mask, moving, 0.0)
        covered = jnp.minimum(used / jnp.where(slip > 0, slip, 1.0), 1.0)
        square = jnp.where(moving > 0, recording.velocity**2, 0.0)
        for weights, side in ((positive, 1.0), (negative, -1.0)):
            ours = jnp.where(side * recording.velocity > 0, moving, 0.0)
            whole, often = jnp.sum(ours * square), jnp.sum(ours) >= RARE * jnp.sum(moving)
            part = jnp.sqrt(jnp.sum(weights * square) / jnp.where(whole > 0, whole, 1.0))
            covered = jnp.where(often & (whole > 0), jnp.minimum(part, covered), covered)
        force, time = recording.force, recording.time
        return Rows(force, positive, negative, moving, time, windows, covered)


def _windows(recording: Recording, scales: Scales) -> tuple[Float[Array, " N"], Float[Array, " N"]]:
    """Begin and end of the longest closed window of the segment that each sample belongs to, s."""
    time, velocity = recording.time, recording.velocity
    together = continuous(recording, scales.interval)
    count = recording.num_segments or 1
    segment = recording.segment

    size = time.shape[0]

    def over(reduce, per_segment, values):
        return reduce(values)[None] if count == 1 else per_segment(values, segment, count)

    def first(where):
        """The first sample of each segment for which it holds; `size` where it does for none."""
        return over(jnp.min, jax.ops.segment_min, jnp.where(where, jnp.arange(size), size))

    def last(where):
        """The last one; -1 or less where there is none."""
        return over(jnp.max, jax.ops.segment_max, jnp.where(where, jnp.arange(size), -1))

    def everywhere(values):
        """A number of each segment at its samples."""
        return values if count == 1 else values[segment]

    valid = recording.mask
    v_first = velocity[jnp.minimum(first(valid), size - 1)]
    v_last = velocity[jnp.maximum(last(valid), 0)]

    fastest = jnp.max(jnp.where(valid & jnp.isfinite(velocity), jnp.abs(velocity), 0.0))
    rounding = 64 * jnp.finfo(velocity.dtype).eps * fastest

    def longest(best, share):
        level = v_first + share * (v_last - v_first)

        def above(velocity, level):
            # A record that ends at the velocity at which it began does so to rounding.
            over = velocity - level
            return jnp.where(jnp.abs(over) <= rounding, 0.0, over)

        def crossed(at):
            """When the velocity's line from that sample to the next is at the level, s."""
            at = jnp.clip(at, 0, size - 2)
            before, after = (above(velocity[i], level) for i in (at, at + 1))
            rise = jnp.where(after == before, 1.0, after - before)
            return time[at] + jnp.clip(-before / rise, 0.0, 1.0) * (time[at + 1] - time[at])

        height = above(velocity, everywhere(level))
        crosses = jnp.pad(together & (height[1:] * height[:-1] <= 0), (0, 1))
        early, late = first(crosses), last(crosses)
        begin, end = crossed(early), crossed(late)
        better = (late >= 0) & (end - begin > best[1] - best[0])
        return (jnp.where(better, begin, best[0]), jnp.where(better, end, best[1])), None

    empty = (jnp.zeros(count, time.dtype), jnp.zeros(count, time.dtype))
    shares = jnp.linspace(0.0, 1.0, WINDOW_LEVELS, dtype=time.dtype)
    (begin, end), _ = jax.lax.scan(longest, empty, shares)
    return tuple(jnp.broadcast_to(everywhere(x), time.shape) for x in (begin, end))


def _slip_time(recording: Recording, scales: Scales, begin, end):
    """Time that each sample stands for in slip of either direction, s; and all the slip time.

    The trapezoidal rule on the velocity's straight line between samples, cut at the window's ends
    and where the line enters or leaves the stick zone; an interval's share goes to the end that
    slips, or half to each. The cuts are level sets of the velocity, so each direction's pieces
    are closed windows themselves and Lemma 1 holds on them.
    """
    time, velocity = recording.time, recording.velocity
    together = continuous(recording, scales.interval)
    steps = jnp.where(together, jnp.diff(time), 0.0)
    # Where the window cuts the interval, in shares of it.
    safe = jnp.where(steps > 0, steps, 1.0)
    low = jnp.clip((begin[1:] - time[:-1]) / safe, 0.0, 1.0)
    high = jnp.clip((end[1:] - time[:-1]) / safe, 0.0, 1.0)

    def direction(sign):
        height = sign * velocity - scales.slowest
        left, right = height[:-1], height[1:]
        cross = jnp.clip(left / jnp.where(left == right, 1.0, left - right), 0.0, 1.0)
        a = jnp.where(left > 0, 0.0, cross)
        b = jnp.where(right > 0, 1.0, cross)
        slips = (left > 0) | (right > 0)
        a, b = jnp.maximum(a, low), jnp.minimum(b, high)
        length = jnp.where(slips, jnp.maximum(b - a, 0.0), 0.0)
        # The integral of a straight line over [a, b] in terms of its end values at 0 and 1.
        to_right = length * 0.5 * (a + b)
        to_left = length - to_right
        only_left, only_right = (left > 0) & ~(right > 0), (right > 0) & ~(left > 0)
        to_left = jnp.where(only_left, length, jnp.where(only_right, 0.0, to_left)) * steps
        to_right = jnp.where(only_right, length, jnp.where(only_left, 0.0, to_right)) * steps
        return jnp.pad(to_left, (0, 1)) + jnp.pad(to_right, (1, 0))

    moving = jnp.abs(velocity) > scales.slowest
    slip = jnp.sum(jnp.where(moving[1:] & moving[:-1], steps, 0.0))
    return direction(1.0), direction(-1.0), slip


class Filter(eqx.Module):
    """A kernel slid along the record: local averages, and the derivative that sits on the kernel.

    `average` and `slope`: weights of the samples around each centre, `(2 reach + 1, J)`. The
    slope weights are normalised so that a constant has none and a straight line in time exactly
    its own, on any clock.
    """

    average: Float[Array, "K J"]
    slope: Float[Array, "K J"]
    reach: int = eqx.field(static=True)
    stride: int = eqx.field(static=True)

    def gather(self, values: Float[Array, "N *p"], offset) -> Float[Array, "J *p"]:
        """The values `offset` samples from each centre."""
        return _gather(values, offset, self.reach, self.stride)

    def apply(
        self, columns: Float[Array, "N p"], momentum: Float[Array, "N p"] | None
    ) -> Float[Array, "J p"]:
        """Kernel averages of columns plus those of the time derivative of momentum, `(J, p)`.

        ∫ φ ḣ dt = −∫ φ̇ h dt: the derivative is taken on the kernel.
        """
        averaged = self._weighed(self.average, columns)
        return averaged if momentum is None else averaged + self.rate(momentum)

    def rate(self, momentum: Float[Array, "N p"]) -> Float[Array, "J p"]:
        """The time derivative of momentum, `(J, p)`."""
        return self._weighed(self.slope, momentum)

    def _weighed(self, weights: Float[Array, "K J"], values: Float[Array, "N p"]):
        """Sums of the values around each centre, weighted, `(J, p)`."""

        def add(total, step):
            offset, weight = step
            return total + weight[:, None] * self.gather(values, offset), None

        offsets = jnp.arange(-self.reach, self.reach + 1)
        empty = jnp.zeros((weights.shape[1], values.shape[1]), values.dtype)
        return jax.lax.scan(add, empty, (offsets, weights), unroll=UNROLLED)[0]


def _gather(values, offset, reach, stride):
    count = len(range(reach, values.shape[0] - reach, stride))
    piece = jax.lax.dynamic_slice_in_dim(values, reach + offset, (count - 1) * stride + 1)
    return piece[::stride]


def make_filter(recording: Recording, typical: Float[Array, ""], half_width: int) -> Filter:
    """The kernel of that half-width in samples on the clock of a recording.

    `typical` is the sampling interval, s.

    **Raises:** `ValueError` if the recording is shorter than the kernel.
    """
    if recording.num_samples <= 2 * half_width:
        raise ValueError(
            f"A kernel of {2 * half_width + 1} samples does not fit into a recording of "
            f"{recording.num_samples}; use a shorter WeakForm(half_width=...)."
        )
    stride = max(1, half_width // 2)
    steps = jnp.where(continuous(recording, typical), jnp.diff(recording.time), 0.0)
    duration = 0.5 * (jnp.pad(steps, (0, 1)) + jnp.pad(steps, (1, 0)))
    centre = _gather(recording.time, 0, half_width, stride)

    def weigh(rise, offset):
        since = _gather(recording.time, offset, half_width, stride) - centre
        lasts = _gather(duration, offset, half_width, stride)
        tau = since / (half_width * typical)
        slope = kernel_slope(tau) * lasts
        return rise + slope * since, (kernel(tau) * lasts, slope)

    # One offset after the other: together the slices were a gather of every sample.
    offsets = jnp.arange(-half_width, half_width + 1)
    rise, (average, slope) = jax.lax.scan(weigh, jnp.zeros_like(centre), offsets)
    average, slope = kernel_weights(average, slope, rise)
    return Filter(average, slope, half_width, stride)


class WeakForm(AbstractProjection):
    """Everything through one kernel (1 − τ²)⁴, slid along the record by half its half-width.

    **Arguments:** `half_width`, in samples; [`identify`][jaxfric.identify] takes
    [`kernel_half_width`][jaxfric.signals.kernel_half_width] of the recording by default.
    Kernels not wholly inside slip of one direction are left out, since there friction jumps.

    **Raises:** `ValueError` for a half-width that is no whole number from 1.
    """

    half_width: int = eqx.field(
        static=True, converter=lambda w: int(w) if isinstance(w, np.integer) else w
    )
    keeps_inertia = True

    def __check_init__(self):
        width = self.half_width
        if not isinstance(width, int) or isinstance(width, bool) or width < 1:
            raise ValueError(
                f"half_width is {width!r}, and counts samples: give a whole number from 1, of "
                "seconds their number times the sample rate, as WeakForm(round(0.02 * rate)); or "
                "leave the projection out, and the width is chosen from the recording."
            )

    def rows(self, recording: Recording, scales: Scales) -> Rows:
        """The rows of a prepared recording; weighted where the kernel lies wholly inside slip."""
        filter_ = make_filter(recording, scales.interval, self.half_width)
        velocity, reach = recording.velocity, self.half_width
        broken = ~continuous(recording, scales.interval)
        breaks = jnp.pad(jnp.cumsum(broken, dtype=jnp.int32), (1, 0))
        whole = filter_.gather(breaks, reach) == filter_.gather(breaks, -reach)

        def within(slips):
            stops = jnp.cumsum(~slips, dtype=jnp.int32)
            before = filter_.gather(stops - (~slips).astype(stops.dtype), -reach)
            return whole & (filter_.gather(stops, reach) == before)

        spacing = filter_.stride * scales.interval
        positive = jnp.where(within(velocity > scales.slowest), spacing, 0.0)
        negative = jnp.where(within(velocity < -scales.slowest), spacing, 0.0)
        moving = (jnp.abs(velocity) > scales.slowest) & recording.mask
        sampled = filter_.apply(
            jnp.stack([recording.force, moving.astype(velocity.dtype)], 1), None
        )
        sign = jnp.sign(positive - negative)
        windows = jnp.sum((sign != jnp.pad(sign[:-1], (1, 0))) & (sign != 0))
        slip = jnp.sum(jnp.where(moving, scales.interval, 0.0))
        used = jnp.sum(positive) + jnp.sum(negative)
        covered = jnp.minimum(used / jnp.where(slip > 0, slip, 1.0), 1.0)
        mostly = jnp.where(whole & (sampled[:, 1] > 0.5), spacing, 0.0)
        time = filter_.gather(recording.time, 0)
        return Rows(sampled[:, 0], positive, negative, mostly, time, windows, covered, filter_)
