"""What is said of findings, as an engineer says it."""

import math
import types

import numpy as np
import pytest

from jaxfric.checks.kinds import places, remarks
from jaxfric.explanation import doubts, errors, reported, structure, summary, wording
from jaxfric.explanation.farther import farther
from jaxfric.explanation.finding import Finding, Moved
from jaxfric.explanation.quantities import nil, quantity, turns
from jaxfric.explanation.sentences import (
    changed_sentence,
    factor_sentence,
    mismatch_sentence,
    sentence,
)
from jaxfric.identification.uncertainty import Estimate
from jaxfric.terms.effect import Extent
from jaxfric.terms.effects import EFFECTS


def estimate(value, error, unit):
    """With so many degrees of freedom that half the interval is two standard errors."""
    return Estimate(np.float64(value), np.float64(error), unit, 60)


@pytest.mark.parametrize(
    ("value", "error", "unit", "text"),
    [
        (0.0025002, 1.2e-6, "m", "2.5002 mm ± 0.0024 mm"),
        (0.000192, 3.5e-5, "m", "192 µm ± 70 µm"),
        (0.43, 0.01, "m", "0.430 m ± 0.020 m"),
        (0.00144, 7e-5, "N·m", "1.44 mN·m ± 0.14 mN·m"),
        (17.1487, 0.00315, "1/s", "17.1487 Hz ± 0.0063 Hz"),
        (0.0072, 0.0, "s", "7.2 ms"),
        (1.9, 0.1, "N", "1.90 N ± 0.20 N"),
        (3.0, math.inf, "N", "an amount that this recording cannot tell"),
        (0.7, 0.125, "1", "0.70 ± 0.25"),
    ],
)
def test_a_value_has_the_unit_that_reads_best(value, error, unit, text):
    assert quantity(estimate(value, error, unit)) == text


@pytest.mark.parametrize(
    ("period", "error", "unit", "text"),
    [
        (2 * math.pi / 7, 0.001, "rad", " (7 times per revolution)"),
        (72.0, 0.1, "deg", " (5 times per revolution)"),
        (2 * math.pi, 0.01, "rad", " (once per revolution)"),
        (2 * math.pi / 6.5, 0.001, "rad", " (6.5 per revolution)"),
        (120.0, 18.0, "rad", ""),
        (0.0025, 1e-6, "m", ""),
    ],
)
def test_periods_of_an_angle_are_told_per_revolution(period, error, unit, text):
    assert turns(estimate(period, error, unit)) == text


def test_a_size_no_larger_than_its_interval_may_be_nil():
    assert nil(estimate(0.9878, 0.4928, "N")) and not nil(estimate(1.2, 0.1, "N"))
    assert not nil(estimate(1.2, 0.0, "N")) and not nil(estimate(1.2, math.inf, "N"))


def test_what_does_not_repeat_within_the_stroke_is_a_slow_variation():
    values = {
        "amplitude": estimate(0.99, 0.1, "N"),
        "friction_period": estimate(0.43, 0.12, "m"),
    }
    told = sentence("position_dependent_friction", values, 0.14, (), Extent(0.0, 0.25))
    assert "varies slowly along the stroke, by 0.99 N" in told and "0.43" not in told
    told = sentence("position_dependent_friction", values, 0.14, (), Extent(0.0, 2.0))
    assert "with a period of 0.43 m" in told


def test_a_slow_variation_is_told_by_its_values_along_the_stroke():
    values = {
        "amplitude": estimate(27.0, 400.0, "N"),
        "unbalance_period": estimate(4.4, 35.0, "m"),
        "at_low_end": estimate(-1.4, 0.3, "N"),
        "at_first_quarter": estimate(-1.2, 0.1, "N"),
        "at_third_quarter": estimate(2.2, 0.1, "N"),
        "at_high_end": estimate(5.0, 4.0, "N"),
    }
    told = sentence("gravity_unbalance", values, 0.4, (), Extent(0.0, 0.5))
    assert told.startswith(
        "A force varies slowly along the stroke: compared with the middle of the stroke it is "
        "1.40 N ± 0.60 N less at its low end, 1.20 N ± 0.20 N less at a quarter of it and "
        "2.20 N ± 0.20 N more at three quarters; it does not repeat"
    )
    assert "cannot tell" not in told


def test_waves_that_nearly_cancel_are_told_neither_by_a_pitch_nor_by_a_bound():
    values = {
        "cogging_sin": estimate(180.0, 100.0, "N"),
        "cogging_cos": estimate(-20.0, 90.0, "N"),
        "amplitude": estimate(183.0, 100.0, "N"),
        "pitch": estimate(0.3, 0.4, "m"),
    }
    told = sentence("cogging", values, 0.1, (), Extent(0.0, 0.8, 60.0))
    assert "varies slowly along the stroke, by an amount that this recording cannot tell" in told
    told = sentence("cogging", values, 0.1, (), Extent(0.0, 0.8, 600.0))
    assert "by at most 3" in told and "period" not in told
    known = values | {"pitch": estimate(0.3, 0.004, "m"), "amplitude": estimate(18.0, 1.0, "N")}
    told = sentence("cogging", known, 0.1, (), Extent(0.0, 0.8, 60.0))
    assert "periodic in position, period 0.3000 m ± " in told


@pytest.mark.parametrize("unit", ["A", "N", "mN·m"])
@pytest.mark.parametrize(
    ("saturation", "peak", "part"),
    [
        (1.0, 15.09, "71%"),
        (1.0, 7.5, "45%"),
        (0.1, 7.5, "49%"),
        (1.0, 150.9, ""),
        (1.0, math.nan, ""),
    ],
)
def test_the_level_of_gradual_saturation_is_told_as_extrapolated(unit, saturation, peak, part):
    values = {
        "saturation": estimate(saturation, 0.01, "1"),
        "saturation_level": estimate(15.09, 0.205, unit),
    }
    told = sentence("actuator_saturation", values, 0.89, (), Extent(peak=peak))
    said = f"By this law it would never give more than 15.09 {unit} ± 0.41 {unit}"
    said += f"; here it gives {part} of that at most, so that the level is not seen" * bool(part)
    assert f"gradual saturation. {said}; 89% of the unexplained force." in told


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (0.0, "does not go where it acts"),
        (0.00172, "it is but 0.17% of the force (root mean square)"),
    ],
)
def test_why_the_held_out_recording_confirms_nothing_is_told(part, said):
    assert said in reported.unconfirmed(part)


def test_a_magnitude_whose_interval_holds_zero_is_no_number():
    values = {"knee": estimate(5.3, 1.6, "N·m"), "saturation": estimate(6.0, 111.0, "1")}
    told = sentence("actuator_saturation", values, 0.73, ())
    assert "Above 5.3 N·m ± 3.2 N·m" in told and "111" not in told
    assert "by an amount that this recording cannot tell of the excess" in told
    values = {"knee": estimate(187.0, 123.0, "N·m"), "saturation": estimate(6.0, 1.0, "1")}
    assert "Above an amount that this" in sentence("actuator_saturation", values, 0.73, ())
    values = {"load_resonance": estimate(40, 1, "1/s"), "damping_ratio": estimate(0.01, 0.01, "1")}
    assert "a damping ratio of at most 0.03" in sentence("compliance", values, 0.73, ())


@pytest.mark.parametrize(("reach", "soft"), [(0.09, True), (0.01, False)])
def test_a_stop_over_much_of_the_stroke_is_too_soft_for_one(reach, soft):
    values = {
        "lower_stop_position": estimate(0.095, 0.02, "m"),
        "lower_stop_stiffness": estimate(9.7, 2.0, "N/m"),
    }
    low = 0.095 - reach
    told = sentence("end_stop", values, 0.09, (), Extent(low, low + 0.25))
    assert ("too soft for an end stop" in told) == soft
    assert ("an elastic end stop" in told) != soft


@pytest.mark.parametrize(("damping", "swings"), [(0.7, False), (0.05, True)])
def test_a_load_that_is_damped_much_does_not_swing(damping, swings):
    values = {
        "load_resonance": estimate(4.57, 0.33, "1/s"),
        "damping_ratio": estimate(damping, 0.01, "1"),
    }
    told = sentence("compliance", values, 0.05, ())
    assert ("the load swings" in told) == swings and "4.57 Hz" in told


@pytest.mark.parametrize(
    ("effect", "values", "words"),
    [
        (
            "viscous_nonlinearity",
            {"quadratic_drag": (51.5, "N*s²/m²")},
            "times the square of speed",
        ),
        ("viscous_nonlinearity", {"quadratic_drag": (-5.0, "N*s²/m²")}, "square of speed;"),
        (
            "thermal_drift",
            {"thermal_coulomb": (3.0, "N"), "time_constant": (12.0, "s")},
            "Coulomb friction differs by 3.000 N",
        ),
        (
            "thermal_drift",
            {"thermal_viscous": (-3.0, "N"), "time_constant": (12.0, "s")},
            "viscous friction differs by -3.000 N",
        ),
    ],
)
def test_curved_and_warming_friction_are_told_with_their_sizes(effect, values, words):
    told = {
        name: estimate(value, 0.01 * abs(value), unit) for name, (value, unit) in values.items()
    }
    assert words in sentence(effect, told, 0.5, ())


def moved(value, error, before):
    return Moved(before, estimate(value, error, "N"))


@pytest.mark.parametrize(
    ("other", "friction", "words"),
    [
        ("old.csv", False, "1.1364 ± 0.0020 times those of old.csv"),
        (None, False, "1.1364 ± 0.0020 times the model's"),
        (None, True, "or friction alone is so many times what it was"),
    ],
)
def test_one_factor_is_told_as_another_gain(other, friction, words):
    """1/1.13636 is 0.88, and its interval 0.8785 to 0.8816."""
    told = factor_sentence(estimate(1.13636, 0.001, "1"), 0.99, other, friction)
    assert words in told and "is 12.00% ± 0.15% lower" in told
    assert ("friction alone" in told) == friction
    assert told.endswith("99% of the difference." if other else "99% of the unexplained force.")


def test_a_small_share_is_no_nothing():
    assert "under 1% of the unexplained force" in mismatch_sentence(
        {"c": moved(1, 0.1, 2.0)}, 0.002
    )


def test_a_larger_current_is_a_smaller_torque_constant():
    """1/1.0887 is 0.9185."""
    gain = {"gain": moved(0.0887, 0.001, 0.0)}
    text = mismatch_sentence(gain, 0.9, unit="mA")
    assert "current is 1.0887 ± 0.0020 times the simulator's" in text
    assert "the torque constant is 0.9185 ± 0.0017 of what that takes it for" in text
    assert "(the torque constant) is 1.0887" in mismatch_sentence(gain, 0.9, unit="N·m")


def test_a_delay_that_may_be_none_is_at_most_so_long():
    text = sentence("transport_delay", {"delay": estimate(0.7e-3, 0.4e-3, "s")}, 0.5, ())
    assert "acts at most 1.5 ms late" in text


def test_pushes_are_told_with_their_times_and_sizes():
    sizes = {1: 2.0, 2: -7.0, 3: 0.5, 4: 3.0, 5: 4.0, 6: 4.0, 7: 4.0}
    pushes = {f"pulse_{i}": estimate(size, 0.1, "N") for i, size in sizes.items()}
    pushes |= {f"pulse_{i}_time": estimate(float(i), 0.01, "s") for i in sizes}
    text = sentence("disturbance_pulses", pushes, 0.9, ())
    begin = "Isolated pushes at single times: 2.00 N ± 0.20 N at t = 1.000 s ± 0.020 s, -7.00 N ±"
    assert text.startswith(begin) and "0.50 N" not in text
    assert text.endswith("at t = 7.000 s ± 0.020 s, and 1 smaller; 90% of the unexplained force.")


def test_a_share_that_others_could_stand_in_for_is_told_with_theirs():
    values = {"stiffness": estimate(40.0, 0.1, "N/m")}
    alone = sentence("spring", values, 0.01, (), together=0.98)
    assert alone.endswith("1% of the unexplained force alone, 98% with the other findings.")


def test_a_spring_away_from_the_zero_of_the_position_is_told_from_an_end():
    values = {"stiffness": estimate(40.0, 0.1, "N/m")}
    assert "proportional to position," in sentence("spring", values, 1.0, (), Extent(-0.1, 0.2))
    assert "from the end of the stroke" in sentence("spring", values, 1.0, (), Extent(0.1, 0.2))


def test_flanks_that_give_way_by_more_than_the_gap_are_told():
    names = "backlash_force half_gap windup load_deceleration viscous_speed load_asymmetry".split()
    values = dict(zip(names, (10.0, 1.5e-6, 6.4e-5, 7.8, 0.03, 0.0), strict=True))
    units = dict(zip(names, ("N", "m", "m", "m/s²", "m/s", "1"), strict=True))
    known = {n: estimate(v, 1e-3 * abs(v), units[n]) for n, v in values.items()}
    known |= _derived(known)
    told = sentence("backlash", known, 1.0, ())
    assert "crosses a gap of 3.0000 µm ± " in told and "whose flanks give way by 64.00 µm" in told


def _derived(known):
    evidence = types.SimpleNamespace(motion=types.SimpleNamespace(unit_names={"position": "m"}))
    return reported._derived(EFFECTS["backlash"], known, Extent(), evidence)


def test_a_gap_is_told_from_flank_to_flank():
    known = {
        "backlash_force": estimate(7.7, 0.6, "N·m"),
        "half_gap": estimate(0.0015, 0.0001, "m"),
    }
    gap = _derived(known)["gap"]
    assert (float(gap.value), float(gap.standard_error)) == (0.003, 0.0002)
    told = sentence("backlash", known | {"gap": gap}, 1.0, ())
    assert "while a gap of 3.00 mm ± 0.40 mm is crossed" in told
    most = gap._replace(standard_error=np.float64(0.002))
    told = sentence("backlash", known | {"gap": most}, 1.0, ())
    assert "a gap of at most 7 mm is crossed" in told


@pytest.mark.parametrize(
    ("value", "error", "words"),
    [
        (1.88, 0.1, "by speed to the power of 1.88 ± 0.20;"),
        (0.3, 0.3, "by speed to a power below one;"),
        (0.5, 0.4, "by speed to a power other than one;"),
    ],
)
def test_a_power_of_speed_is_told_by_what_is_known_of_it(value, error, words):
    known = {"power_force": estimate(3.0, 0.1, "N"), "exponent": estimate(value, error, "1")}
    assert words in sentence("viscous_nonlinearity", known, 0.1, ())


def test_warming_of_which_only_the_change_is_known_is_told_by_that():
    known = {
        "thermal_viscous": estimate(8.0, 47.0, "N·s/m"),
        "time_constant": estimate(180.0, 900.0, "s"),
        "over_record": estimate(-2.2, 0.7, "N·s/m"),
    }
    told = sentence("thermal_drift", known, 0.12, ())
    assert told.startswith(
        "Viscous friction falls as the machine warms: by 2.2 N·s/m ± 1.4 N·s/m over the record; "
        "where it settles, and how fast, this recording cannot tell;"
    )
    known["over_record"] = estimate(-2.2, 2.0, "N·s/m")
    told = sentence("thermal_drift", known, 0.12, ())
    assert told.startswith("Viscous friction drifts as the machine warms; where it settles,")


@pytest.mark.parametrize(("period", "told"), [(0.006, "1/4 of the period of 24 mm"), (0.0057, "")])
def test_a_wave_that_is_a_harmonic_of_another_one_says_so(period, told):
    first = {"pitch": estimate(0.024, 1e-6, "m")}
    earlier = Finding("cogging", "", "", (), "", first, 0.9, None, 0.002)
    own = {"pitch": estimate(period, 1e-6, "m")}
    text = reported._overtone(EFFECTS["cogging"], own, [earlier])
    assert told in text and bool(text) == bool(told)
    assert reported._overtone(EFFECTS["cogging"], own, []) == ""


@pytest.mark.parametrize(
    ("here", "held", "refitted", "name"),
    [
        (0.001, 0.052, 0.049, "holdout_holds_more"),
        (0.001, 0.008, 0.007, None),
        (0.05, 0.09, 0.08, None),
        (0.01, 0.3, 0.02, "holdout_differs"),
    ],
)
def test_a_held_out_recording_that_holds_more_is_told(here, held, refitted, name):
    pair = dict.fromkeys(("before", "after"))
    fit = {
        "filtered_force_error": pair | {"after": here},
        "filtered_holdout_force_error": pair | {"after": held},
        "filtered_holdout_refitted_error": refitted,
    }
    assert [remark.name for remark in summary._elsewhere(fit)] == ([name] if name else [])


@pytest.mark.parametrize(("size", "about"), [(9.0, 30.25), (1.0, None)])
def test_what_a_held_out_recording_holds_at_one_moment_is_told_with_that(monkeypatch, size, about):
    """It may be a motion that is too quick for the kernel, which no row can tell from a force."""
    rows = np.arange(480)
    left = types.SimpleNamespace(residual=np.where(rows // 20 == 6, size, 1.0) + (rows == 121))
    held = types.SimpleNamespace(
        elapsed=0.25 * rows, centre=rows, reach=0.5, motion=types.SimpleNamespace(time=0.25 * rows)
    )
    problem = types.SimpleNamespace(held=held, evidence=held)
    findings = types.SimpleNamespace(
        undelayed=types.SimpleNamespace(problem=problem), problem=problem
    )
    monkeypatch.setattr(errors, "_fitted_there", lambda solution: left)
    monkeypatch.setattr(summary, "farther", lambda problem: "")
    assert errors.brief(findings) == about
    fit = {
        "filtered_force_error": {"after": 0.001},
        "filtered_holdout_force_error": {"after": 0.052},
        "filtered_holdout_refitted_error": 0.049,
    }
    (remark,) = summary._elsewhere(fit, (), findings)
    assert ("most of that about t = 30.25 s" in remark.text) == bool(about)
    assert ("a filter of 0.5 s" in remark.text) == bool(about) and "acts there" in remark.text


@pytest.mark.parametrize(
    ("more", "error", "text"),
    [
        (0.25, 0.01, "20.0% ± 1.3% lower at the low end"),
        (-0.1, 0.02, "11.1% ± 4.9% higher at the low end"),
        (0.25, 0.0, "20.0% lower at the low end"),
        (0.25, 1.0, "other by an unknown amount at the low end"),
    ],
)
def test_a_command_that_is_larger_is_told_as_a_force_constant_that_is_lower(more, error, text):
    """1/(1 + h): of intervals [0.23, 0.27] and [-0.14, -0.06] [0.787, 0.813], [1.064, 1.163]."""
    found = {
        "command_at_low_end": estimate(more, error, "1"),
        "command_at_high_end": estimate(0.5, 0.01, "1"),
    }
    said = sentence("position_dependent_force_constant", found, 0.9, ())
    assert f"it is {text} of the stroke and 33.33% ± 0.89% lower at the high end than" in said


def held_out(**more):
    """Figures of a held-out recording that other values of the same model fit."""
    pair = {"before": 0.1, "after": 0.1}
    return {
        "force_error": pair,
        "holdout_force_error": pair,
        "filtered_force_error": {"before": 0.3, "after": 0.01},
        "filtered_holdout_force_error": {"before": 0.1, "after": 0.1},
        "filtered_holdout_refitted_error": 0.01,
        "holdout_refitted_error": 0.03,
        "holdout_noise_floor": 0.03,
    } | more


VALUES = {"coulomb-": {"here": 1.75, "there": 1.5, "standard_error": 0.04, "unit": "N·m"}}


@pytest.mark.parametrize("name", ["thermal_drift", "gain_drift"])
def test_what_begins_anew_in_each_recording_is_no_change_of_the_machine(name):
    finding = Finding(name, "", "", (), "", {}, 0.9, None, 0.002)
    fit = held_out(holdout_values=VALUES)
    (remark,) = summary._elsewhere(fit, [finding])
    spoken = name.replace("_", " ").capitalize()
    assert f"other values hold there. {spoken} begins anew" in remark.text
    assert "machine has changed" not in remark.text
    said = wording.summary("explained", "gaussian", [finding], [], fit, [])
    assert "coulomb- is 1.500 instead of 1.750 N·m. " in said and "begins anew" in said
    assert "the machine changed" not in said
    # Once is enough.
    said = wording.summary("explained", "gaussian", [finding], [], fit, [remark.to_dict()])
    assert "coulomb- is 1.500 instead of 1.750 N·m." in said and "begins anew" not in said
    other = finding._replace(effect="cogging")
    assert "The machine has changed" in summary._elsewhere(fit, [other])[0].text


@pytest.mark.parametrize(("floor", "told"), [(0.03, True), (0.01, False)])
def test_of_a_healthy_machine_it_is_said_whether_what_is_left_elsewhere_is_a_fault(floor, told):
    fit = held_out(holdout_noise_floor=floor, holdout_values={})
    said = wording.summary("consistent", "gaussian", [], [], fit, [])
    assert ("no physics is missing there either" in said) == told
    assert "does not determine the values" in said and "moves like" in said


def test_a_law_that_acts_more_on_the_held_out_recording_may_lack_something_there():
    finding = Finding("compliance", "", "", (), "", {}, 0.9, None, 0.002)
    fit = held_out(filtered_holdout_refitted_error=0.09)
    fit["filtered_holdout_force_error"] = {"before": 0.5, "after": 0.1}
    (remark,) = summary._elsewhere(fit, [finding])
    assert "compliance takes 49% of the force there and 30% here" in remark.text
    assert remark.text.count("Explain that one") == 1
    fit["filtered_holdout_force_error"] = {"before": 0.2, "after": 0.1}
    assert "compliance" not in summary._elsewhere(fit, [finding])[0].text


def test_the_harmonics_of_a_wave_that_are_known_and_not_small_are_told():
    values = {
        "amplitude": estimate(24.2, 0.05, "mA"),
        "amplitude_harmonic2": estimate(0.4, 0.05, "mA"),  # under a tenth
        "amplitude_harmonic3": estimate(14.5, 0.05, "mA"),
        "pitch": estimate(24.0, 1e-3, "mm"),
    }
    said = sentence("cogging", values, 0.9, (), Extent(0.0, 200.0, 100.0))
    assert "amplitude 24.20 mA ± 0.10 mA, with a third harmonic of 14.50 mA ± 0.10 mA: cog" in said
    assert "second" not in said
    values["amplitude_harmonic3"] = estimate(14.5, 10.0, "mA")  # may be none
    assert "harmonic" not in sentence("cogging", values, 0.9, (), Extent(0.0, 200.0, 100.0))


def test_how_far_a_load_wanders_is_told_where_it_is_known():
    known = {"load_drift_1": estimate(0.7, 0.1, "N"), "range_over_record": estimate(1.4, 0.1, "N")}
    said = sentence("load_drift", known, 0.2, ())
    assert "over the record, by 1.40 N ± 0.20 N from its least to its greatest;" in said
    known["range_over_record"] = estimate(1.4, 1.0, "N")
    assert sentence("load_drift", known, 0.2, ()).startswith(
        "A constant force wanders slowly over the record; 20%"
    )


@pytest.mark.parametrize("damping", [0.05, 1.2])
def test_a_resonance_that_is_not_known_is_a_frequency(damping):
    values = {
        "load_resonance": estimate(40.0, math.inf, "Hz"),
        "damping_ratio": estimate(damping, 0.01, "1"),
    }
    said = sentence("compliance", values, 0.9, ())
    assert "at a frequency that this recording cannot tell" in said
    assert quantity(estimate(1.0, math.inf, "s")) == "a time that this recording cannot tell"


@pytest.mark.parametrize(
    ("effect", "values", "listed"),
    [
        ("spring", {"stiffness": (4.0, 0.1, "N/m")}, True),
        ("spring", {"stiffness": (4.0, 3.0, "N/m")}, False),
        ("spring", {"stiffness": (4.0, math.inf, "N/m")}, False),
        ("cogging", {"cogging_sin": (0.1, 3.0, "N"), "amplitude": (9.0, 1.0, "N")}, True),
        ("cogging", {"cogging_sin": (0.1, 3.0, "N"), "amplitude": (9.0, 8.0, "N")}, False),
    ],
)
def test_what_was_refuted_and_may_be_of_no_size_is_not_listed(effect, values, listed):
    known = {name: estimate(*value) for name, value in values.items()}
    refuted = [Finding(effect, "", "", (), "", known, 0.1, None, 0.002, confirmed=False)]
    assert reported.with_size(refuted) == refuted * listed


def test_a_finding_that_takes_nothing_off_the_rows_is_no_place_where_the_baseline_errs():
    first = types.SimpleNamespace(energy=4.0, residual=np.zeros(4))
    share = Finding("cogging", "", "", (), "", {}, 0.25, None, 0.002)
    (place,) = structure.with_findings([], [share], first)
    assert place["coordinate"] == "position" and place["size"] == 0.5
    assert structure.with_findings([], [share._replace(share=-0.75)], first) == []


@pytest.mark.parametrize(
    ("before", "noise", "verdict", "said", "check"),
    [
        (1.0, 0.1, "partly_explained", True, True),
        (1.2, 0.1, "explained", True, False),
        (0.99, 0.1, "partly_explained", False, False),
        (1.0, 0.9, "consistent", False, False),  # that is noise
    ],
)
def test_a_baseline_that_describes_nothing_is_told(before, noise, verdict, said, check):
    fit = {"force_error": {"before": before, "after": 0.05}, "noise_floor": noise}
    text = wording.summary(verdict, "gaussian", [], [], fit, [])
    assert ("describes nothing of this force" in text) == said
    assert ("Check the sign, the unit and the column" in text) == check


@pytest.mark.parametrize(("value", "words"), [(-0.0242, "0.0242 s later"), (0.5, "0.5 s earlier")])
def test_a_force_is_taken_later_or_earlier(value, words):
    (remark,) = remarks(places({"force_late": value}), {"force": "N", "position": "m"})
    assert remark.text.startswith(f"Taken {words}, the force")


def scales(low, high, fastest):
    return types.SimpleNamespace(low=low, high=high, fastest=fastest)


@pytest.mark.parametrize(
    ("there", "said"),
    [
        (scales(-1.0, 10.0, 50.0), ""),
        (scales(0.0, 10.0, 56.0), ""),  # a tenth above most of this one's samples, not above all
        (scales(-3.0, 10.0, 50.0), "goes from -3 to 10 mm, this one from 0 to 10 mm:"),
        (scales(0.0, 10.0, 60.0), "moves at 60 mm/s, this one at up to 52:"),
        (scales(0.0, 12.0, 60.0), "10 mm, and moves at 60 mm/s"),
    ],
)
def test_where_only_the_held_out_recording_moves_is_told(there, said):
    units, velocity = {"position": "mm", "force": "N"}, np.array([0.0, -52.0, 50.0, 99.0])
    motion = types.SimpleNamespace(unit_names=units, velocity=velocity)  # the last one is padding
    here, held = (
        types.SimpleNamespace(limits=limits, located=True, motion=motion, nodes=3)
        for limits in (scales(0.0, 10.0, 50.0), there)
    )
    told = farther(types.SimpleNamespace(evidence=here, held=held))
    assert (said in told) if said else not told
    assert not farther(types.SimpleNamespace(evidence=here, held=None))


@pytest.mark.parametrize(("fall", "told"), [(-2.2, "2.17 N"), (-1.0, ""), (2.2, "")])
def test_two_coulomb_levels_that_change_against_each_other_are_a_constant_force(fall, told):
    moved = {
        "coulomb+": Moved(77.2, Estimate(77.2 + 2.14, 0.05, "N"), 0.04),
        "coulomb-": Moved(42.8, Estimate(42.8 + fall, 0.05, "N"), 0.04),
    }
    text = changed_sentence(moved, 0.9, "march.csv")
    assert (f"a constant force of {told}" in text) if told else "constant force" not in text


@pytest.mark.parametrize(("height", "told"), [(-0.4, True), (-0.05, False), (0.4, False)])
def test_a_bump_upside_down_is_told_where_it_is_sure(height, told):
    """0.05 N is within 3.5 standard errors of none."""
    parameters = {
        "coulomb+": Estimate(-1.0, 0.1, "N"),
        "stribeck_force+": Estimate(height, 0.02, "N"),
    }
    motion = types.SimpleNamespace(channels={})
    text = doubts.falling(parameters, types.SimpleNamespace(peak=5.0, motion=motion))
    assert ("stribeck_force+" in text and "upside down" in text) if told else not text
