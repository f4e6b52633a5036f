"""A velocity recorded beside the position: kept, or derived where the position knows better."""

import dataclasses

import jax
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import jaxfric as jf
from jaxfric import signals

RATE, RATES = 1000.0, 2 * np.pi * 0.5


def cornered(seconds=8.0):
    """Clock, place and speed of an axis whose acceleration halves at each turn forward."""
    time = np.arange(int(RATE * seconds)) / RATE
    phase = RATES * time
    speed = np.sin(phase) + 0.3 * np.abs(np.sin(phase))
    swept = 2 * np.floor(phase / np.pi) + 1 - np.cos(phase % np.pi)
    return time, (0.3 * swept - np.cos(phase)) / RATES, speed


def counted(place, bits=18):
    count = np.ptp(place) / 2**bits
    return np.round(place / count) * count


def averaged(signal, reach):
    padded = np.pad(signal, reach, mode="reflect", reflect_type="odd")
    return np.convolve(padded, np.ones(2 * reach + 1) / (2 * reach + 1), "valid")


def log(time, place, velocity):
    return jf.Recording(time=time, force=0 * time, position=place, velocity=velocity)


def columns(reach):
    time, place, speed = cornered()
    noise = 1e-2 * np.random.default_rng(0).normal(size=time.size)
    own = {"exact": speed, "smoothed": averaged(speed, reach), "noisy": speed + noise}
    return time, counted(place), own


@settings(max_examples=4)
@given(st.integers(20, 40), st.floats(-6, 3), st.floats(-2, 2), st.booleans(), st.floats(-1e3, 1e3))
def test_the_column_that_errs_more_at_the_turns_gives_way_in_any_unit(
    reach, unit, pace, mirrored, start
):
    time, place, own = columns(reach)
    size, clock = (-1 if mirrored else 1) * 10.0**unit, 10.0**pace
    for name, velocity in own.items():
        record = log(start + clock * time, size * place, size / clock * velocity)
        anew = signals.derivable(record)
        assert anew is not None and anew.better is (name != "exact"), name
        found = signals.prepare(record).velocity * clock / size
        if name == "exact":
            np.testing.assert_array_equal(signals.prepare(record).velocity, record.velocity)
            continue
        turns = np.abs(own["exact"]) < 0.05
        inner = turns & (time > 0.1) & (time < time[-1] - 0.1)
        errors = [np.std((v - own["exact"])[inner]) for v in (found, velocity)]
        assert errors[0] < 0.5 * errors[1]


def test_a_column_is_kept_where_the_position_is_no_judge():
    time, place, own = columns(30)
    smoothed = own["smoothed"]
    coarse, other = counted(place, 5), np.roll(place, 700)
    for where, velocity in [(coarse, smoothed), (other, smoothed), (place, -smoothed)]:
        record = log(time, where, velocity)
        np.testing.assert_array_equal(signals.prepare(record).velocity, velocity)
    curve = dataclasses.replace(log(time, place, smoothed), position_every=4)
    assert signals.derivable(curve) is None
    gone = np.where(np.arange(time.size) % 50 == 0, np.nan, place)
    assert signals.derivable(log(time, gone, smoothed)) is None


@pytest.fixture(scope="module")
def axis():
    """The example axis at 2 kHz with an encoder of 17 bits over its travel, and its exact speed."""
    key = jax.random.key(0)
    record = jf.scenario.record(
        jf.scenario.machine(), periods=4, sample_rate=2000.0, force_noise=0.2, key=key
    )
    return dataclasses.replace(record, position=counted(np.asarray(record.position), 17))


@pytest.mark.slow
@pytest.mark.parametrize("reach", [12, 30])
def test_a_smoothed_column_takes_nothing_off_the_bump(axis, reach):
    smoothed = dataclasses.replace(axis, velocity=averaged(np.asarray(axis.velocity), reach))
    alone = dataclasses.replace(axis, velocity=None)
    model = jf.models.lorentzian()
    fits = [jf.identify(model, each) for each in (smoothed, alone, axis)]
    values = [[p.value for p in fit.parameters.values()] for fit in fits]
    np.testing.assert_allclose(values[0], values[1], rtol=1e-9)
    assert [remark.name for remark in fits[0].remarks][:1] == ["velocity_smoothed"]
    assert "velocity_smoothed" not in [remark.name for remark in fits[2].remarks]
    for name, true in jf.scenario.TRUTH.items():
        low, high = fits[0].parameters[name].interval()
        assert low < true < high, name
    # The same beside others in a batch.
    both = jf.identify(model, jf.stack([axis, smoothed]))
    np.testing.assert_allclose(both.model.alpha[1], fits[0].model.alpha, rtol=1e-6)
