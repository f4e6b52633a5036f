"""Velocity without phase lag, noise, magnitudes, and what counts as slip."""

from .choosing import choose as choose
from .clock import (
    GAP_FACTOR as GAP_FACTOR,
    continuous as continuous,
    host_continuous as host_continuous,
    host_interval as host_interval,
    host_intervals as host_intervals,
    interval as interval,
    is_traced as is_traced,
    quantile as quantile,
)
from .comparing import (
    UNCERTAIN as UNCERTAIN,
    Derivable as Derivable,
    derivable as derivable,
    of_acceleration as of_acceleration,
)
from .derivatives import derivative as derivative, part_of as part_of
from .integral import placed as placed
from .kernels import (
    kernel as kernel,
    kernel_slope as kernel_slope,
    kernel_weights as kernel_weights,
)
from .late_velocity import (
    Increments as Increments,
    lag_of_velocity as lag_of_velocity,
    with_timely_velocity as with_timely_velocity,
)
from .motion import (
    SLIP_SHARE as SLIP_SHARE,
    Ready as Ready,
    counter_velocity as counter_velocity,
    host_scales as host_scales,
    kernel_half_width as kernel_half_width,
    measured as measured,
    prepare as prepare,
    scales as scales,
    velocity_noise as velocity_noise,
)
from .noise import (
    COLOURED as COLOURED,
    SLIP_DEVIATIONS as SLIP_DEVIATIONS,
    count_of as count_of,
    counted_noise as counted_noise,
    host_white_noise as host_white_noise,
    white_noise as white_noise,
)
from .parabolas import (
    TRACED_REACH as TRACED_REACH,
    choose_half_width as choose_half_width,
    local_quadratic as local_quadratic,
    mean_slope as mean_slope,
)
from .polynomial import (
    HALF_WIDTHS as HALF_WIDTHS,
    Choice as Choice,
    smoothing as smoothing,
)
