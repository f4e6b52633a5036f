"""The time of a step in friction, a parameter or the load, with its interval."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric import terms as T
from jaxfric.explanation import dates

RATE = 500.0


def moves(dwell=0.2, count=12, stroke=0.1, seconds=0.8):
    """Time, position, velocity and acceleration of strokes to and fro with a dwell after each."""
    many, rest = int(seconds * RATE), int(dwell * RATE)
    s = np.arange(many) / many
    shapes = (
        s**3 * (10 - 15 * s + 6 * s**2),
        30 * s**2 * (1 - s) ** 2,
        60 * s * (1 - s) * (1 - 2 * s),
    )
    scales = stroke, stroke / seconds, stroke / seconds**2
    still = np.zeros(rest)
    there, speed, rate = (k * shape for k, shape in zip(scales, shapes, strict=True))
    to_and_fro = np.concatenate([there, still + stroke, stroke - there, still])
    fast, push = (np.concatenate([one, still, -one, still]) for one in (speed, rate))
    x, v, a = (np.tile(each, count // 2) for each in (to_and_fro, fast, push))
    return np.arange(x.size) / RATE, x, v, a


def log(term, sizes, moment, noise=0.1, seed=0, **arguments):
    """An axis of 3 kg with friction, and a step of a term's parameters at a moment."""
    t, x, v, a = moves(**arguments)
    force = 3 * a + np.sign(v) * 8 + 20 * v
    motion = jf.Recording(t, 0 * t, x, v)
    after = t > moment
    force = force + after * (np.asarray(term.columns(motion)) @ sizes)
    if term.inertial:
        force = force + after * sizes[0] * a
    force = force + noise * np.random.default_rng(seed).normal(size=t.size)
    return jf.Recording(t, force, x, v)


BASE = jf.models.coulomb_viscous()
COULOMB, LOAD = T.Directional(T.Coulomb()), T.Inertia() + T.Offset()
STEPS = {
    "friction": (T.FrictionStep(), T.Coulomb(), {"step_coulomb": 2.0}),
    "load": (T.PayloadChange(LOAD), LOAD, {"payload_inertia": 2.0, "payload_offset": 3.0}),
    "by direction": (
        T.FrictionStep(COULOMB),
        COULOMB,
        {"step_coulomb+": 2.0, "step_coulomb-": 1.5},
    ),
    "viscous": (T.ParameterStep(T.Viscous()), T.Viscous(), {"step_viscous": 15.0}),
}
SLOW = ("by direction", "viscous")


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", [pytest.param(k, marks=pytest.mark.slow) if k in SLOW else k for k in STEPS]
)
def test_the_time_of_a_step_has_an_interval_that_holds_it(kind):
    model, term, sizes = STEPS[kind]
    moments = (4.3217, 7.4103)
    runs = [log(term, np.array([*sizes.values()]), at, seed=k) for k, at in enumerate(moments)]
    found = jf.identify(BASE + model, jf.stack(runs))
    for i, at in enumerate(moments):
        one = found[i]
        assert one.result_name == "successful", one.diagnosis
        low, high = one.parameters["step_time"].interval()
        assert low <= at <= high
        assert high - low < 0.3  # a move takes 0.8 s
        for name, size in sizes.items():
            np.testing.assert_allclose(one.parameters[name].value, size, rtol=0.03, err_msg=name)
        assert one.model.term.terms[-1].ramp == 0  # the model that was given


@pytest.mark.slow
def test_a_step_at_rest_is_anywhere_in_the_rest():
    run = log(T.Coulomb(), np.array([2.0]), 5.3, dwell=1.0, count=6)
    found = jf.identify(BASE + T.FrictionStep(), run)
    moment = found.parameters["step_time"]
    low, high = moment.interval()
    assert found.result_name == "successful"
    # The dwell is from 4.4 to 5.4 s.
    assert abs(float(moment.value) - 4.9) < 0.1
    assert 4.0 < low < 4.4 and 5.4 < high < 5.8


@pytest.mark.slow
def test_the_time_of_a_step_that_noise_hides_is_hardly_known():
    run = log(T.Coulomb(), np.array([0.02]), 7.41, noise=1.0)
    found = jf.identify(BASE + T.FrictionStep(), run)
    low, high = found.parameters["step_time"].interval()
    assert high - low > 1.0


@pytest.mark.slow
def test_coverage_of_the_time_of_a_step():
    rng = np.random.default_rng(5)
    moments = rng.uniform(1.0, 11.0, 40)
    runs = [
        log(T.Coulomb(), np.array([1.5]), at, noise=1.0, seed=k) for k, at in enumerate(moments)
    ]
    found = jf.identify(BASE + T.FrictionStep(), jf.stack(runs))
    low, high = found.parameters["step_time"].interval()
    assert np.mean((jnp.asarray(low) <= moments) & (moments <= jnp.asarray(high))) >= 0.9


@pytest.mark.parametrize(("further", "none"), [(19.9, False), (20.0, True)])
def test_a_change_that_may_be_anywhere_in_the_recording_is_none(monkeypatch, further, none):
    """Of a healthy robot's joint a burst at rest was a payload at 19 s ± 20 s."""
    evidence = SimpleNamespace(limits=SimpleNamespace(duration=20.0))
    problem = SimpleNamespace(evidence=evidence)

    def found(moment):
        effect = SimpleNamespace(moment=moment)
        selection = SimpleNamespace(selected=[SimpleNamespace(effect=effect)])
        solution = SimpleNamespace(problem=problem, selection=selection)
        return SimpleNamespace(examined_in=lambda number: solution)

    monkeypatch.setattr(dates, "_further", lambda solution, number, name: further)
    assert dates.anytime(found("step_time"), 0) == none
    assert not dates.anytime(found(""), 0)  # an effect that has no date
