"""Healthy axes with a coarse encoder, whose controller answers every count of it."""

import types

import numpy as np
import pytest

import jaxfric as jf
from jaxfric.explanation import acceptance, structure
from jaxfric.explanation.locate import Structure
from jaxfric.explanation.motion import motion_of
from jaxfric.explanation.problem import problem_of


def controlled(seed: int, bits: int, rates, ways, duration: float):
    """An axis of 0.02 kg m² with dry and viscous friction under PD control at 500 Hz."""
    draw, cycle, parts = np.random.default_rng(seed), 2e-3, 10
    time = np.arange(int(duration / cycle)) * cycle
    phase = draw.uniform(0, 2 * np.pi, len(rates))
    wave = sum(
        a * np.sin(2 * np.pi * f * time + p) for a, f, p in zip(ways, rates, phase, strict=True)
    )
    part = np.clip(time / 0.6, 0, 1)
    asked = part**3 * (10 - 15 * part + 6 * part**2) * (wave - wave[0])
    speed = np.gradient(asked, cycle)
    ahead = 0.02 * np.gradient(speed, cycle) + 0.3 * np.sign(speed)
    count, step = 2 * np.pi / 2**bits, cycle / parts
    place = rate = filtered = last = 0.0
    force, seen = np.empty(len(time)), np.empty(len(time))
    for i in range(len(time)):
        counted = count * np.floor(place / count + 0.5)
        filtered += ((counted - last) / cycle - filtered) / 7
        last = seen[i] = counted
        u = force[i] = 3 * (asked[i] - counted) + 0.3 * (speed[i] - filtered) + ahead[i]
        for _ in range(parts):
            free = rate + step * (u - 0.01 * rate) / 0.02
            rate = np.sign(free) * max(abs(free) - step * 0.34 / 0.02, 0.0)
            place += step * rate
    force += 0.02 * np.sqrt(np.mean(force**2)) * draw.normal(size=len(time))
    return jf.Recording(time, np.round(force, 4), np.round(seen, 5))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1])
def test_nothing_is_missing_where_a_loop_answers_its_counts_in_a_motion_that_repeats(seed):
    """Tones, cogging and structure were at multiples of the motion's frequency, 0.1 Hz."""
    here = controlled(seed, 10, (0.2, 0.7, 1.6), (6, 1.3, 0.3), 40.0)
    there = controlled(seed + 10, 10, (0.23, 0.6, 1.9), (6, 1.3, 0.3), 30.0)
    found = jf.explain(here, "coulomb-viscous", there)
    assert found.verdict == "consistent" and not found.findings


def test_structure_that_is_no_more_than_noise_is_no_reason_for_a_verdict():
    """Rows that scatter by 1 N, and 0.4 N of structure; the force error says which counts."""
    rows = np.random.default_rng(0).normal(size=2000)
    current = types.SimpleNamespace(residual=rows)
    small, large = (Structure("position", 0.2, size, 0.002, np.nan, ()) for size in (0.4, 1.2))
    counts = structure.that_matter([small, large], current, 20.0, 0.0)
    assert counts == [large]  # beside samples that scatter by 20 N it is 0.02 % of their power
    assert structure.that_matter([small], current, 2.0, 0.3) == [small]
    # What answers the counts is larger than the one and smaller than the other.
    assert structure.that_matter([small, large], current, 2.0, 0.5) == [large]


def test_a_law_that_is_smaller_where_the_velocity_is_smoothed_over_less_is_of_smoothing(
    monkeypatch,
):
    """Of a motion through a wide polynomial and a narrow one: what is two thirds as much goes."""
    shares = {"as large": 1.0, "two thirds": 0.66, "a fifth": 0.2}

    def alike(finalist, current, rows, factor, least, given):
        return 1 / factor < shares[rows] < factor

    monkeypatch.setattr(acceptance, "_alike", alike)
    assert not acceptance.of_smoothing(None, None, None)
    assert not acceptance.of_smoothing(None, None, "as large")
    assert acceptance.of_smoothing(None, None, "two thirds")
    assert acceptance.of_smoothing(None, None, "a fifth")


def test_rows_are_rougher_where_the_velocity_is_smoothed_over_more_than_the_kernel():
    coarse, fine = (
        controlled(1, 8, (0.2, 0.7), (6, 1.3), 20.0),
        controlled(1, 18, (0.2, 0.7), (6, 1.3), 20.0),
    )
    model = jf.models.named("coulomb-viscous")
    rows = problem_of(coarse, model)
    rougher = rows.rougher()
    assert rougher is not None and rougher.width == rows.evidence.width
    assert motion_of(coarse).polynomial > rows.evidence.width
    assert problem_of(fine, model).rougher() is None


def jogged(seed: int, bits: int):
    """A motor under a PI speed loop that answers its counts, jogged at many speeds."""
    draw, cycle, parts = np.random.default_rng(seed), 1e-3, 4
    speeds = np.concatenate([np.full(700, v) for v in draw.uniform(-11, 11, 40)])
    asked = np.convolve(speeds, np.ones(120) / 120, "same")
    count, inertia = 2 * np.pi / 2**bits, 4e-3
    place = rate = filtered = last = total = 0.0
    force, seen = np.empty(len(asked)), np.empty(len(asked))
    for i in range(len(asked)):
        counted = count * np.floor(place / count + 0.5)
        filtered += 0.05 * ((counted - last) / cycle - filtered)
        last = seen[i] = counted
        total += 1.5 * (asked[i] - filtered) * cycle
        u = force[i] = 0.1 * (asked[i] - filtered) + total
        for _ in range(parts):
            free = rate + cycle / parts * (u - 0.004 * rate) / inertia
            rate = np.sign(free) * max(abs(free) - cycle / parts * 0.08 / inertia, 0.0)
            place += cycle / parts * rate
    time = np.arange(len(asked)) * cycle
    noise = 0.005 * np.sqrt(np.mean(force**2)) * draw.normal(size=len(time))
    return jf.Recording(time, np.round(force + noise, 5), np.round(seen, 4))


@pytest.mark.slow
@pytest.mark.parametrize("bits", [8])
def test_what_smoothing_takes_off_a_coarse_velocity_is_no_load_on_a_spring(bits):
    """It was a compliance "at a frequency that this recording cannot tell"."""
    found = jf.explain(jogged(1, bits), "coulomb-viscous", jogged(2, bits))
    assert found.verdict == "consistent" and not found.findings
