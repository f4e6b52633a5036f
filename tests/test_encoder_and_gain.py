"""An encoder off centre and a force constant that falls as the motor warms, and what is near them:
an inertia that varies along the stroke, friction that falls as the axis warms.
"""

import numpy as np
import pytest

from jaxfric import Recording, explain, terms
from jaxfric.explanation.sentences import told
from jaxfric.identification.uncertainty import Estimate
from jaxfric.terms.effect import Extent, View
from jaxfric.terms.effects import EFFECTS
from jaxfric.terms.sample import Scales


def axis(mass, coulomb, viscous, stroke, unit=("N", "m"), seed=0, *, off=(0.0, 1.0),
         varies=(0.0, 1.0), falls=(0.0, 1.0), warms=(0.0, 1.0), slower=1.0):  # fmt: skip
    """An axis on three sines. `off`: by how much its encoder is, and the period; `varies`: by how
    much its inertia, and the period; `falls`: the part of its force constant, and the time;
    `warms`: as much of its Coulomb friction.
    """
    draw = np.random.default_rng(seed)
    time = np.arange(0.0, 40.0, 2e-3)
    rates = 2 * np.pi * np.array([0.35, 0.67, 1.3]) / slower * draw.uniform(0.9, 1.2)
    sizes = stroke * np.array([0.5, 0.2, 0.06])
    angles = rates * time[:, None] + draw.uniform(0, 2 * np.pi, 3)
    x, v, a = np.sin(angles) @ sizes, np.cos(angles) @ (sizes * rates), 0.0
    a = -np.sin(angles) @ (sizes * rates**2)
    wave = 2 * np.pi * x / varies[1]
    more = varies[0] * (np.sin(wave) * a + np.pi / varies[1] * np.cos(wave) * v**2)
    drier = 1 + warms[0] * np.exp(-time / warms[1])
    force = mass * a + more + coulomb * drier * np.sign(v) + viscous * v
    force = force * (1 + falls[0] * (1 - np.exp(-time / falls[1])))
    force += 0.005 * coulomb * draw.normal(size=len(time))
    seen = x + off[0] * np.sin(2 * np.pi * x / off[1] + 1.0)
    units = dict(zip(("force", "position"), unit, strict=True))
    return Recording(time, force, seen, units=units)


LINEAR = 3.0, 8.0, 25.0, 0.3
MOTOR = 2e-4, 0.02, 3e-3, 12.0, ("N·m", "rad")


def found(machine, **concealed):
    runs = [axis(*machine, seed=seed, **concealed) for seed in (0, 7)]
    return explain(runs[0], "coulomb-viscous", runs[1])


@pytest.mark.slow
@pytest.mark.parametrize(("machine", "off"), [(LINEAR, (1e-4, 0.03)), (MOTOR, (0.02, 2 * np.pi))])
def test_an_encoder_off_centre_is_told_with_how_far(machine, off):
    answer = found(machine, off=off)
    (finding,) = answer.findings
    assert finding.effect == "encoder_error" and answer.verdict == "explained"
    for name, value in zip(("encoder_error", "encoder_period"), off, strict=True):
        # The law is of first order in 2πe/L, which is 0.02 here.
        assert float(finding.parameters[name].value) == pytest.approx(value, rel=0.01)
        assert finding.parameters[name].half_width() < 0.02 * value


@pytest.mark.slow
@pytest.mark.parametrize(("machine", "varies"), [(LINEAR, (0.3, 0.3)), (MOTOR, (2e-5, 6.0))])
def test_an_inertia_that_varies_is_no_encoder(machine, varies):
    (finding,) = found(machine, varies=varies).findings
    assert finding.effect == "position_dependent_inertia"
    assert float(finding.parameters["amplitude"].value) == pytest.approx(varies[0], rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("machine", "falls"), [(MOTOR, (0.05, 30.0)), (LINEAR, (0.15, 5.0))])
def test_a_force_constant_that_falls_is_told_with_its_time(machine, falls):
    answer = found(machine, falls=falls)
    (finding,) = answer.findings
    assert finding.effect == "gain_drift" and answer.verdict == "explained"
    low, high = finding.parameters["time_constant"].interval()
    assert low < falls[1] < high and high - low < 0.3 * falls[1]
    most = float(finding.parameters["drift_gain"].value)
    assert 1 / (1 + most) - 1 == pytest.approx(falls[0], rel=0.03)
    assert "At the start the gain is" in finding.sentence and "% higher" in finding.sentence


@pytest.mark.slow
@pytest.mark.parametrize("machine", [LINEAR, MOTOR])
def test_friction_that_warms_is_no_gain(machine):
    (finding,) = found(machine, warms=(0.2, 9.0)).findings
    assert finding.effect == "thermal_drift"
    amount = float(finding.parameters["thermal_coulomb"].value)
    assert amount == pytest.approx(0.2 * machine[1], rel=0.05)


def test_how_far_an_encoder_is_off_follows_from_the_inertia():
    """E = A L / (2π M); without an inertia the sentence says what is known."""
    effect, values = EFFECTS["encoder_error"], {"amplitude": 0.058, "encoder_period": 0.13}
    ((name, how),) = effect.derived(values, Extent(inertia=3.0)).items()
    assert name == "encoder_error" and how.of == "amplitude"
    assert how.factor * 0.058 == pytest.approx(0.4e-3, rel=1e-3)
    assert effect.derived(values, Extent()) == {}
    parameters = {
        "amplitude": Estimate(np.float64(0.058), np.float64(0.001), "kg"),
        "encoder_period": Estimate(np.float64(0.13), np.float64(1e-4), "m"),
    }
    assert "the inertia seems to vary by 0.0580 kg" in told(effect, parameters)
    assert isinstance(effect.shapes(None)[0], terms.EncoderError)


@pytest.mark.slow
def test_an_encoder_of_a_motor_that_turns_many_times_is_told():
    """Sixty revolutions: of a period that is a small part of the stroke it is told, since the
    position is an angle; it was an unbalance of "8.4 ± 3.8 mN·m".
    """
    turning = 2e-4, 0.02, 3e-3, 380.0, ("N·m", "rad")
    answer = found(turning, off=(0.006, 2 * np.pi), slower=10.0)
    (finding,) = answer.findings
    assert finding.effect == "encoder_error" and answer.verdict == "explained"
    assert float(finding.parameters["encoder_error"].value) == pytest.approx(0.006, rel=0.02)


def test_periods_of_what_turns_are_looked_for():
    """Of a motor of sixty turns a revolution and half of one, which are no part of the stroke."""
    for name in ("encoder_error", "position_dependent_inertia"):
        effect = EFFECTS[name]
        turning, sliding = (
            effect.grid(effect.laws[0](), view(60 * 2 * np.pi, turn)) for turn in (2 * np.pi, 0.0)
        )
        there = {round(float(place[0]), 6) for place in turning}
        there -= {round(float(place[0]), 6) for place in sliding}
        assert there == {round(2 * np.pi, 6), round(np.pi, 6)}


def view(stroke, turn):
    limits = Scales(*(1.0,) * len(Scales._fields))
    limits = limits._replace(low=0.0, high=stroke, duration=20.0, interval=1e-3)
    return View(limits, 0.01, 10_000, 10.0, 50.0, turn=turn)


@pytest.mark.slow
def test_an_inertia_that_varies_with_each_turn_is_no_encoder_off_centre():
    """A crank, twice in a revolution, of an axis that goes one way for sixty of them."""
    runs = []
    for seed in (0, 1):
        time = np.arange(0.0, 16.0, 1e-3)
        slow, fast = 2 * np.pi * (0.23 + 0.04 * seed), 2 * np.pi * 0.9
        speed = 14 + 8 * np.sin(slow * time) + 3.5 * np.sin(fast * time + seed)
        rate = 8 * slow * np.cos(slow * time) + 3.5 * fast * np.cos(fast * time + seed)
        x = np.cumsum(speed) * 1e-3
        inertia, slope = 0.042 - 0.009 * np.cos(2 * x - 0.4), 0.018 * np.sin(2 * x - 0.4)
        force = inertia * rate + 0.5 * slope * speed**2 + 0.5 + 0.06 * speed
        force += 0.05 * np.random.default_rng(seed).normal(size=len(time))
        runs.append(Recording(time, force, x, units={"force": "N·m", "position": "rad"}))
    answer = explain(runs[0], "coulomb-viscous", runs[1])
    (finding,) = answer.findings
    assert finding.effect == "position_dependent_inertia" and answer.verdict == "explained"
    assert float(finding.parameters["amplitude"].value) == pytest.approx(0.009, rel=0.01)
    assert float(finding.parameters["inertia_period"].value) == pytest.approx(np.pi, rel=1e-4)
