"""Memory by the row: long recordings are read and fitted in bounded memory."""

import dataclasses
import subprocess
import sys
import tracemalloc

import jax
import numpy as np
import pytest

import jaxfric as jf
from jaxfric import signals
from jaxfric.data import writing
from jaxfric.data.excerpt import MOST, PIECES, excerpt
from jaxfric.data.recording import pad
from jaxfric.models import from_parameters
from jaxfric.signals import HALF_WIDTHS, derivatives
from jaxfric.simulation import errors, prediction


def written(path, count):
    """An axis that moves to and fro under Coulomb and viscous friction, with noise and counts."""
    time = np.arange(count) * 1e-3
    turn = 2 * np.pi * 0.31
    velocity = 0.03 * turn * np.cos(turn * time)
    noise = 0.5 * np.random.default_rng(0).normal(size=count)
    force = -5 * 0.03 * turn**2 * np.sin(turn * time) + 20 * np.sign(velocity) + 60 * velocity
    position = np.round(0.03 * np.sin(turn * time), 6)
    np.savez(path, time=time, position=position, force=force + noise)
    return path


def test_an_excerpt_is_spread_over_the_recording_and_begins_segments():
    count = 2 * MOST
    values = np.arange(count, dtype=float)
    recording = jf.Recording(time=values, force=values, velocity=values)
    some = excerpt(recording)
    assert some.num_samples == MOST and some.num_segments == PIECES
    time, segment = np.asarray(some.time), np.asarray(some.segment)
    assert time[0] == 0 and time[-1] == count - 1
    within = np.diff(segment) == 0
    assert np.all(np.diff(time)[within] == 1) and np.all(np.diff(time)[~within] > 1)
    # Masked samples at the end, by which recordings are padded, are no part of it.
    longer = pad(recording, count + 4096)
    np.testing.assert_array_equal(np.asarray(excerpt(longer).time), time)


@pytest.mark.parametrize("count", [MOST + 1000, int(1.5 * MOST) + 2])
def test_samples_at_the_end_that_are_not_valid_do_not_matter_to_a_long_recording(count):
    time = 1e-3 * np.arange(count)
    position = np.round(0.03 * np.sin(4 * time), 6)
    late = 0.12 * np.cos(4 * (time - 0.004))
    mask = time < time[int(1.2 * MOST) if count > 1.5 * MOST else -1]
    recording = jf.Recording(
        time=time, force=np.sign(late), position=position, velocity=late, mask=mask
    )
    assert excerpt(recording) is recording
    less = jax.tree.map(lambda values: np.asarray(values)[mask], recording)
    assert signals.choose(recording) == signals.choose(less)
    velocity = np.asarray(signals.Ready.of(recording).recording.velocity)
    assert len(velocity) == count
    inside = slice(1000, np.count_nonzero(mask) - 1000)
    np.testing.assert_allclose(velocity[inside], 0.12 * np.cos(4 * time[inside]), atol=5e-4)


def test_a_recording_without_samples_is_whole():
    none = np.zeros(0)
    recording = jf.Recording(time=none, force=none, velocity=none)
    assert excerpt(recording) is recording
    with pytest.raises(ValueError):
        jf.identify(jf.models.gaussian(), recording)


def test_a_recording_of_usual_length_is_whole():
    recording = jf.Recording(time=np.arange(MOST), force=np.zeros(MOST), velocity=np.zeros(MOST))
    assert excerpt(recording) is recording


@pytest.mark.parametrize("half_width", [16, 400])
def test_a_derivative_in_pieces_is_that_of_the_whole(tmp_path, monkeypatch, half_width):
    recording = jf.read(written(tmp_path / "log.npz", 20_000))
    mask = np.asarray(recording.mask).copy()
    mask[5000:5100] = False
    recording = dataclasses.replace(recording, mask=mask)
    position = np.asarray(recording.position)
    whole = derivatives.derivative(recording, position, half_width)
    monkeypatch.setattr(derivatives, "MOST", 3000)
    pieces = derivatives.derivative(recording, position, half_width)
    np.testing.assert_allclose(pieces, whole, rtol=1e-9, atol=1e-12)


def broken(recording):
    """The same with invalid samples, and a segment that begins at one that no piece begins at."""
    mask, segment = np.asarray(recording.mask).copy(), np.zeros(recording.num_samples, np.int32)
    mask[5000:5100], segment[13_001:] = False, 1
    return dataclasses.replace(recording, mask=mask, segment=segment, num_segments=2)


@pytest.mark.slow
@pytest.mark.parametrize("delay", [None, 0.0123])
@pytest.mark.parametrize("ripple", [0.0, 1e-3])
def test_force_and_force_error_in_pieces_are_those_of_the_whole(
    tmp_path, monkeypatch, ripple, delay
):
    """Without a ripple the derivative reaches so far that samples are averaged in blocks first."""
    recording = broken(jf.read(written(tmp_path / "log.npz", 60_000)))
    more = ripple * np.sin(2 * np.pi * 7 * np.asarray(recording.time))
    recording = dataclasses.replace(recording, position=np.asarray(recording.position) + more)
    names = {"coulomb": 20.0, "viscous": 60.0, "stribeck_force": 3.0, "stribeck_velocity": 0.01}
    values = {name + sign: v for name, v in names.items() for sign in "+-"} | {"inertia": 5.0}
    model = from_parameters(jf.models.gaussian(), values)
    model = dataclasses.replace(model, force_delay=delay)
    width = signals.choose(recording).half_width
    assert (width > HALF_WIDTHS[-1]) == (ripple == 0)
    whole, error = np.asarray(jf.predict(model, recording)), errors.force_error(model, recording)
    moving = errors.in_motion(recording, delay or 0.0)
    for module in (prediction, errors):
        monkeypatch.setattr(module, "MOST", 6000)
    monkeypatch.setattr(prediction, "BLOCK", 8192)
    pieces = np.asarray(jf.predict(model, recording))
    np.testing.assert_allclose(pieces, whole, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(errors.in_motion(recording, delay or 0.0), moving)
    np.testing.assert_allclose(errors.force_error(model, recording), error, rtol=1e-9)


def traced(path):
    tracemalloc.start()
    jf.read(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


@pytest.mark.slow
def test_reading_takes_less_than_ten_columns(tmp_path):
    """Three columns of eight bytes are read: of each row 24 bytes stay, and 80 are held at once."""
    small, large = (written(tmp_path / f"{n}.npz", n) for n in (500_000, 2_000_000))
    assert (traced(large) - traced(small)) / 1_500_000 < 80


def resident(*arguments):
    """The largest resident memory of a command, bytes."""
    code = (
        "import resource, sys; from jaxfric.cli import main; code = main();"
        "print(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss); sys.exit(code)"
    )
    run = [sys.executable, "-c", code, *map(str, arguments)]
    done = subprocess.run(run, capture_output=True, text=True, check=True)
    return int(done.stdout.split()[-1])


@pytest.mark.slow
def test_identify_takes_sixty_bytes_by_the_row(tmp_path):
    """Of the rows beyond those that are fitted; it was 900."""
    small, large = (written(tmp_path / f"{n}.npz", n) for n in (500_000, 2_500_000))
    assert (resident("identify", large) - resident("identify", small)) / 2_000_000 < 60


def test_a_table_written_in_parts_is_whole(tmp_path, monkeypatch):
    columns = {"a": np.arange(10.0) / 7, "b": np.arange(10)}
    whole = writing.csv_text(columns)
    monkeypatch.setattr(writing, "ROWS", 3)
    writing.write_table(tmp_path / "table.csv", columns)
    assert (tmp_path / "table.csv").read_text() == whole
    assert whole.splitlines()[0] == "a,b" and len(whole.splitlines()) == 11
