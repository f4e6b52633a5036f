"""A wrong law is told where it shows, and a right one is not called wrong."""

import jax
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import jaxfric as jf
from jaxfric import checks
from jaxfric.checks import Design

TOP = 0.2


def quadratic(v):
    return np.sign(v) * (8 + 4 * (v / TOP) ** 2) + 20 * v


def stribeck(v):
    return np.sign(v) * (8 + 4 * np.exp(-((v / 0.02) ** 2))) + 20 * v


def both(v):
    return stribeck(v) + 4 * v * np.abs(v) / TOP**2


def thinning(v):
    return 8 * np.sign(v) + 120 * v / (1 + 3 * np.abs(v) / TOP)


def viscous(v):
    return 8 * np.sign(v) + 40 * v


def machine(friction, seed=0, unit=(1.0, 1.0), noise=0.1, hum=0.0):
    """An axis with that friction, N, of the velocity, m/s, on a multisine, in any unit.

    `hum`: a load, N, that swings at a frequency of its own: noise that is far from white.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(12000) / 1000
    rates = 2 * np.pi * np.array([0.25, 0.7, 1.9]) * rng.uniform(0.9, 1.1, 3)
    phases, sizes = rng.uniform(0, 6, 3)[:, None], np.array([0.05, 0.01, 0.003])
    angle = rates[:, None] * time + phases
    x, v, a = (
        sizes @ np.sin(angle),
        (sizes * rates) @ np.cos(angle),
        -(sizes * rates**2) @ np.sin(angle),
    )
    load = hum * np.sin(2 * np.pi * rng.uniform(0.05, 1) * time + rng.uniform(0, 6))
    force = 3 * a + friction(v) + load + noise * rng.normal(size=time.size)
    newton, metre = unit
    return jf.Recording(time=time, force=newton * force, position=metre * x, velocity=metre * v)


def missed(found):
    """Of each row the force that the curve misses and where, NaN where nothing is said."""
    at = checks.NAMES.index("curve_missed")
    return np.asarray(found.warnings)[:, at : at + 2]


@pytest.mark.slow
def test_a_law_that_is_curved_otherwise_is_told_and_a_right_one_is_not():
    wrong = [machine(f, s) for s, f in enumerate((quadratic, stribeck, thinning))]
    right = [machine(viscous, s, hum=0.5 * (s % 2)) for s in range(8)]
    scaled = machine(quadratic, 0, (1e-5, 1e3))
    found = jf.identify("coulomb-viscous", jf.stack([*wrong, scaled, *right]))
    force, at = missed(found).T
    assert np.isfinite(force[:4]).all() and np.isnan(force[4:]).all() and np.isnan(at[4:]).all()
    # It changes with the units of force and of length, and with nothing else.
    np.testing.assert_allclose([force[3], at[3]], [1e-5 * force[0], 1e3 * at[0]], rtol=1e-2)
    # What a straight line leaves of the parabola is less than the parabola; the bump is slow.
    assert 0.1 < force[0] < 4 and abs(at[1]) < 0.05
    said = next(r for r in found[0].remarks if r.name == "curve_missed").text
    assert f"{force[0]:.3g} N" in said and f"{at[0]:.3g} m/s" in said and "intervals" in said
    assert "curve missed in row 0, 1, 2, 3" in str(found).replace("rows", "row")


@pytest.mark.slow
def test_a_drag_beside_a_bump_is_told_of_the_bump_s_model_alone():
    rows = jf.stack([machine(both, noise=0.3), *(machine(stribeck, s) for s in range(4))])
    force = missed(jf.identify("gaussian", rows))[:, 0]
    assert np.isfinite(force[0]) and np.isnan(force[1:]).all()


def design(curve, seed=0, unit=(1.0, 1.0), slow=0.0):
    """Rows of Coulomb and viscous friction whose force has that curve as well, N; `slow` noise."""
    rng = np.random.default_rng(seed)
    newton, metre = unit
    time = 0.01 * np.arange(1, 1601)
    v = (
        TOP
        * np.sin(2 * np.pi * rng.uniform(0.3, 0.6) * time)
        * (1 + 0.5 * np.sin(0.7 * time))
        / 1.5
    )
    wander = slow * np.cumsum(rng.normal(size=len(v))) / np.sqrt(len(v))
    force = newton * (viscous(v) + curve(v) + wander + 0.1 * rng.normal(size=len(v)))
    v = metre * v
    columns = np.stack(
        [
            np.where(v > 0, 1, 0),
            np.where(v > 0, v, 0),
            np.where(v > 0, 0, -1),
            np.where(v > 0, 0, v),
        ],
        1,
    )
    left = force - columns @ np.linalg.lstsq(columns, force, rcond=None)[0]
    return Design(columns, force, left, np.ones(len(v)), time, np.zeros(4), velocity=v)


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.floats(0, 3))
def test_noise_however_slow_is_no_curve(seed, slow):
    assert checks.misfit(design(lambda v: 0 * v, seed, slow=slow)) is None


@settings(max_examples=20)
@given(
    st.integers(0, 10**6), st.tuples(st.floats(-9, 6), st.floats(-6, 6)), st.sampled_from([-1, 1])
)
def test_units_and_sign_do_not_matter(seed, powers, sign):
    newton, metre = (10.0**p for p in powers)
    one = checks.misfit(design(lambda v: sign * 4 * v * np.abs(v) / TOP**2, seed))
    other = checks.misfit(
        design(lambda v: sign * 4 * v * np.abs(v) / TOP**2, seed, (newton, metre))
    )
    np.testing.assert_allclose(other[1:], (newton * one.most, metre * one.at), rtol=1e-6)


def test_what_is_less_than_a_sensor_s_linearity_or_padding_is_not_told():
    small = design(lambda v: 0.05 * v * np.abs(v) / TOP**2)
    small = small._replace(left=small.left * 1e-3)
    assert checks.misfit(small) is None
    whole = design(lambda v: 4 * v * np.abs(v) / TOP**2)
    padded = jax.tree.map(lambda x: np.pad(x, [(0, 300)] + [(0, 0)] * (x.ndim - 1)), whole)
    padded = padded._replace(shift=whole.shift)
    np.testing.assert_allclose(checks.misfit(padded)[1:], checks.misfit(whole)[1:], rtol=1e-9)
    assert checks.misfit(whole._replace(velocity=None)) is None


def test_a_dead_band_is_told_by_the_force():
    whole = design(lambda v: 0 * v)
    # What accelerates the axis is known: half of the slip it pulls against the motion.
    pull = 60 * np.cos(0.9 * whole.time)
    columns = np.concatenate([whole.columns, pull[:, None]], axis=1)
    force = whole.target + 3 * pull
    force = force + 4 * np.sign(force)
    left = force - columns @ np.linalg.lstsq(columns, force, rcond=None)[0]
    bent = whole._replace(columns=columns, target=force, left=left, shift=np.zeros(5))
    assert checks.misfit(bent).name == "force_missed"


@pytest.mark.parametrize(("name", "place"), [("curve_missed", "rad/s"), ("force_missed", "N·m")])
def test_the_sentence_names_the_place(name, place):
    numbers = checks.places({name: 0.25, f"{name}_at": -0.04})
    (said,) = checks.remarks(numbers, {"force": "N·m", "position": "rad"})
    assert "0.25 N·m" in said.text and f"-0.04 {place}" in said.text and not said.severe
