"""A friction curve at speeds that no row holds is that of the samples."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric import models
from jaxfric.explanation import slow_curve
from jaxfric.explanation.figures import PARTS, InSlip
from jaxfric.explanation.regression import Fit
from jaxfric.terms import Cogging, Inertia
from jaxfric.terms.sample import Scales

SLOWEST, FASTEST = 2e-3, 0.3


def fitted(bump, width):
    """The baseline as rows may have fitted it, with a Stribeck bump of their own, N and m/s."""
    term = models.gaussian()
    values = {"coulomb": 20.0, "viscous": 60.0, "stribeck_force": bump, "inertia": 5.0}
    alpha = np.array([values[p.name.rstrip("+-")] for p in term.affine])
    none = np.zeros((0, 0))
    return Fit((term,), (np.full(2, width),), (alpha,), none, none, np.zeros(0), 0.0)


def strokes(seed):
    """Velocity of quick strokes, and the part of the record, `(N,)` each."""
    time, draw = np.arange(30000) / 1000.0, np.random.default_rng(seed)
    velocity = sum(
        size * np.sin(2 * np.pi * rate * time + draw.uniform(0, 6))
        for size, rate in ((0.15, 0.9), (0.1, 1.7), (0.05, 2.9))
    )
    return velocity, np.arange(len(time)) * PARTS // len(time)


def identified(bump, width, own, seed=0, noise=0.3):
    """What is identified where friction has one bump and the rows' fit has its `own`."""
    velocity, part = strokes(seed)
    slips = np.abs(velocity) > SLOWEST
    last = fitted(*own)

    def shape(size, width):
        return np.sign(velocity) * size * np.exp(-((velocity / width) ** 2))

    left = shape(bump, width) - shape(*own)
    left += noise * np.random.default_rng(seed).standard_normal(len(left))
    numbers = SLOWEST, FASTEST, -0.1, 0.1, 25.0, 0.0, 30.0, 1e-3, 80.0
    places = slow_curve._friction(last)
    samples = InSlip(velocity[slips], left[slips], part[slips])
    return slow_curve.fitted(
        last, places, slow_curve.Bins.of(samples, Scales(*numbers), 80.0)
    ), places


@pytest.mark.parametrize("own", [(0.1, 0.05), (30.0, 0.0021)])
def test_a_bump_that_the_rows_do_not_see_is_that_of_the_samples(own):
    found, places = identified(7.0, 0.006, own)
    names = [p.name for p in (*places.term.affine, *places.term.nonlinear)]
    values = dict(zip(names, [*found.alphas[0], *found.betas[0]], strict=True))
    for sign in "+-":
        assert values[f"stribeck_force{sign}"] == pytest.approx(7.0, rel=0.1)
        assert values[f"stribeck_velocity{sign}"] == pytest.approx(0.006, rel=0.1)
        assert values[f"coulomb{sign}"] == pytest.approx(20.0, abs=0.05)


@pytest.mark.parametrize("seed", range(12))
def test_noise_is_no_friction(seed):
    assert identified(7.0, 0.006, (7.0, 0.006), seed)[0] is None


def test_only_functions_of_the_velocity_are_friction():
    last = fitted(5.0, 0.01)
    places = slow_curve._friction(last)
    names = [p.name for p in last.terms[0].affine]
    assert "inertia" not in [names[i] for i in places.affine]
    assert len(places.affine) == len(names) - 1 and places.nonlinear == [0, 1]
    rigid = last._replace(terms=(Inertia(),), betas=(np.zeros(0),), alphas=(np.ones(1),))
    assert slow_curve._friction(rigid) is None
    straight = models.coulomb_viscous()
    assert slow_curve._friction(last._replace(terms=(straight,))) is None


def record(seed, size=0.04, width=0.006):
    """Quick strokes of an axis with a narrow Stribeck bump and a cogging; slow ones of another."""
    time = np.arange(20000) / 1000.0
    draw, slow = np.random.default_rng(seed), 0.08 if seed else 1.0
    rates = 2 * np.pi * slow * np.array([0.7, 1.3, 2.1])
    phases = draw.uniform(0, 2 * np.pi, 3)
    x = sum(np.sin(w * time + p) / w for w, p in zip(rates, phases, strict=True)) * size * slow
    structure = models.gaussian() + Cogging(0.011)
    values = {"coulomb": 20.0, "viscous": 60.0, "stribeck_force": 8.0, "stribeck_velocity": width}
    known = {f"{name}{sign}": value for name, value in values.items() for sign in "+-"}
    machine = models.from_parameters(
        structure, known | {"inertia": 5.0, "cogging_sin": 1.0, "cogging_cos": 1.5}
    )
    channels = {
        "reference": jnp.asarray(x),
        "reference_velocity": jnp.asarray(np.gradient(x, time)),
    }
    clock = jf.Recording(time, np.zeros_like(time), x, np.gradient(x, time), channels=channels)
    run = jf.simulate(
        machine, clock, jf.PD(kp=5.0 * 60**2, kd=2 * 5.0 * 60), substeps=16, force_noise=0.3,
        encoder=jf.Encoder(resolution=1e-7), key=jax.random.key(seed),
    )  # fmt: skip
    return dataclasses.replace(run, channels={}, velocity=None)


@pytest.mark.slow
def test_quick_strokes_tell_what_holds_in_slow_ones():
    quick, slow = record(0), record(1)
    found = jf.explain(quick, holdout=slow)
    assert [finding.effect for finding in found.findings] == ["cogging"]
    for sign in "+-":
        # The rows alone know it to some 60 N forward, and to 13 backward; by the velocity half a
        # sample beside the force it would be 9 or 10 N.
        low, high = found.baseline_parameters[f"stribeck_force{sign}"].interval()
        assert low < 8.0 < high and high - low < 2.5
        assert float(found.model.parameters[f"stribeck_force{sign}"]) == pytest.approx(
            float(found.baseline_parameters[f"stribeck_force{sign}"].value)
        )
    # By the rows alone 15 % is left there.
    errors = found.fit["holdout_force_error"]
    assert errors["after"] < 1.2 * found.fit["holdout_noise_floor"]
