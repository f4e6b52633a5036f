"""Repairs: made where they are certain, listed with what they changed, and left out on request."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jaxfric import checks
from jaxfric.data import io
from jaxfric.data.cleaning import FILTERED_SEAM, MISSING_ROWS, UNEXPLAINED_JUMP, clean


def put_in_order(t, x, force=None, velocity=None, **how):
    signals = {"time": t.copy(), "position": x.copy()}
    signals["force"] = np.cos(3 * t) if force is None else force.copy()
    if velocity is not None:
        signals["velocity"] = velocity.copy()
    return clean(signals, None, np.arange(len(t)) + 2, "log", **how)


def write(path, **columns):
    io.write_table(path, columns)
    return path


# ---- wraps ----


def stroke(kind, cycles, length, n, counts=1e5):
    """Forth and back over a stroke, at rest at both ends."""
    share = np.arange(n) / n * cycles % 1
    if kind == "sine":
        x = (1 - np.cos(2 * np.pi * share)) / 2
    else:
        knots = [0, 0.05, 0.4, 0.45, 0.5, 0.55, 0.9, 0.95, 1]
        x = np.cumsum(np.interp(share, knots, [0, 1, 1, 0, 0, -1, -1, 0, 0]))
        x = (x - x.min()) / np.ptp(x)
    return np.round(x * counts) / counts * length


@settings(max_examples=40)
@given(
    kind=st.sampled_from(["sine", "trapezoid"]),
    length=st.sampled_from([0.05, 1.0, 2 * np.pi, 360.0]),
    cycles=st.integers(2, 15),
    how=st.sampled_from(["no force on the way back", "rows gone", "rows gone, time anew"]),
)
def test_a_stroke_that_is_seen_one_way_only_is_no_turn(kind, length, cycles, how):
    """Force missing on the way back, or its rows: the position is complete as it is."""
    t = np.arange(8000) / 1000
    x = stroke(kind, cycles, length, 8000)
    back = np.diff(x, append=x[-1]) < 0
    force = np.where(back, np.nan, 1 + np.cos(5 * t)) if how.startswith("no") else np.cos(5 * t)
    if how.startswith("rows"):
        t, x, force = t[~back], x[~back], force[~back]
    if how.endswith("anew"):
        t = np.arange(len(x)) / 1000
    tidy = put_in_order(t, x, force)
    kept = np.isin(t, tidy.signals["time"])
    np.testing.assert_array_equal(tidy.signals["position"], x[kept])


@settings(max_examples=40)
@given(
    turn=st.sampled_from([2 * np.pi, 360.0, 4096.0, 10000.0, 50.0]),
    bits=st.integers(10, 17),
    half=st.booleans(),
    swing=st.floats(1.2, 4.0),
    drift=st.floats(-5.0, 5.0),
    periods=st.integers(1, 5),
    phase=st.floats(0.0, 6.0),
    stated=st.booleans(),
)
def test_a_turn_is_continued(turn, bits, half, swing, drift, periods, phase, stated):
    share = np.arange(6000) / 6000
    turns = swing * np.sin(2 * np.pi * periods * share + phase) + drift * share
    quantum = turn / 2**bits
    true = np.round(turns * turn / quantum) * quantum
    wrapped = np.mod(true + half * turn / 2, turn) - half * turn / 2
    tidy = put_in_order(share * 6, wrapped, period=turn if stated else None)
    assert np.ptp(tidy.signals["position"] - true) < 1e-6 * turn
    (note,) = tidy.notes
    changed = np.max(np.abs(tidy.signals["position"] - wrapped))
    assert f"changes it by up to {changed:.6g}" in note


def test_a_jump_that_is_not_understood_says_how_to_unwrap(tmp_path):
    """One crossing of a turn that is not a usual one proves nothing; stated, it is continued."""
    t = np.arange(3000) / 1000
    true = np.round(2300 * t + 300 * np.sin(3 * t))
    path = write(tmp_path / "log.csv", time=t, position=np.mod(true, 5100.0), force=np.cos(t))
    recording, notes = io.read_with_notes(path)
    assert UNEXPLAINED_JUMP in notes[0] and "--period position=" in notes[0]
    np.testing.assert_array_equal(recording.position, np.mod(true, 5100.0))
    recording, notes = io.read_with_notes(path, period={"position": 5100})
    np.testing.assert_array_equal(recording.position, true)
    recording = io.read(path, period={"position": 5100}, scale={"position": 0.5}, repair=False)
    np.testing.assert_array_equal(recording.position, 0.5 * true)
    with pytest.raises(ValueError, match=r"goes over 50.., more than the stated period of 360"):
        io.read(path, period={"position": 360})
    with pytest.raises(ValueError, match="period names 'force'"):
        io.read(path, period={"force": 360})


FILTERS = {
    "first order": lambda w: _first_order(w, 0.3),
    "mean of 6": lambda w: np.convolve(np.pad(w, 6, "edge"), np.ones(6) / 6, "same")[6:-6],
    "both ways": lambda w: _first_order(_first_order(w, 0.4)[::-1], 0.4)[::-1],
}


def _first_order(signal, share):
    weights = share * (1 - share) ** np.arange(200)
    return np.convolve(np.pad(signal, (199, 0), "edge"), weights / weights.sum(), "valid")


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("turn", [2 * np.pi, 360.0])
def test_a_filtered_seam_is_told_and_masked(kind, turn):
    t = np.arange(8000) / 1000
    turns = 2 * np.sin(2 * t) + 0.3 * t
    speed = np.gradient(turns, t)
    noise = np.random.default_rng(1).normal(size=t.size)
    force = 10 * np.sign(speed) + 2 * np.gradient(speed, t) + 0.1 * noise
    tidy = put_in_order(t, FILTERS[kind](np.mod(turns, 1) * turn), force)
    assert FILTERED_SEAM in tidy.notes[0] and "masked there" in tidy.notes[0]
    assert len(tidy.notes) == 1
    seams = np.abs(np.diff(np.floor(turns))) > 0
    assert not tidy.mask[1:-300][seams[:-300]].any()  # at the end no motion after it is seen
    assert tidy.mask.mean() > 0.8
    inside = tidy.mask[1:] & tidy.mask[:-1] & (np.diff(tidy.segment) == 0)
    derived = np.diff(tidy.signals["position"]) / np.diff(t)
    assert np.max(np.abs(derived - turn * speed[1:])[inside][300:-300]) < 0.3 * turn


def test_an_axis_that_flies_back_by_its_force_is_no_filtered_seam():
    """A quick return, sampled coarsely: the force says that it is one."""
    share = np.arange(6000) / 300 % 1
    speed = np.where(share < 0.95, 1.0, -19.0)
    speed = np.convolve(speed, np.ones(5) / 5, "same")
    t = np.arange(6000) / 1000
    x = np.cumsum(speed) / 1000
    force = 10 * np.sign(speed) + 5 * speed
    for velocity in (None, speed):
        tidy = put_in_order(t, x, force, velocity)
        assert tidy.notes == [] and tidy.mask.all()


# ---- clocks ----


def axis(at, quantum=1e-6):
    return np.round((0.05 * np.sin(7 * at) + 0.02 * np.sin(19 * at)) / quantum) * quantum


@settings(max_examples=40)
@given(
    rate=st.floats(150.0, 20_000.0),
    start=st.sampled_from([0.0, 12.3456, 1.7e9]),
    down=st.booleans(),
    lost=st.lists(st.integers(700, 3300), max_size=2, unique=True),
)
def test_rounded_stamps_of_a_steady_clock_keep_every_sample(rate, start, down, lost):
    true = np.delete(np.arange(4000) / rate, sorted(lost))
    stamps = (np.floor if down else np.round)((start + true) * 1e3) / 1e3
    tidy = put_in_order(stamps, axis(true))
    assert len(tidy.mask) == len(true)
    steps = np.diff(tidy.signals["time"]) * rate
    away = np.abs(steps - np.diff(true) * rate)
    # A line through stamps that are rounded to several steps cannot say where few rows are lost.
    near = np.zeros(len(away), bool)
    for row in lost:
        near[max(row - 300, 0) : row + 300] = True
    assert np.max(away[~near]) < 0.02
    assert "moves them by up to" in " ".join(tidy.notes) or np.allclose(stamps, start + true)


def test_stamps_that_are_rounded_to_many_samples_are_a_warning():
    """Between two of them the clock may have stopped and caught up."""
    true = np.arange(30_000) / 100
    tidy = put_in_order(np.floor(true), axis(true))
    assert np.max(np.abs(np.diff(tidy.signals["time"]) * 100 - 1)) < 0.01
    assert tidy.notes[0].startswith("Warning: The time stamps are rounded")
    assert "That is 50 samples" in tidy.notes[0] and "more digits" in tidy.notes[0]
    tidy = put_in_order(np.floor(true * 50) / 50, axis(true))
    assert tidy.notes[0].startswith("The time stamps are rounded")


def test_stamps_whose_digit_tells_no_rate_are_refused():
    """Written with nine digits since 1970: 51 s in steps of 10 s, a rate within 5 %."""
    true = 1.7e9 + np.arange(4887) / 100
    with pytest.raises(ValueError, match="time does not increase at .* with more digits"):
        put_in_order(np.round(true, -1), axis(true - 1.7e9))


@settings(max_examples=30)
@given(
    kind=st.sampled_from(["normal", "uniform", "exponential"]),
    scatter=st.floats(0.02, 0.35),
    lost=st.lists(st.integers(500, 3500), max_size=3, unique=True),
    seed=st.integers(0, 1000),
)
def test_stamps_written_late_keep_every_sample(kind, scatter, lost, seed):
    draw = np.random.default_rng(seed)
    true = np.delete(np.arange(4000) / 1250, sorted(lost))
    late = {
        "normal": lambda n: draw.normal(size=n),
        "uniform": lambda n: draw.uniform(-1.73, 1.73, n),
        "exponential": lambda n: draw.exponential(size=n),
    }[kind](len(true))
    tidy = put_in_order(true + scatter / 1250 * late, axis(true))
    assert len(tidy.mask) == len(true)
    steps = np.diff(tidy.signals["time"]) * 1250
    assert np.mean(np.abs(steps - np.diff(true) * 1250)) < 0.02
    assert "scatter by" in tidy.notes[0] and "moves them by up to" in tidy.notes[0]
    # Rows lost close together are not placed to the row; there a segment may begin.
    assert len(tidy.notes) == 1 or (lost and not tidy.notes[1].startswith("Warning"))


@settings(max_examples=20)
@given(scatter=st.floats(0.02, 0.45), walk=st.booleans(), seed=st.integers(0, 1000))
def test_samples_taken_when_the_stamps_say_stay(scatter, walk, seed):
    draw = np.random.default_rng(seed).uniform(-1, 1, 4000)
    steps = np.cumsum(1 + scatter * draw) if walk else np.arange(4000) + scatter * draw
    tidy = put_in_order(steps / 1250, axis(steps / 1250))
    np.testing.assert_array_equal(tidy.signals["time"], steps / 1250)
    assert tidy.notes == []


@pytest.mark.parametrize("unit, factor", [("ms", 1e3), ("µs", 1e6), ("ns", 1e9)])
@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_stamps_since_1970_are_told_by_their_size(tmp_path, unit, factor, suffix):
    t = np.arange(400) * 2e-3
    stamps = np.rint((1_700_000_000 + t) * 1e3).astype(np.int64) * round(factor / 1e3)
    path = write(tmp_path / f"log{suffix}", time=stamps, position=axis(t), force=np.cos(t))
    recording, notes = io.read_with_notes(path)
    np.testing.assert_allclose(recording.time, t, rtol=0, atol=2e-7)  # text of ns is a double
    assert f"are {unit} since 1970 (from 2023-11-14" in notes[0]
    seconds = write(tmp_path / "s.npz", time=1.7e9 + t, position=axis(t), force=np.cos(t))
    assert "since 1970" not in " ".join(io.read_with_notes(seconds)[1])


def test_whole_stamps_far_apart_are_hardly_seconds(tmp_path):
    t = np.arange(400.0)
    columns = {"position": axis(t / 500), "force": np.cos(t)}
    _, notes = io.read_with_notes(write(tmp_path / "a.csv", time=t, **columns))
    assert "--scale time=0.001" in notes[0]
    _, notes = io.read_with_notes(write(tmp_path / "b.csv", **{"time [s]": t}, **columns))
    assert notes == []
    _, notes = io.read_with_notes(tmp_path / "a.csv", scale={"time": 0.001})
    assert notes == []


# ---- lost rows ----


@settings(max_examples=30)
@given(
    lost=st.sampled_from([20, 100, 500]),
    at=st.integers(1000, 5000),
    counts=st.floats(1e3, 1e6),
    phase=st.floats(0.0, 6.0),
)
def test_rows_lost_while_the_clock_counts_on_begin_a_segment(lost, at, counts, phase):
    t = np.arange(8000) / 1000
    x = np.sin(2.1 * t + phase) + 0.3 * np.sin(5.3 * t)
    x = np.round(x * counts) / counts
    gone = np.r_[at : at + lost]
    seen = np.delete(x, gone)
    tidy = put_in_order(t[: len(seen)], seen)
    begun = np.flatnonzero(np.diff(tidy.segment)) + 1
    usual = np.max(np.abs(np.diff(x)))
    if abs(seen[at] - seen[at - 1]) > 5 * usual:
        np.testing.assert_array_equal(begun, [at])
        assert MISSING_ROWS in tidy.notes[-1] and f"first at row {at + 2}" in tidy.notes[-1]
    else:
        assert len(begun) == 0 or list(begun) == [at]


@settings(max_examples=60)
@given(data=st.data())
def test_healthy_motion_is_left_alone(data):
    """Multisines, trapezoids and chirps at any rate, noise and encoder: no note, no change."""
    draw = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    rate = 10 ** data.draw(st.floats(1.3, 4.7))
    t = np.arange(int(10 ** data.draw(st.floats(2.4, 4.2)))) / rate
    kind = data.draw(st.sampled_from(["multisine", "trapezoid", "chirp"]))
    if kind == "multisine":
        rates = np.exp(draw.uniform(np.log(1 / t[-1]), np.log(min(rate / 8, 200)), 5))
        x = sum(np.sin(2 * np.pi * f * t + draw.uniform(0, 6)) / f for f in rates)
    elif kind == "trapezoid":
        x = stroke("trapezoid", int(draw.integers(1, 12)), 1.0, t.size, 1e9)
    else:
        x = np.sin(np.pi * min(rate / 10, draw.uniform(1, 100)) * t**2 / t[-1])
    quantum = np.ptp(x) / 10 ** data.draw(st.floats(1.0, 6.0))
    if data.draw(st.booleans()):
        x = x + quantum * draw.normal(size=t.size)
    if data.draw(st.booleans()):
        x = np.round(x / quantum) * quantum
    x = x * 10 ** data.draw(st.floats(-6, 6))
    tidy = put_in_order(t, x, draw.normal(size=t.size))
    assert tidy.notes == [] and tidy.mask.all() and not tidy.segment.any()
    np.testing.assert_array_equal(tidy.signals["position"], x)
    np.testing.assert_array_equal(tidy.signals["time"], t)


@pytest.mark.parametrize(
    "name", ["delta_servo/Jm_1", "odrive/spinup_uncompensated", "ur10e/joint_1"]
)
def test_real_recordings_need_no_repair_at_any_rate(data_folder, name):
    recording = io.read(data_folder / f"{name}.csv")
    signals = {n: np.asarray(getattr(recording, n)) for n in ("time", "force", "position")}
    for every in (1, 2, 3, 5, 8, 13, 21, 34, 50):
        some = {n: signal[::every].copy() for n, signal in signals.items()}
        segment = np.asarray(recording.segment)[::every]
        assert clean(some, segment, np.arange(len(segment)), name).notes == [], every


# ---- no repair ----


def test_without_repair_all_stays_as_it_is(tmp_path):
    t = np.arange(3000) / 1000
    draw = np.random.default_rng(1)
    stamps = t + 0.2e-3 * draw.uniform(-1, 1, t.size)
    x = np.mod(3 * t + 2 * np.sin(2 * t), 2 * np.pi)
    path = write(tmp_path / "log.csv", time=stamps, position=x, force=np.cos(t))
    repaired, notes = io.read_with_notes(path)
    assert len(notes) == 2
    assert float(np.max(np.abs(repaired.position - x))) > 6
    recording, notes = io.read_with_notes(path, repair=False)
    assert notes == [] and bool(recording.mask.all()) and recording.num_segments == 1
    np.testing.assert_array_equal(recording.time, stamps)
    np.testing.assert_array_equal(recording.position, x)


def test_without_repair_what_cannot_be_computed_with_is_masked_or_refused(tmp_path):
    t = np.arange(300) / 1000
    force = np.where(np.arange(300) == 7, np.nan, np.cos(t))
    stamps = np.where(np.arange(300) == 50, np.nan, t)
    path = write(tmp_path / "log.csv", time=stamps, position=np.sin(t), force=force)
    recording, notes = io.read_with_notes(path, repair=False)
    np.testing.assert_array_equal(np.flatnonzero(~np.asarray(recording.mask)), [7, 50])
    assert recording.num_samples == 300 and len(notes) == 2
    stamps = np.where(np.arange(300) == 60, t[58], t)
    path = write(tmp_path / "back.csv", time=stamps, position=np.sin(t), force=force)
    with pytest.raises(ValueError, match=r"back\.csv: row 62: time does not increase"):
        io.read(path, repair=False)
    assert io.read(path).num_samples == 299


# ---- a position at another rate ----


@pytest.mark.parametrize("every", [2, 5])
def test_a_position_that_is_held_between_updates_is_a_curve_through_them(every):
    t = np.arange(4000) / 1000
    x = np.round(np.sin(3 * t) + 0.3 * np.sin(8 * t), 6)
    held = x[np.arange(x.size) // every * every]
    tidy = put_in_order(t, held)
    assert any(f"new at every {every} samples" in text for text in tidy.notes)
    assert tidy.position_every == every
    inside = slice(None, -every)
    off = np.abs(tidy.signals["position"] - x)[inside]
    assert np.max(off) < 2e-6 and np.max(np.abs(held - x)) > 1e-3  # of six digits
    np.testing.assert_array_equal(tidy.signals["position"][::every], held[::every])


def test_a_coarse_encoder_or_a_rest_holds_no_position():
    t = np.arange(4000) / 1000
    for x in (np.round(np.sin(3 * t), 2), np.clip(np.sin(3 * t), -0.5, 0.5), np.zeros_like(t)):
        tidy = put_in_order(t, x)
        np.testing.assert_array_equal(tidy.signals["position"], x)
        assert not any("straight" in text for text in tidy.notes)


# ---- lone samples ----


@settings(max_examples=60)
@given(
    role=st.sampled_from(["force", "position", "velocity"]),
    count=st.integers(1, 3),
    start=st.integers(20, 3970),
    size=st.floats(0.3, 50.0),
    sign=st.sampled_from([1.0, -1.0]),
    unit=st.sampled_from([1e-6, 1.0, 1e3]),
)
def test_lone_samples_that_nothing_made_are_masked(role, count, start, size, sign, unit):
    """A misread encoder or a bit of the bus: far from the others, and back within three samples."""
    t = np.arange(4000) / 1000
    noise = 1e-5 * np.random.default_rng(3).normal(size=(3, t.size))
    truth = {
        "force": unit * (np.sign(np.cos(7 * t)) + np.cos(3 * t) + noise[0]),
        "position": unit * (np.sin(7 * t) + noise[1]),
        "velocity": unit * (7 * np.cos(7 * t) + noise[2]),
    }
    truth["time"] = t
    spoilt = {name: values.copy() for name, values in truth.items()}
    bad = slice(start, start + count)
    far = size * np.ptp(truth[role]) if role == "position" else (20 + size) * np.ptp(truth[role])
    spoilt[role][bad] += sign * far
    tidy = clean(spoilt, None, np.arange(t.size) + 2, "log")
    assert np.flatnonzero(~tidy.mask).tolist() == list(range(start, start + count))
    (note,) = tidy.notes
    assert f"with a {role} far from all others" in note and f"row {start + 2})" in note
    # Filled by a straight line; of the force nobody can say how it went.
    if role != "force":
        off = np.abs(tidy.signals[role] - truth[role])[bad]
        assert np.max(off) < 1e-3 * np.ptp(truth[role])


@pytest.mark.parametrize("kind", ["hit", "wrap", "seam", "lost rows", "push", "stairs"])
def test_what_a_machine_does_is_no_lone_sample(kind):
    """A blow that turns the velocity over, a step that stays, a push of four samples, a count."""
    t = np.arange(4000) / 1000
    x = np.sin(7 * t) + 1e-6 * np.random.default_rng(4).normal(size=t.size)
    force, velocity = np.sign(np.cos(7 * t)), 7 * np.cos(7 * t)
    if kind == "hit":
        x[2000:] -= 9.0 * (t[2000:] - t[2000])
        velocity[2000:] -= 9.0
    elif kind == "wrap":
        x = np.mod(3 * x, 2 * np.pi)
    elif kind == "seam":  # at rest there, three counts of noise across it
        x[2000:] = x[2000]
        x[2500::700] += 1e-4
        x = np.mod(x - x[2000] - 5e-5, 2.0)
    elif kind == "lost rows":
        x[2000:] += 0.4
    elif kind == "push":
        force[2000:2004] += 30.0
    else:
        x = np.round(x, 2)
    assert "far from all others" not in " ".join(put_in_order(t, x, force, velocity).notes)


def test_lone_samples_stay_on_request_and_are_said(tmp_path):
    t = np.arange(4000) / 1000
    force = 5 * np.sign(np.cos(7 * t)) + 0.01 * np.random.default_rng(5).normal(size=t.size)
    force[700] = 1e6
    path = write(tmp_path / "log.csv", time=t, position=np.sin(7 * t), force=force)
    recording, notes = io.read_with_notes(path)
    assert not recording.mask[700] and np.count_nonzero(~recording.mask) == 1
    assert "1e+06" in notes[0] and not [r for r in checks.inspect(recording) if "lone" in r.text]
    untouched = io.read(path, repair=False)
    assert untouched.mask.all() and float(untouched.force[700]) == 1e6
    assert "force_spikes" in [remark.name for remark in checks.inspect(untouched)]
