"""A friction curve at speeds that no row holds is that of the samples."""

import types

import numpy as np
import pytest

from jaxfric import models
from jaxfric.explanation import slow_curve
from jaxfric.explanation.figures import PARTS
from jaxfric.explanation.regression import Fit
from jaxfric.terms import Inertia
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
    evidence = types.SimpleNamespace(limits=Scales(*numbers), peak=80.0)
    places = slow_curve._friction(last)
    return slow_curve._identified(
        last, places, velocity[slips], left[slips], part[slips], evidence
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
