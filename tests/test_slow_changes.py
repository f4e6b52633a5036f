"""What changes slowly along the stroke or over the record is told by how much it changes."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import Recording, terms
from jaxfric.explanation import explain, intervals, parameters, slow_changes
from jaxfric.explanation.regression import Fit
from jaxfric.terms.effect import ANY
from jaxfric.terms.slow import ALONG, OVER_RECORD

from .test_explain import healthy as healthy

STROKE = (-0.1, 0.3)
MIDDLE = 0.1
PLACES = MIDDLE + 0.2 * np.array(list(ALONG.values()))
LIMITS = ANY._replace(low=STROKE[0], high=STROKE[1], duration=20.0)
UNITS = {"force": "N", "position": "m"}


def fitted(laws, noise=0.1):
    """A constant and laws over the position, with their derivatives at 400 places of the stroke."""
    place = np.linspace(*STROKE, 400)
    motion = Recording(jnp.zeros(400), jnp.zeros(400), jnp.asarray(place), jnp.ones(400))
    known = [(terms.Offset(), np.array([3.0]), np.zeros(0)), *laws]
    columns, slopes = [], []
    for term, alpha, beta in known:

        def rows(beta, term=term):
            return np.asarray(term.with_beta(jnp.asarray(beta)).columns(motion))

        columns.append(np.broadcast_to(rows(beta), (400, len(alpha))))
        slopes += [(rows(beta + s) - rows(beta - s)) @ alpha / 2e-5
                   for s in 1e-5 * np.eye(len(beta))]  # fmt: skip
    residual = noise * np.random.default_rng(1).normal(size=400)
    law, alphas, betas = zip(*known, strict=True)
    return Fit(
        law, betas, alphas, np.concatenate(columns, axis=1),
        np.stack(slopes, axis=1) if slopes else np.zeros((400, 0)), residual,
        float(residual @ residual),
    )  # fmt: skip


def curve(current, number):
    known = intervals.spread(current, np.arange(400) // 17)
    return slow_changes.along(current, number, known, UNITS, LIMITS)


# Of six strokes a sine is nearly a parabola.
WAVE = (terms.GravityUnbalance(), np.array([40.0, 25.0]), np.array([2.5]))
STOP = (terms.EndStop(), np.array([60.0]), np.array([0.02]))


def wave(x):
    return 40.0 * np.sin(2 * np.pi * x / 2.5) + 25.0 * np.cos(2 * np.pi * x / 2.5)


def test_the_curve_is_known_where_amplitude_and_period_are_not():
    with jax.enable_x64(True):
        found = parameters.estimates(fitted([WAVE]), np.arange(400) // 17, UNITS, LIMITS)[1]
    truth = wave(PLACES) - wave(MIDDLE)
    assert list(found)[-4:] == list(ALONG) and found["at_low_end"].unit == "N"
    for name, value in zip(ALONG, truth, strict=True):
        assert float(found[name].value) == pytest.approx(value, rel=1e-6)
        assert float(found[name].half_width()) < 0.02 * abs(value)
    amplitude, end = found["amplitude"], found["at_low_end"]
    parts = [float(e.half_width()) / abs(float(e.value)) for e in (amplitude, end)]
    assert parts[0] > 10 * parts[1]


def test_a_load_that_wanders_is_told_by_how_far_it_moves():
    """Its error is what the same noise makes of the range, in the mean of 200 draws."""
    time, law = np.linspace(0.0, 20.0, 400), terms.LoadDrift(0.0, 20.0, 3)
    alpha = np.array([0.7, -0.2, 0.1])
    motion = Recording(jnp.asarray(time), *jnp.zeros((2, 400)), jnp.ones(400))
    with jax.enable_x64(True):
        columns = np.asarray(law.columns(motion))
    both = np.concatenate([np.ones((400, 1)), columns], axis=1)
    noise = 0.1 * np.random.default_rng(2).normal(size=(200, 400))
    residual = noise[0] - both @ np.linalg.lstsq(both, noise[0])[0]
    current = Fit(
        (terms.Offset(), law), (np.zeros(0),) * 2, (np.array([3.0]), alpha), both,
        np.zeros((400, 0)), residual, float(residual @ residual),
    )  # fmt: skip
    with jax.enable_x64(True):
        limits = LIMITS._replace(start=0.0)
        found = parameters.estimates(current, np.arange(400) // 17, UNITS, limits)[1]
    moved = found["range_over_record"]
    assert float(moved.value) == pytest.approx(np.ptp(columns @ alpha), rel=1e-3)
    drawn = [np.ptp(columns @ (alpha + np.linalg.lstsq(both, n)[0][1:])) for n in noise]
    assert float(moved.standard_error) == pytest.approx(np.std(drawn), rel=0.4)
    assert moved.unit == "N"


def test_terms_that_overlap_are_told_together():
    with jax.enable_x64(True):
        current = fitted([WAVE, STOP])
        found = curve(current, 1)
    assert slow_changes.together(current, 1, STROKE) == [1, 2]
    stop = 60.0 * np.maximum([*PLACES - 0.02, MIDDLE - 0.02], 0.0)
    truth = wave(PLACES) - wave(MIDDLE) + stop[:-1] - stop[-1]
    np.testing.assert_allclose([float(e.value) for e in found.values()], truth, rtol=1e-6)


def test_what_repeats_within_the_stroke_is_told_by_its_period():
    cogging = (terms.Cogging(), np.array([2.0, 1.0]), np.array([0.02]))
    with jax.enable_x64(True):
        current = fitted([WAVE, cogging])
        assert curve(current, 2) == {} and curve(current, 0) == {}
        assert slow_changes.together(current, 1, STROKE) == [1]


def test_friction_that_varies_along_the_stroke_is_told_by_itself():
    law = (terms.PositionDependentFriction(), np.array([4.0, 2.5]), np.array([2.5]))
    with jax.enable_x64(True):
        current = fitted([law])
        found = curve(current, 1)
    assert slow_changes.together(current, 1, STROKE) == [1]
    truth = 0.1 * (wave(PLACES) - wave(MIDDLE))
    np.testing.assert_allclose([float(e.value) for e in found.values()], truth, rtol=1e-6)


@pytest.mark.parametrize("constant", [8.0, 60.0])
def test_warming_is_told_by_its_change_over_the_record(constant):
    """Slower than the record it is nearly a straight line, of any size and time constant."""
    time = np.linspace(0.0, 20.0, 400)
    speed = 0.2 * np.sin(7 * time)
    past = np.exp(-time / constant)
    columns = np.stack([speed, past * speed], axis=1)
    slopes = (30.0 * past * time / constant**2 * speed)[:, None]
    residual = 0.01 * np.random.default_rng(2).normal(size=400)
    law = terms.ThermalDrift(terms.Viscous())
    current = Fit(
        (terms.Viscous(), law), (np.zeros(0), np.array([constant])),
        (np.array([50.0]), np.array([30.0])), columns, slopes, residual, 1.0,
    )  # fmt: skip
    found = parameters.estimates(current, np.arange(400) // 17, UNITS, LIMITS)[1]
    change = found[OVER_RECORD]
    assert float(change.value) == pytest.approx(30.0 * (np.exp(-20.0 / constant) - 1))
    assert change.unit == "N·s/m" and float(change.half_width()) < 0.05
    size = found["thermal_viscous"]
    assert (float(size.half_width()) > 10 * float(change.half_width())) == (constant > 20)


@pytest.mark.slow
def test_the_force_of_a_pneumatic_spring_is_told_along_the_stroke(healthy, monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    place = np.asarray(healthy[0].position)
    low, high = place.min(), place.max()
    middle, stroke = 0.5 * (low + high), high - low

    def force(x):
        return 60.0 * ((1 + 0.8 * (x - low) / stroke) ** -1.3)

    pushed = dataclasses.replace(healthy[0], force=healthy[0].force + force(place))
    found = explain(pushed)
    told = {n: e for f in found.findings for n, e in f.parameters.items() if n in ALONG}
    assert set(told) == set(ALONG), found
    for name, part in ALONG.items():
        truth = force(middle + 0.5 * part * stroke) - force(middle)
        half = float(told[name].half_width())
        assert abs(float(told[name].value) - truth) < 1.5 * half
        # The ends are seen in a few strokes only.
        assert half < (0.3 if abs(part) < 1 else 1.0) * abs(truth)
