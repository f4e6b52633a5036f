"""Checks of a batch look at suspect rows alone, and find what checks of all rows find."""

import sys

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import jaxfric as jf
from jaxfric import checks
from jaxfric.checks import Design, screening

SAMPLES = 1500


def swing(seed):
    """A motion of several swings and the force of an axis with friction and noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(SAMPLES) * 1e-3
    velocity = 0.1 * np.sin(2 * np.pi * rng.uniform(1, 20) * time)
    force = 10 * np.sign(velocity) + 40 * velocity + rng.normal(0, 0.5, SAMPLES)
    return rng, {"time": time, "velocity": velocity, "force": force}


def gone(rng, log):
    log["force"][rng.integers(0, SAMPLES, 60)] = np.nan
    log["velocity"][rng.integers(0, SAMPLES, 60)] = np.nan


def spiked(rng, log):
    log["force"][rng.integers(0, SAMPLES, 4)] *= 1e3
    log["velocity"][rng.integers(0, SAMPLES, 2)] += 1.0


def clipped(rng, log):
    np.clip(log["force"], -11, rng.uniform(9, 14), out=log["force"])


def held(rng, log):
    every = int(rng.integers(2, 6))
    log["force"] = np.repeat(log["force"][::every], every)[:SAMPLES]


def drawn(rng, log):
    at, every = np.arange(SAMPLES), int(rng.integers(3, 14))
    log["force"] = np.interp(at, at[::every], log["force"][::every])


def counted(rng, log):
    step = rng.uniform(0.1, 12)
    log["force"] = np.round(log["force"] / step) * step


def filled(rng, log):
    log["force"][rng.random(SAMPLES) < rng.uniform(0, 0.05)] = 0.0


def frozen(rng, log):
    log["force"][200 : 200 + int(rng.integers(100, 250))] = 3.0


def overflowing(rng, log):
    log["force"] = (rng.uniform(1, 4) * log["force"] + 20) % 40 - 20


def copied(rng, log):
    log["force"] = 3 * log["velocity"] + rng.normal(0, rng.choice([0, 0.003, 0.01]), SAMPLES)


def accelerating(rng, log):
    log["force"] = 5 * np.gradient(log["velocity"], log["time"]) + rng.normal(0, 0.1, SAMPLES)


def one_way(rng, log):
    log["velocity"] = np.abs(log["velocity"]) + rng.uniform(-0.005, 0.02)


def one_speed(rng, log):
    log["velocity"] = rng.uniform(0.95, 1.1) * 0.1 * np.sign(log["velocity"])


def quick(rng, log):
    log["velocity"] = 0.1 * np.sin(np.arange(SAMPLES) * rng.uniform(0.3, 0.6))


def resting(rng, log):
    log["velocity"] = 0 * log["velocity"]


def broken(rng, log):
    log["time"] = log["time"] + np.cumsum((rng.random(SAMPLES) < 0.05) * 0.1)


def far_too_fast(rng, log):
    log["velocity"] = log["velocity"] * 1e4


def ending(rng, log):
    log["mask"] = np.arange(SAMPLES) < rng.integers(20, SAMPLES)


FAULTS = [gone, spiked, clipped, held, drawn, counted, filled, frozen, overflowing, copied]
FAULTS += [accelerating, one_way, one_speed, quick, resting, broken, far_too_fast, ending]


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 2**20), st.sets(st.sampled_from(FAULTS), max_size=2))))
def test_only_rows_without_faults_are_not_looked_at(rows):
    logs = []
    for seed, faults in [(0, ()), *rows]:
        rng, log = swing(seed)
        for fault in sorted(faults, key=FAULTS.index):
            fault(rng, log)
        log.setdefault("mask", np.ones(SAMPLES, bool))
        logs.append(jf.Recording(**log))
    together = checks.recorded_rows(jf.stack(logs), [None] * len(logs))
    alone = np.stack([checks.recorded(log) for log in logs])
    np.testing.assert_array_equal(together, alone)

    def every(rows, unit):
        return screening.Suspect(*np.ones((4, len(rows.force)), bool))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys.modules["jaxfric.checks.recorded"], "suspects", every)
        everything = checks.recorded_rows(jf.stack(logs), [None] * len(logs))
    np.testing.assert_array_equal(together, everything)


def test_a_healthy_row_is_no_suspect():
    logs = jf.stack([jf.Recording(**swing(seed)[1]) for seed in range(20)])
    velocity, force, mask = (np.asarray(x) for x in (logs.velocity, logs.force, logs.mask))
    rows = screening.Rows(velocity, force, None, mask, mask, mask[:, 1:])
    assert not np.any(screening.suspects(rows, "m"))


def designs(count):
    """Rows of fits with noise, late forces and other gains, some without weight."""
    rng = np.random.default_rng(count)
    time = np.arange(600) * 0.01
    found = []
    for i in range(count):
        columns = np.stack([np.sign(np.sin(2 * time)), np.sin(2 * time), np.cos(3 * time)], 1)
        alpha = np.array([10.0, 4.0, 1.0])
        late = rng.choice([0.0, 0.002, 0.03])
        target = np.stack([np.interp(time - late, time, c) for c in columns.T], 1) @ alpha
        target = target * np.where((target > 0) & (i % 5 == 0), 1.2, 1.0)
        target += rng.choice([0.01, 0.3, 3.0]) * rng.normal(size=len(time))
        weight = (rng.random(len(time)) < rng.choice([0.02, 0.6, 1.0])).astype(float)
        if i % 4 == 0:  # one that the others span
            columns = np.concatenate([columns, columns[:, :1] - columns[:, 1:2]], axis=1)
        else:
            columns = np.concatenate([columns, (time**2)[:, None]], axis=1)
        root = np.sqrt(weight)
        fit = np.linalg.lstsq(root[:, None] * columns, root * target, rcond=None)[0]
        slope = np.gradient(target, time)
        shift = -np.linalg.lstsq(root[:, None] * columns, root * slope, rcond=None)[0]
        found.append(Design(columns, target, target - columns @ fit, weight, time, shift))
    return found, Design(*map(np.stack, zip(*found, strict=True)))


def test_fits_of_a_batch_are_looked_at_as_each_alone():
    each, together = designs(80)
    looks = checks.looks(together)
    errors = np.array([np.linalg.norm(d.left) / np.linalg.norm(d.target) for d in each])
    fits = [
        checks.Estimated(np.array([10.0, 4.0]), np.array([0.1, 0.1]), 0.02, look.late)
        for look in looks
    ]
    suspect = checks.suspects(together, errors, looks, fits)
    assert 0 < np.count_nonzero(~suspect)
    for i, design in enumerate(each):
        late, own = checks.lateness(design), looks[i].late
        assert (late is None) == (own is None)
        if late is not None:
            np.testing.assert_allclose(late.time, own.time, rtol=1e-9, atol=1e-12)
        if not suspect[i]:
            assert np.isnan(checks.fitted(design, errors[i], fits[i])).all()
