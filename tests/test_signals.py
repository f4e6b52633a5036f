"""The smoothing derivative, its width, the M/T method, and windows with equal end velocities."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

import jaxfric as jf
from jaxfric import signals


def irregular(seed, size=200, jitter=0.4):
    steps = 1e-3 * (1 + jitter * np.random.default_rng(seed).uniform(-1, 1, size - 1))
    return np.concatenate([[0.0], np.cumsum(steps)])


def log(time, position, **more):
    return jf.Recording(time=time, force=0 * time, position=position, **more)


@settings(max_examples=15)
@given(
    st.integers(0, 10**6),
    st.tuples(*[st.floats(-1, 1)] * 3),
    st.sampled_from([2, 3, 8, 20]),
    st.floats(-6, 3),
)
def test_a_parabola_on_an_irregular_clock_has_its_exact_derivative(seed, factors, width, unit):
    """Local quadratic regression reproduces parabolas, the ends of a segment included."""
    time, (a, b, c) = irregular(seed), factors
    scale = 10.0**unit
    position = scale * (a + b * time / 0.2 + c * (time / 0.2) ** 2)
    slope = scale * (b / 0.2 + 2 * c * time / 0.2**2)
    found = signals.derivative(log(time, position), position, width)
    # Three samples make a parabola; of two, where the clock leaves no more, a line.
    near = np.abs(time[:, None] - time) < 0.95 * (width + 0.5) * np.median(np.diff(time))
    near = np.sum(near & (np.abs(np.subtract.outer(np.arange(200), np.arange(200))) <= width), 1)
    line = scale * 2 * abs(c) / 0.2**2 * 1.5e-3
    # Rounding of a position of one unit, differenced over a millisecond and less.
    error = np.abs(np.asarray(found) - slope)
    assert np.all(error <= np.where(near > 2, 1e-8 * scale, line + 1e-8 * scale))
    assert np.mean(near > 2) > 0.97


def test_segments_do_not_see_each_other():
    time = irregular(0)
    segment = np.repeat([0, 1], 100)
    position = np.where(segment == 0, 3 * time, 1e3 - 5 * time)
    clock = np.where(segment == 0, time, time - time[100])  # the clock restarts
    found = signals.derivative(log(clock, position, segment=segment), position, 8)
    np.testing.assert_allclose(found, np.where(segment == 0, 3.0, -5.0), atol=1e-7)


def test_masked_samples_take_no_part():
    time = irregular(1)
    position, valid = 2 * time + time**2, np.ones(200, bool)
    valid[[50, 51, 120]] = False
    spoiled = np.where(valid, position, [np.nan, 1e9] * 100)
    record = log(time, spoiled, mask=valid)
    found = signals.derivative(record, np.asarray(record.position), 8)
    np.testing.assert_allclose(np.asarray(found)[valid], (2 + 2 * time)[valid], atol=1e-8)


@pytest.mark.parametrize("width", [3, 8, 20])
def test_a_sine_comes_out_in_phase(width):
    time = np.arange(4001) / 1000
    rate = 2 * np.pi * 2
    position = np.sin(rate * time)
    found = np.asarray(signals.derivative(log(time, position), position, width))[500:-501]
    inner = time[500:-501]
    lag = np.arctan2(found @ np.sin(rate * inner), found @ np.cos(rate * inner))
    assert abs(lag) < 1e-6


def test_time_reversed_signals_have_the_negative_derivative():
    time = np.arange(500) / 1000
    position = np.random.default_rng(2).normal(size=500)
    forward = signals.derivative(log(time, position), jnp.asarray(position), 12)
    backward = signals.derivative(log(time, position[::-1]), jnp.asarray(position[::-1]), 12)
    np.testing.assert_allclose(forward, -backward[::-1], rtol=1e-9, atol=1e-9)


def slope_weights(width):
    """The slope of a weighted parabola on an even clock: odd weights that give a line its slope."""
    offset = np.arange(-width, width + 1)
    weight = np.maximum(1 - (offset / (width + 0.5)) ** 2, 0) ** 4 * offset
    return weight / (weight @ offset)


def test_the_derivative_is_the_stated_convolution():
    time = np.arange(300) / 1000
    position = np.random.default_rng(4).normal(size=300)
    found = signals.derivative(log(time, position), jnp.asarray(position), 12)
    expected = np.convolve(position, slope_weights(12)[::-1], "same") * 1000
    np.testing.assert_allclose(found[12:-12], expected[12:-12], rtol=1e-9, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "kind"),
    [
        (200.0, "noise"),
        (200.0, "coarse counts"),
        (200.0, "fine counts"),
        (1000.0, "noise"),
        (1000.0, "coarse counts"),
        (1000.0, "fine counts"),
        (10000.0, "noise"),
        (10000.0, "coarse counts"),
        (10000.0, "fine counts"),
    ],
)
@pytest.mark.parametrize("unit", [1e-6, 1e3])
def test_the_chosen_width_is_nearly_the_best_of_the_ladder(rate, kind, unit):
    time = np.arange(int(4 * rate)) / rate
    parts = [(1, 0.05, 0.2), (3, 0.01, 1.0), (7, 0.002, 2.0)]
    position = sum(a * np.sin(2 * np.pi * n / 4 * time + p) for n, a, p in parts)
    velocity = sum(
        a * 2 * np.pi * n / 4 * np.cos(2 * np.pi * n / 4 * time + p) for n, a, p in parts
    )
    if kind == "noise":
        seen = position + 1e-5 * np.random.default_rng(3).normal(size=time.size)
    else:
        count = 1e-5 if kind == "coarse counts" else 1e-7
        seen = np.round(position / count) * count
    record = log(time, unit * seen)
    inner = slice(300, -300) if time.size > 1200 else slice(100, -100)

    def error(width):
        found = np.convolve(seen, slope_weights(width)[::-1], "same") * rate
        return np.sqrt(np.mean((found - velocity)[inner] ** 2))

    chosen = int(signals.choose_half_width(record))
    errors = {k: error(k) for k in signals.HALF_WIDTHS if k <= time.size // 8}
    assert errors[chosen] <= 1.3 * min(errors.values()), (chosen, errors)


def test_what_the_derivative_takes_off_is_known():
    """A parabola flattens a wave by as much as is said; a higher degree by next to nothing."""
    clock = np.arange(8000) * 1e-3
    record = log(clock, 0.02 * np.sin(40 * clock))
    true = 0.8 * np.cos(40 * clock)

    def gain(velocity):
        return velocity[100:-100] @ true[100:-100] / (true[100:-100] @ true[100:-100])

    choice = signals.Choice(2, 16)
    rough = np.asarray(signals.prepare(record, choice).velocity)
    back = rough - signals.smoothing(choice) * np.gradient(np.gradient(rough))
    assert gain(rough) < 0.997
    assert abs(gain(back) - 1) < 0.1 * (1 - gain(rough))
    higher = signals.Choice(4, 16)
    assert signals.smoothing(higher) == 0
    assert abs(gain(np.asarray(signals.prepare(record, higher).velocity)) - 1) < 1e-3


def multisine(top, seconds, rng):
    """Three sines up to a frequency: functions of time for position and velocity."""
    rates = 2 * np.pi * top * np.array([0.13, 0.31, 1.0])
    sizes, phases = np.array([0.5, 0.3, 0.2]) / rates, rng.uniform(0, 6, 3)

    def position(t):
        return sizes @ np.sin(rates[:, None] * t + phases[:, None])

    def velocity(t):
        return (sizes * rates) @ np.cos(rates[:, None] * t + phases[:, None])

    return position, velocity


def chirp(top, seconds, rng):
    """A sine whose frequency rises to `top`."""
    sweep, start = np.pi * top / seconds, rng.uniform(0, 6)

    def position(t):
        return 0.1 / top * np.sin(sweep * t**2 + start)

    def velocity(t):
        return 0.2 / top * sweep * t * np.cos(sweep * t**2 + start)

    return position, velocity


def trapezoid(top, seconds, rng):
    """Moves to and fro; the ramps of the speed last as long as half a cycle of `top`."""
    ramp, period = 0.5 / top, 5.0 / top
    start = rng.uniform(0, period)

    def velocity(t):
        phase = (t + start) % period
        half = phase % (period / 2)
        height = np.clip(np.minimum(half, period / 2 - half) / ramp, 0, 1)
        return np.where(phase < period / 2, height, -height)

    def position(t):
        phase = (t + start) % period
        half = phase % (period / 2)
        rest = period / 2 - half
        moved = np.where(half < ramp, half**2 / (2 * ramp), half - ramp / 2)
        whole = period / 2 - ramp
        moved = np.where(rest < ramp, whole - rest**2 / (2 * ramp), moved)
        return np.where(phase < period / 2, moved, whole - moved)

    return position, velocity


@pytest.mark.slow
@settings(max_examples=40)
@given(
    st.sampled_from([multisine, chirp, trapezoid]),
    st.floats(np.log10(20), np.log10(5e4)),  # Hz, of the samples
    st.floats(np.log10(6), 3.5),  # samples in a cycle of the fastest motion
    st.floats(2, 7),  # counts of the encoder over the travel
    st.booleans(),
    st.integers(0, 10**6),
)
# The noise of counts hides the bias of its width, which wider ones show.
@example(chirp, 2.0, 1.0625, 2.5, True, 0)
def test_the_velocity_is_within_a_hundredth_or_it_is_said(kind, rate, cycle, counts, even, seed):
    """At any rate and with any encoder; `error` is what the warning is made of."""
    rng, rate, cycle = np.random.default_rng(seed), 10**rate, 10**cycle
    size = int(np.clip(40 * cycle, 400, 40_000))
    time = np.arange(size) / rate
    if not even:
        time = time + rng.uniform(-0.2, 0.2, size) / rate
    position, velocity = kind(rate / cycle, size / rate, rng)
    seen, true = position(time), velocity(time)
    count = np.ptp(seen) / 10**counts
    record = log(time, np.round(seen / count) * count)
    choice = signals.choose(record)
    found = np.asarray(signals.prepare(record, choice).velocity)
    size_of_motion = np.sqrt(np.mean(true**2))
    error = np.sqrt(np.mean((found - true) ** 2)) / size_of_motion
    told = choice.error / size_of_motion > 0.005
    assert error < 0.01 or told, (error, choice)
    assert error < 6 * max(choice.error / size_of_motion, 0.002), (error, choice)


@pytest.mark.slow
@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_the_width_is_chosen_in_a_second_at_fifty_kilohertz(jitter):
    rng = np.random.default_rng(0)
    time = (np.arange(300_000) + jitter * rng.uniform(-0.5, 0.5, 300_000)) / 5e4
    seen = np.round(0.02 * np.sin(3 * time) / 1e-6) * 1e-6
    choice = signals.choose(log(time, seen))
    found = signals.derivative(log(time, seen), seen, choice.half_width, choice.degree)
    true = 0.06 * np.cos(3 * time)
    assert np.sqrt(np.mean((found - true) ** 2)) < 0.01 * np.sqrt(np.mean(true**2))


def test_a_motion_that_every_width_swallows_is_not_taken_for_rest():
    """Two sines up to 5 Hz, a fine encoder, 100 Hz: widths above a cycle agree on nothing."""
    time = np.arange(2000) / 100
    position = 0.01 * np.sin(10 * np.pi * time) + 0.02 * np.sin(3 * np.pi * time)
    velocity = 0.1 * np.pi * np.cos(10 * np.pi * time) + 0.06 * np.pi * np.cos(3 * np.pi * time)
    record = log(time, np.round(position / 1e-6) * 1e-6)
    for found in (signals.prepare(record), eqx.filter_jit(signals.prepare)(record)):
        left = np.asarray(found.velocity) - velocity
        assert np.sqrt(np.mean(left[20:-20] ** 2)) < 0.02 * np.sqrt(np.mean(velocity**2))


def test_prepare_keeps_a_recorded_velocity_and_derives_a_missing_one():
    time = np.arange(1000) / 1000
    record = log(time, np.sin(5 * time))
    np.testing.assert_allclose(
        signals.prepare(record).velocity[20:-20], (5 * np.cos(5 * time))[20:-20], rtol=0, atol=1e-3
    )
    own = dataclasses.replace(record, velocity=jnp.asarray(time))
    np.testing.assert_array_equal(signals.prepare(own).velocity, time)


def filtered(time, velocity, constant):
    """Through a first-order filter, as drives have it, exactly for straight lines in between."""
    step = time[1] - time[0]
    keep, out = np.exp(-step / constant), np.array(velocity)
    for i in range(1, len(time)):
        rise = (velocity[i] - velocity[i - 1]) / step
        target = velocity[i - 1] - rise * constant
        out[i] = target + rise * step + (out[i - 1] - target) * keep
    return out


@settings(max_examples=15)
@given(
    st.sampled_from([200.0, 1000.0, 4000.0]),
    st.floats(0.7, 6.0),
    st.floats(-6, 3),
    st.integers(0, 10**6),
)
def test_what_a_filter_does_to_a_velocity_is_undone(rate, late, unit, seed):
    """Six samples of a filter take a fiftieth off the amplitude, and make a fifth of an error."""
    rng = np.random.default_rng(seed)
    time, unit = np.arange(4000) / rate, 10.0**unit
    position, velocity = multisine(rate / 200, time[-1], rng)
    place, speed = position(time), velocity(time)
    place = unit * (place + 1e-5 * np.std(place) * rng.standard_normal(len(time)))
    noise = 3e-3 * np.std(speed) * rng.standard_normal(len(time))
    own = filtered(time, unit * speed, late / rate) + unit * noise
    record = log(time, place, velocity=own)
    assert signals.lag_of_velocity(record) * rate == pytest.approx(late, rel=0.1)
    prepared = signals.prepare(record)
    known = np.asarray(prepared.mask)
    assert abs(np.count_nonzero(~known) - late) < 1.1
    error = np.asarray(prepared.velocity) / unit - speed
    assert np.std(error[known]) < 5e-3 * np.std(speed)
    assert signals.lag_of_velocity(prepared) == 0


def test_a_late_velocity_keeps_what_is_too_fast_for_the_derivative():
    """An encoder of 300 counts a stroke, and a cogging of the speed, ten samples a cycle."""
    time = np.arange(8000) / 1000
    speed = np.sin(9 * time) + 0.6 * np.sin(31 * time)
    ripple = 0.02 * np.sin(2 * np.pi * 100 * time)
    place = np.cumsum(speed + ripple) / 1000
    count = np.ptp(place) / 300
    late = filtered(time, speed, 5e-3) + np.roll(ripple, 5)
    record = log(time, np.round(place / count) * count, velocity=late)
    found = np.asarray(signals.prepare(record).velocity)[500:-500]
    wave = np.exp(2j * np.pi * 100 * time[500:-500])
    assert 2 * abs(np.mean(found * wave)) == pytest.approx(0.02, rel=0.05)
    slow = np.convolve(found - (speed + ripple)[500:-500], np.ones(50) / 50, "valid")
    assert np.std(slow) < 0.01 * np.std(speed)


def test_a_velocity_is_kept_that_is_not_late_or_that_the_position_cannot_judge():
    rng = np.random.default_rng(3)
    time = np.arange(4000) / 1000
    position, velocity = multisine(5.0, time[-1], rng)
    place, speed = position(time), velocity(time)
    noise = 3e-3 * np.std(speed) * rng.standard_normal(len(time))
    quotient = np.diff(place, prepend=place[0] - 1e-3 * speed[0]) / 1e-3
    late = filtered(time, speed, 3e-3)
    coarse = np.round(place / np.ptp(place) * 12) * np.ptp(place) / 12
    early = np.append(speed[4:], [speed[-1]] * 4)
    for where, own in [
        (place, speed + noise), (place, quotient + noise), (place, early), (coarse, late),
        (place, -late), (place, 2 * late), (np.roll(place, 1300), late),
    ]:  # fmt: skip
        record = log(time, where, velocity=own)
        assert signals.lag_of_velocity(record) == 0
        np.testing.assert_array_equal(signals.prepare(record).velocity, own)


@pytest.mark.parametrize("speed", [0.013, 0.2, -0.4])
def test_counter_velocity_is_exact_at_constant_speed(speed):
    """The M/T method measures pulses against their own clock, so counts do not quantise it."""
    resolution, tick, rate = 1e-4, 1e-7, 1000.0
    time = np.arange(1, 1000) / rate
    counts = np.trunc(speed * time / resolution)
    clock = np.round(counts * resolution / speed / tick)  # the instant of the last pulse
    found = np.asarray(signals.counter_velocity(counts, clock, resolution, tick))
    moving = found != 0
    assert moving.sum() > 50
    # A tick of jitter at both ends of an interval of one sample (or pulse) at least.
    shortest = resolution / abs(speed) * max(1, int(abs(speed) / rate / resolution))
    np.testing.assert_allclose(found[moving], speed, rtol=2 * tick / shortest)


@eqx.filter_jit
def rows(record):
    return jf.ClosedWindows().rows(record, signals.scales(record))


def wave(rate=1000.0, seconds=3.3, phase=0.4, unit=1.0):
    """A sine that does not end at the velocity at which it began."""
    time = np.arange(int(seconds * rate)) / rate
    velocity = unit * np.cos(2 * np.pi * time + phase)
    return jf.Recording(time=time, force=0 * time, velocity=velocity)


@pytest.mark.parametrize("rate", [200.0, 1000.0, 5000.0])
def test_windows_end_at_the_crossing_of_a_common_velocity(rate):
    """∫ v̇ h(v) dt over the rows vanishes with the square of the interval (Lemma 1)."""
    record = wave(rate)
    found = rows(record)
    slope = np.gradient(np.asarray(record.velocity), np.asarray(record.time))
    for weight in (found.positive, found.negative):
        for power in (0, 1, 3):
            moment = float(
                np.sum(np.asarray(weight) * slope * np.asarray(record.velocity) ** power)
            )
            assert abs(moment) < 60 / rate**2 + 30 / rate**2 * power, (power, moment)


def test_the_whole_period_is_in_the_window():
    found = rows(wave(seconds=3.3))
    # Of 3.3 periods at least three form the longest window.
    assert 3 / 3.3 - 0.02 <= float(found.covered) <= 1.0 + 1e-9
    assert int(found.windows) == 1


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_a_period_that_closes_to_rounding_is_one_window(kind):
    time = np.arange(4001) / 1000
    velocity = 0.1 * np.sin(np.pi * time / 2) + 0.03 * np.sin(1.5 * np.pi * time)
    signals_ = {"time": time, "force": 0 * time, "velocity": velocity}
    found = rows(jf.Recording(**{name: x.astype(kind) for name, x in signals_.items()}))
    assert float(found.covered) > 0.99
    np.testing.assert_allclose(jnp.sum(found.positive), jnp.sum(found.negative), rtol=1e-2)


def test_a_ramp_has_no_closed_window():
    time = np.arange(1000) / 1000
    found = rows(jf.Recording(time=time, force=0 * time, velocity=0.1 + time))
    assert int(found.windows) == 0
    assert float(jnp.sum(found.positive) + jnp.sum(found.negative)) == 0


def test_every_segment_has_its_own_window_and_their_order_does_not_matter():
    pair = [wave(phase=0.4), wave(phase=2.0, seconds=2.6)]
    totals, separate = [], [rows(r) for r in pair]
    for order in ((0, 1), (1, 0)):
        parts = [pair[i] for i in order]
        joined = jf.Recording(
            time=jnp.concatenate([r.time for r in parts]),
            force=jnp.concatenate([r.force for r in parts]),
            velocity=jnp.concatenate([r.velocity for r in parts]),
            segment=np.repeat([0, 1], [r.num_samples for r in parts]),
        )
        found = rows(joined)
        assert int(found.windows) == 2
        totals.append((float(jnp.sum(found.positive)), float(jnp.sum(found.negative))))
    np.testing.assert_allclose(totals[0], totals[1], rtol=1e-12)
    for side, name in enumerate(("positive", "negative")):
        apart = sum(float(jnp.sum(getattr(r, name))) for r in separate)
        # The pooled speed quantile, and so the stick threshold, differs a little.
        np.testing.assert_allclose(totals[0][side], apart, rtol=5e-3)


def test_masked_samples_have_no_weight_and_open_no_window():
    record = wave()
    valid = np.ones(record.num_samples, bool)
    valid[700:720] = False
    found = rows(dataclasses.replace(record, mask=jnp.asarray(valid)))
    assert float(jnp.sum(jnp.where(valid, 0.0, found.positive + found.negative))) == 0


@pytest.mark.slow
@settings(max_examples=30)
@given(
    st.sampled_from([1, 2, 3, 100, 8195]),
    st.integers(0, 10**6),
    st.floats(0, 1),
    st.floats(-300, 300),
    st.booleans(),
)
def test_a_quantile_counted_is_the_quantile_sorted(count, seed, share, exponent, single):
    draw = np.random.default_rng(seed)
    values = draw.standard_normal(count) * 10.0 ** (exponent / (8 if single else 1))
    values[draw.uniform(size=values.size) < draw.uniform()] = draw.choice([np.nan, values[0], 0.0])
    values = values.astype(np.float32 if single else float)
    found = eqx.filter_jit(signals.quantile)(jnp.asarray(values), share)
    assert found.dtype == values.dtype
    expected = np.nanquantile(values, share) if not np.isnan(values).all() else np.nan
    scale = 0.0 if np.isnan(expected) else np.nanmax(np.abs(values))
    tolerance = 8 * np.finfo(values.dtype).eps * scale
    np.testing.assert_allclose(found, expected, rtol=1e-6 if single else 1e-14, atol=tolerance)


def test_a_quantile_follows_the_values_it_lies_between():
    values = jnp.asarray(np.random.default_rng(0).permutation(1002) * 1.0)
    slope = jax.grad(lambda x: signals.quantile(x, 0.5))(values)
    middle = np.isin(values, [500, 501])
    np.testing.assert_allclose(slope, 0.5 * middle)
    assert np.isnan(signals.quantile(jnp.full(7, jnp.nan), 0.5))


@pytest.mark.parametrize("kind", ["plain", "position", "bad", "single", "nothing"])
def test_magnitudes_on_the_host_are_those_of_a_program(kind):
    draw = np.random.default_rng(3)
    time = np.cumsum(draw.uniform(0.9e-3, 1.1e-3, 700))
    velocity = np.round(np.sin(9 * time) + 1e-3 * draw.normal(size=time.size), 3)
    position = np.cumsum(velocity) * 1e-3 if kind == "position" else None
    mask = np.full(time.size, kind != "nothing")
    segment = (time > time[400]).astype(np.int32)
    if kind == "bad":
        mask[650:], velocity[650:], velocity[20] = False, 7.0, np.nan
    if kind == "single":
        time, velocity = np.float32(time), np.float32(velocity)
    log = jf.Recording(time, 3 * velocity, position, velocity, mask=mask, segment=segment)
    found, noise = signals.host_scales(log)
    expected = eqx.filter_jit(signals.scales)(log)
    tolerance = 2e-5 if kind == "single" else 1e-12
    for ours, theirs in zip(found, expected, strict=True):
        assert ours.dtype == theirs.dtype
        np.testing.assert_allclose(ours, theirs, rtol=tolerance)
    theirs = signals.velocity_noise(log, expected.interval)
    np.testing.assert_allclose(noise, theirs, rtol=tolerance)


@pytest.mark.parametrize("seed", range(3))
def test_a_shift_by_a_sample_does_not_turn_the_choice_of_a_width(seed):
    """The bias is that of a few corners: of too few places some hold one, and some hold none."""
    acceleration = np.zeros(10_000)
    for start in range(600, 10_000, 2400):
        acceleration[start : start + 30] = 60.0
        acceleration[start + 1200 : start + 1230] = -60.0
    noise = np.random.default_rng(seed).normal(0, 2e-3, acceleration.size)
    speed = 1e-3 * np.cumsum(acceleration) + noise
    time = 1e-3 * np.arange(9990)

    def width(shift):
        velocity = speed[shift : shift + time.size]
        return signals.choose(jf.Recording(time, 0 * time, velocity=velocity), velocity).half_width

    assert len({width(shift) for shift in range(8)}) == 1


@pytest.mark.parametrize(("decimals", "known"), [(6, True), (4, True), (2, False)])
def test_counts_are_known_behind_the_decimals_of_a_log(decimals, known):
    """512 counts a revolution in radians: 0.01227, of which two decimals leave other steps."""
    count, time = 2 * np.pi / 512, np.arange(20000) / 1000
    angle = np.round(count * np.round(3 * np.sin(2 * time) / count), decimals)
    assert signals.count_of(angle) == pytest.approx(count if known else 0.01, rel=1e-3)


def test_a_position_that_is_measured_has_no_counts():
    noise = np.random.default_rng(0).normal(size=20000)
    angle = 3 * np.sin(2 * np.arange(20000) / 1000) + 1e-3 * noise
    assert signals.count_of(angle) == 0.0
