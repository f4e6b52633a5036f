"""A motion that repeats to a count of the encoder: what that makes of a test of significance."""

import types

import numpy as np
import pytest

import jaxfric as jf
from jaxfric.explanation import significance
from jaxfric.explanation.repeats import repeated_after
from jaxfric.explanation.significance import BlockBootstrap, evenly
from jaxfric.explanation.spectral_lines import OVERSAMPLING, standing_out


def recording(period: float, counts: float = 1e-3, noise: float = 0.0, rate: float = 250.0):
    """40 s of two sines whose sum repeats after a period, s; the position is counted, m."""
    time = np.arange(int(40 * rate)) / rate
    ramp = np.clip(time / 0.6, 0, 1)
    place = ramp * (np.sin(4 * np.pi * time / period) + 0.2 * np.sin(14 * np.pi * time / period))
    place += noise * np.random.default_rng(0).normal(size=len(time))
    return jf.Recording(time, np.zeros(len(time)), counts * np.round(place / counts))


def test_the_period_of_a_motion_is_found_where_its_counts_repeat():
    """Beside a start from rest; not where it differs by more than a count."""
    for counts in (1e-2, 1e-3, 1e-4):
        assert repeated_after(recording(10.0, counts)) == pytest.approx(10.0)
    assert repeated_after(recording(10.0, noise=0.01)) == 0.0
    assert repeated_after(recording(25.0)) == 0.0  # less than twice
    assert repeated_after(recording(10.0 + 0.3 / 250)) == 0.0  # between two samples
    still = jf.Recording(np.arange(100) / 250, np.zeros(100), np.zeros(100))
    assert repeated_after(still) == 0.0


def test_a_slow_axis_in_one_count_for_many_samples_does_not_repeat():
    time = np.arange(10000) / 1000
    toggles = np.random.default_rng(0).integers(0, 2, len(time))
    for place in (np.round(20 * time), np.round(20 * time) + toggles):
        assert repeated_after(jf.Recording(time, np.zeros(len(time)), 1e-3 * place)) == 0.0


def rows(period: float):
    """Rows of 40 s at a half of a half-width of 0.1 s."""
    elapsed = np.arange(0.0, 40.0, 0.05)
    return types.SimpleNamespace(
        elapsed=elapsed, centre=np.arange(len(elapsed)), reach=0.1, repeats=period
    )


def test_blocks_that_see_the_same_motion_are_one():
    evidence = rows(10.0)
    block = significance.witnesses(evidence)
    assert np.array_equal(block[:200], block[200:400]) and np.array_equal(block[:200], block[600:])
    assert significance.FEWEST <= block.max() + 1 <= 13
    for period in (0.0, 3.0):  # never, or too soon for as many blocks as a test needs
        block = significance.witnesses(rows(period))
        assert np.array_equal(block, significance.blocks(evidence.elapsed, 0.1))


def test_noise_that_repeats_with_the_motion_is_no_line():
    """Flipped by blocks alone, the draws lack its lines: a wave is found in most."""
    evidence, found = rows(10.0), []
    waves = 2 * np.pi * np.linspace(0.1, 9.0, 357)[:, None] * evidence.elapsed
    columns = np.stack([np.sin(waves), np.cos(waves)], axis=1).astype(np.float32)
    basis = np.linalg.qr(np.ones((800, 1)))[0]
    for seed in range(20):
        noise = np.tile(np.random.default_rng(seed).normal(size=200), 4)
        fit = types.SimpleNamespace(basis=lambda: basis, residual=noise)
        each = []
        for block in (evenly(800, 24), significance.witnesses(evidence)):
            scan = BlockBootstrap(fit, block)(columns)
            each.append(np.mean(scan.drawn >= scan.gain.max()) < 0.01)
        found.append(each)
    alone, together = np.mean(found, axis=0)
    assert alone > 0.5 and together <= 0.1


def test_a_tone_beside_noise_that_repeats_stands_out_still():
    time = np.arange(4000) / 100.0
    draw = np.random.default_rng(1)
    found, plain = [], []
    for size in (0.0, 0.5):
        for tone in (17.1, 17.1125):  # a multiple of the motion's frequency, and none
            series = np.tile(draw.normal(size=1000), 4) + 0.3 * draw.normal(size=4000)
            series += size * np.sin(2 * np.pi * tone * time)
            power = np.abs(np.fft.rfft(series, OVERSAMPLING * 4000)) ** 2
            tones = np.fft.rfftfreq(OVERSAMPLING * 4000, 0.01)
            best = standing_out(tones, power, 5.0, 10.0)
            found.append(best is not None and abs(tones[best] - tone) < 0.02)
            plain.append(standing_out(tones, power, 5.0) is not None)
    assert plain[0] and plain[1]  # lines of the motion, taken for tones
    assert found == [False, False, True, True]
