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
from jaxtyping import Array, Float

from .recording import Recording
from .signals import continuous, interval, kernel, kernel_slope, scales
from .terms.base import Scales

# Levels of velocity tried for the ends of a window, between the first and the last velocity of a
# segment: outside that range windows only get shorter.
WINDOW_LEVELS = 17


class Rows(eqx.Module):
    """Rows of the regression u ≈ Σ g α, and the linear map that makes them from samples.

    - `target`: the projected force, N, shape `(J,)`.
    - `positive`, `negative`: weights of the rows in each direction of slip, s, `(J,)`.
    - `time`: s, `(J,)`.
    - `windows`: how many windows (or, in the weak form, slip stretches) were used.
    - `covered`: share of the valid slip time that the rows use.
    - `jump`: what open ends leave of ∫ v̇ dt in each direction, m/s, `(2,)`; zero for closed ones.
    """

    target: Float[Array, " J"]
    positive: Float[Array, " J"]
    negative: Float[Array, " J"]
    time: Float[Array, " J"]
    windows: Float[Array, ""]
    covered: Float[Array, ""]
    _filter: "Filter | None" = None

    def project(
        self, columns: Float[Array, "N p"], momentum: Float[Array, "N p"]
    ) -> Float[Array, "J p"]:
        """Columns as rows of the regression, shape `(J, p)`; `momentum` enters differentiated."""
        if self._filter is None:
            return columns
        return self._filter.smooth(columns) + self._filter.differentiate(momentum)


class AbstractProjection(eqx.Module):
    """A way to rows; `keeps_inertia` tells whether acceleration is in them."""

    keeps_inertia: eqx.AbstractClassVar[bool]

    @abstractmethod
    def rows(self, recording: Recording) -> Rows:
        """The rows of a prepared recording."""


class ClosedWindows(AbstractProjection):
    """Samples in slip, inside windows that end with the velocity at which they began.

    In every segment the longest window is taken, its ends interpolated to the crossing of the
    common end velocity; the windows are pooled.
    """

    keeps_inertia = False

    def rows(self, recording: Recording) -> Rows:
        """The rows of a prepared recording: its samples, weighted by the time they stand for."""
        limits = scales(recording)
        begin, end = _windows(recording)
        positive, negative, slip = _slip_time(recording, limits, begin, end)
        used = jnp.sum(positive) + jnp.sum(negative)
        first = jnp.concatenate([jnp.ones(1, bool), jnp.diff(recording.segment) != 0])
        windows = jnp.sum(first & (end > begin))
        return Rows(
            recording.force, positive, negative, recording.time, windows, used / jnp.maximum(slip, 1e-30)
        )


def _windows(recording: Recording) -> tuple[Float[Array, " N"], Float[Array, " N"]]:
    """Begin and end of the longest closed window of the segment that each sample belongs to, s."""
    time, velocity = recording.time, recording.velocity
    together = continuous(recording, interval(recording))
    count = recording.num_segments or 1
    segment = recording.segment

    def over(reduce, per_segment, values, fill):
        if count == 1:
            return jnp.broadcast_to(reduce(values), (1,))
        return per_segment(jnp.where(jnp.isfinite(values), values, fill), segment, count)

    def first(values):
        return over(jnp.min, jax.ops.segment_min, values, jnp.inf)

    def last(values):
        return over(jnp.max, jax.ops.segment_max, values, -jnp.inf)

    valid = recording.mask
    begins = first(jnp.where(valid, time, jnp.inf))[segment] == time
    ends = last(jnp.where(valid, time, -jnp.inf))[segment] == time
    v_first = -first(jnp.where(begins & valid, -velocity, jnp.inf))
    v_last = -first(jnp.where(ends & valid, -velocity, jnp.inf))

    def longest(best, share):
        level = (v_first + share * (v_last - v_first))[segment]
        above = velocity - level
        crosses = together & (above[1:] * above[:-1] <= 0)
        rise = jnp.where(above[1:] == above[:-1], 1.0, above[1:] - above[:-1])
        share_before = jnp.clip(-above[:-1] / rise, 0.0, 1.0)
        at = time[:-1] + share_before * jnp.diff(time)
        early = jnp.concatenate([jnp.where(crosses, at, jnp.inf), jnp.full(1, jnp.inf)])
        late = jnp.concatenate([jnp.where(crosses, at, -jnp.inf), jnp.full(1, -jnp.inf)])
        begin, end = first(early), last(late)
        better = end - begin > best[1] - best[0]
        return (jnp.where(better, begin, best[0]), jnp.where(better, end, best[1])), None

    empty = (jnp.zeros(count, time.dtype), jnp.zeros(count, time.dtype))
    shares = jnp.linspace(0.0, 1.0, WINDOW_LEVELS, dtype=time.dtype)
    (begin, end), _ = jax.lax.scan(longest, empty, shares)
    return begin[segment], end[segment]


def _slip_time(recording: Recording, limits: Scales, begin, end):
    """Time that each sample stands for in slip of either direction, s; and all the slip time.

    The trapezoidal rule on the velocity's straight line between samples, cut at the window's ends
    and where the line enters or leaves the stick zone; an interval's share goes to the end that
    slips, or half to each. The cuts are level sets of the velocity, so each direction's pieces
    are closed windows themselves and Lemma 1 holds on them.
    """
    time, velocity = recording.time, recording.velocity
    together = continuous(recording, interval(recording))
    steps = jnp.where(together, jnp.diff(time), 0.0)
    # Where the window cuts the interval, in shares of it.
    safe = jnp.where(steps > 0, steps, 1.0)
    low = jnp.clip((begin[1:] - time[:-1]) / safe, 0.0, 1.0)
    high = jnp.clip((end[1:] - time[:-1]) / safe, 0.0, 1.0)

    def direction(sign):
        height = sign * velocity - limits.slowest
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

    moving = jnp.abs(velocity) > limits.slowest
    slip = jnp.sum(jnp.where(moving[1:] & moving[:-1], steps, 0.0))
    return direction(1.0), direction(-1.0), slip


class Filter(eqx.Module):
    """A kernel slid along the record: local averages, and the derivative that sits on the kernel."""

    time: Float[Array, " N"]
    duration: Float[Array, " N"]
    typical: Float[Array, ""]
    reach: int = eqx.field(static=True)
    stride: int = eqx.field(static=True)

    @property
    def centres(self) -> Float[Array, " J"]:
        """Indices of the samples at which the kernels are centred, shape `(J,)`."""
        return jnp.arange(self.reach, self.time.shape[0] - self.reach, self.stride)

    def gather(self, values: Float[Array, "N *p"], offset: Array) -> Float[Array, "J *p"]:
        """The values `offset` samples from each centre."""
        count = len(range(self.reach, self.time.shape[0] - self.reach, self.stride))
        length = (count - 1) * self.stride + 1
        piece = jax.lax.dynamic_slice_in_dim(values, self.reach + offset, length)
        return piece[:: self.stride]

    def _weigh(self, values, shape, relative):
        """Sums over the kernel of shape(τ) Δt values, the values taken relative to the centre."""
        centre = self.gather(self.time, jnp.asarray(0))
        middle = self.gather(values, jnp.asarray(0))

        def add(total, offset):
            tau = (self.gather(self.time, offset) - centre) / (self.reach * self.typical)
            weight = shape(tau) * self.gather(self.duration, offset)
            piece = self.gather(values, offset)
            piece = piece - middle if relative else piece
            return total + weight[:, None] * piece, None

        offsets = jnp.arange(-self.reach, self.reach + 1)
        return jax.lax.scan(add, jnp.zeros_like(middle), offsets)[0]

    def smooth(self, values: Float[Array, "N p"]) -> Float[Array, "J p"]:
        """Kernel averages of columns, `(J, p)`."""
        mass = self._weigh(jnp.ones_like(self.time)[:, None], kernel, False)
        return self._weigh(values, kernel, False) / jnp.where(mass > 0, mass, 1.0)

    def differentiate(self, values: Float[Array, "N p"]) -> Float[Array, "J p"]:
        """Kernel averages of the time derivative of columns, `(J, p)`: ∫φ ḣ dt = −∫φ̇ h dt.

        Normalised so that a straight line in time has exactly its slope, on any clock.
        """
        rise = self._weigh(self.time[:, None], kernel_slope, True)
        return self._weigh(values, kernel_slope, True) / jnp.where(rise != 0, rise, 1.0)


class WeakForm(AbstractProjection):
    """Everything through one kernel (1 − τ²)⁴, slid along the record by half its half-width.

    **Arguments:** `half_width`, in samples; see [`kernel_half_width`][] for the default.
    Kernels not wholly inside slip of one direction are left out, since there friction jumps.
    """

    half_width: int = eqx.field(static=True)
    keeps_inertia = True

    def rows(self, recording: Recording) -> Rows:
        """The rows of a prepared recording, one for each kernel wholly inside slip."""
        limits = scales(recording)
        filter_ = make_filter(recording, self.half_width)
        velocity = recording.velocity
        together = continuous(recording, interval(recording))
        links = jnp.pad(jnp.cumsum(~together), (1, 0))
        slow_up, slow_down = velocity <= limits.slowest, velocity >= -limits.slowest

        def clear(broken):
            count = jnp.pad(jnp.cumsum(broken), (1, 0))
            after = filter_.gather(count[1:], jnp.asarray(self.half_width))
            return after - filter_.gather(count[:-1], jnp.asarray(-self.half_width)) == 0

        unbroken = (
            filter_.gather(links, jnp.asarray(self.half_width))
            == filter_.gather(links, jnp.asarray(-self.half_width))
        )
        target = filter_.smooth(recording.force[:, None])[:, 0]
        spacing = filter_.stride * filter_.typical
        positive = jnp.where(unbroken & clear(slow_up), spacing, 0.0)
        negative = jnp.where(unbroken & clear(slow_down), spacing, 0.0)
        used = jnp.sum(positive) + jnp.sum(negative)
        slip = jnp.sum(jnp.where(jnp.abs(velocity) > limits.slowest, filter_.typical, 0.0))
        sign = jnp.sign(positive - negative)
        windows = jnp.sum((sign != jnp.pad(sign[:-1], (1, 0))) & (sign != 0))
        time = filter_.gather(recording.time, jnp.asarray(0))
        return Rows(
            target, positive, negative, time, windows, used / jnp.maximum(slip, 1e-30), filter_
        )


def make_filter(recording: Recording, half_width: int) -> Filter:
    """The kernel of that half-width in samples on the clock of a recording."""
    typical = interval(recording)
    steps = jnp.where(continuous(recording, typical), jnp.diff(recording.time), 0.0)
    duration = 0.5 * (jnp.pad(steps, (0, 1)) + jnp.pad(steps, (1, 0)))
    return Filter(recording.time, duration, typical, half_width, max(1, half_width // 2))
