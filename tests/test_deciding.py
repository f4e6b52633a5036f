"""Which of several effects a second recording speaks for."""

import numpy as np
import pytest

import jaxfric as jf
from jaxfric import terms
from jaxfric.identification.deciding import decide, independent

STIFFNESS = 400.0


def log(stroke, law, seed=0):
    """A slide of 2 kg under Coulomb and viscous friction, with another force of its position."""
    t = np.arange(8000) / 500
    x, v, a = (
        0.5 * stroke * sum(s * w**n * np.sin(w * t + p + n * np.pi / 2) for s, w, p in WAVES)
        for n in (0, 1, 2)
    )
    force = 2 * a + 8 * np.sign(v) + 5 * v + law(x)
    force = force + 0.05 * np.random.default_rng(seed).normal(size=t.size)
    return jf.Recording(t, force, x, v)


WAVES = ((0.6, 4.1, 0.3), (0.4, 9.7, 1.1))


@pytest.fixture(scope="module")
def model():
    """Found with a spring, which is right."""
    term = jf.models.coulomb_viscous() + terms.Spring()
    return jf.identify(term, log(0.2, lambda x: STIFFNESS * x)).model


@pytest.mark.slow
def test_a_motion_on_which_two_effects_differ_decides(model):
    spring = decide(model, "spring", ("hardening_spring",), log(0.2, lambda x: STIFFNESS * x, 1))
    assert spring.effect == "spring" and spring.decided
    hardening = decide(model, "spring", ("hardening_spring",), log(0.2, lambda x: 4e4 * x**3, 1))
    assert hardening.effect == "hardening_spring" and hardening.decided
    assert (
        hardening.standings[0].filtered_force_error
        < 0.5 * hardening.standings[1].filtered_force_error
    )


@pytest.mark.slow
def test_a_motion_on_which_they_are_alike_does_not(model):
    """An unbalance has two parameters more, which is no evidence against it."""
    found = decide(model, "spring", ("gravity_unbalance",), log(0.002, lambda x: STIFFNESS * x, 1))
    assert not found.decided and set(found.alike) | {found.effect} == {
        "spring",
        "gravity_unbalance",
    }


@pytest.mark.slow
def test_a_model_without_the_effect_is_refused(model):
    with pytest.raises(ValueError, match="no term of the effect 'cogging'"):
        decide(model, "cogging", ("spring",), log(0.2, np.zeros_like))


def test_correlated_values_count_for_less():
    noise = np.random.default_rng(0).normal(size=4000)
    assert 3000 < independent(noise) <= 4000
    assert independent(np.convolve(noise, np.ones(20) / 20, "valid")) < 500
