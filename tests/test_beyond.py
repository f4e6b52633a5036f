"""Tones: many cycles to a record, and faster than the rows of the weak form show."""

import jax
import numpy as np
import pytest

import jaxfric as jf
from jaxfric.explanation.beyond import Samples, half_width, matters, tone_beyond, without
from jaxfric.explanation.evidence import gather


def axis(tone: float, size: float, seed: int = 1, duration: float = 30.0):
    """An axis of 2 kg at 1 kHz with a tone, Hz and N, in its force."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 1e-3)
    ways, rates = (0.04, 0.013), (2 * np.pi * 0.7, 2 * np.pi * 1.9)
    position = sum(a * np.sin(w * time) for a, w in zip(ways, rates, strict=True))
    velocity = sum(a * w * np.cos(w * time) for a, w in zip(ways, rates, strict=True))
    gain = -sum(a * w**2 * np.sin(w * time) for a, w in zip(ways, rates, strict=True))
    force = 2 * gain + 20 * np.sign(velocity) + 60 * velocity
    force += size * np.sin(2 * np.pi * tone * time + seed) + 0.2 * rng.normal(size=len(time))
    return jf.Recording(time, force, position)


@pytest.mark.slow
@pytest.mark.parametrize("tone", [0.9, 19.03, 35.0, 50.0])
def test_one_tone_is_one_finding_however_many_cycles_it_has(tone):
    """The derivative by the frequency took a step of two radians at the end of the record."""
    told = jf.explain(axis(tone, 7.0), "coulomb-viscous", axis(tone, 7.0, 2))
    (finding,) = told.findings
    assert finding.effect == "periodic_disturbance" and told.verdict == "explained"
    frequency, size = (finding.parameters[name] for name in ("frequency", "amplitude"))
    assert abs(float(frequency.value) - tone) < max(float(frequency.half_width()), 1e-4 * tone)
    assert float(size.value) == pytest.approx(7.0, rel=0.03)
    assert float(size.half_width()) < 0.05 * 7.0


@pytest.mark.slow
def test_a_tone_that_no_row_shows_is_named_through_a_narrower_kernel():
    told = jf.explain(axis(90.0, 7.0), "coulomb-viscous", axis(90.0, 7.0, 2))
    (finding,) = told.findings
    assert finding.effect == "periodic_disturbance" and told.verdict == "explained"
    assert float(finding.parameters["frequency"].value) == pytest.approx(90.0, abs=1e-3)
    assert float(finding.parameters["amplitude"].value) == pytest.approx(7.0, rel=0.03)


@pytest.mark.slow
def test_a_tone_too_fast_for_any_row_is_said_to_be_left_and_is_no_noise():
    told = jf.explain(axis(300.0, 7.0), "coulomb-viscous", axis(300.0, 7.0, 2))
    assert told.verdict == "unexplained" and not told.findings
    assert "short events" not in told.summary
    assert any("300 Hz" in place["detail"] for place in told.where)
    assert "fast_tone" in [warning["name"] for warning in told.warnings]
    assert told.fit["noise_floor"] < 0.5 * told.fit["force_error"]["after"]


@pytest.mark.slow
def test_a_small_tone_is_a_remark_and_no_verdict():
    """0.3 % of the force, a sixth of the power of what is left: nothing that any effect lacks."""
    told = jf.explain(axis(300.0, 0.13), "coulomb-viscous", axis(300.0, 0.13, 2))
    assert told.verdict == "consistent" and not told.findings and not told.where
    assert "fast_tone" in [warning["name"] for warning in told.warnings]


@pytest.mark.parametrize(
    ("tone", "noise", "verdict"),
    # Of a force of some 30 N: below a tenth and most of the noise or not, and a tenth of the force.
    [(0.3, 1.0, False), (1.0, 1.0, False), (2.0, 1.0, True), (3.0, 10.0, False), (6.0, 10.0, True)],
)
def test_a_verdict_hangs_on_tones_above_the_noise_or_a_tenth_of_the_force(tone, noise, verdict):
    recording = axis(90.0, 0.0)
    time, rng = np.asarray(recording.time), np.random.default_rng(3)
    rest = tone * np.sin(2 * np.pi * 90 * time) + noise * rng.normal(size=len(time))
    with jax.enable_x64(True):
        evidence = gather(recording)
    left = samples(recording, rest)
    assert matters(tone_beyond(left, evidence), left) == verdict


def samples(recording, rest):
    counted = np.ones(len(rest), bool)
    return Samples.of(rest, np.asarray(recording.force), np.asarray(recording.time), counted)


def test_what_rings_after_each_reversal_is_no_tone():
    recording = axis(90.0, 0.0)
    time = np.asarray(recording.time)
    noise = 0.2 * np.random.default_rng(3).normal(size=len(time))
    since = np.mod(time, 0.5)
    ringing = 7 * np.exp(-since / 0.08) * np.sin(2 * np.pi * 90 * since)
    with jax.enable_x64(True):
        evidence = gather(recording)
    assert tone_beyond(samples(recording, noise), evidence) is None
    assert tone_beyond(samples(recording, noise + ringing), evidence) is None
    half = np.where(time < 12, 7 * np.sin(2 * np.pi * 90 * time), 0.0)  # not throughout
    assert tone_beyond(samples(recording, noise + half * (time > 9)), evidence) is None


@pytest.mark.parametrize(("tone", "wide"), [(60.0, 12), (90.0, 6), (160.0, 6), (170.0, None)])
def test_the_kernel_that_shows_a_tone_takes_six_samples_each_way(tone, wide):
    recording = axis(tone, 1.0)
    time, noise = np.asarray(recording.time), np.random.default_rng(3).normal(size=30000)
    rest = np.sin(2 * np.pi * tone * time) + 0.1 * noise
    with jax.enable_x64(True):
        evidence = gather(recording)
    found = tone_beyond(samples(recording, rest), evidence)
    assert found.peak == pytest.approx(tone, abs=0.02)
    assert found.size == pytest.approx(np.sqrt(0.5), rel=0.02)
    assert half_width(found, evidence) == wide
    counted = time > 1
    assert np.std(without(found, rest, time, counted)) < 0.11
