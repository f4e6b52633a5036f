"""What is told and written of a robot's joints is no more than what is known of them."""

import types

import numpy as np
import pytest

from jaxfric.cli import robot, robot_text, together
from jaxfric.explanation import Explanation, attributes, contradictions
from jaxfric.explanation.finding import Finding, Moved
from jaxfric.explanation.quantities import percent
from jaxfric.export import errors
from jaxfric.identification.uncertainty import Estimate
from jaxfric.report import robot as pages
from jaxfric.simulators import Attribute
from jaxfric.simulators.weights import Weight

OWN = {
    "joint/elbow/damping": Attribute("joint elbow", "damping", 0.6, "N·m·s/rad"),
    "joint/elbow/armature": Attribute("joint elbow", "armature", 0.06, "kg·m²"),
    "body/tool/mass": Attribute("body tool", "mass", 0.3, "kg"),
}


def moved(name, change, error, freedom=20.0):
    unit = OWN[name].unit
    return Moved(0.0, Estimate(np.float64(change), np.float64(error), unit, freedom))


def reworded(**changes):
    """The finding of changes of the elbow's damping and armature and the tool's mass."""
    names = dict(zip(("damping", "armature", "mass"), OWN, strict=True))
    parameters = {names[n]: moved(names[n], *each) for n, each in changes.items()}
    finding = Finding("parameter_mismatch", "", "", (), "", parameters, 0.9, None, 0.002)
    return attributes._reworded(finding, OWN)


def test_a_value_that_may_be_as_it_was_is_not_told_as_wrong():
    found = reworded(damping=(0.5, 0.01), armature=(0.0043, 0.023))
    assert set(found.parameters) == {"joint/elbow/damping"}
    assert found.untold == ("joint/elbow/armature",)
    assert "0.06" not in found.sentence and "perhaps armature of joint elbow" in found.sentence
    assert found.attribute == "joint/elbow/damping"


def test_a_value_of_which_nothing_is_known_is_not_told_as_wrong():
    found = reworded(damping=(1582.0, np.inf))
    assert not found.parameters and found.untold == ("joint/elbow/damping",)


def test_a_gain_that_may_be_none_is_not_told():
    own = OWN | {"gain": Attribute("actuator m", "gear", 1.0, "1")}
    for error, told in {2500.0: (), 25.0: ("actuator/m/gear",)}.items():
        parameters = {"gain": Moved(0.0, Estimate(np.float64(2499.0), error, "1", 20.0))}
        finding = Finding("parameter_mismatch", "", "", (), "", parameters, 0.9, None, 0.002)
        found = attributes._reworded(finding, own)
        assert tuple(found.parameters) == told and (found.attribute is None) != bool(told)


@pytest.mark.parametrize(("gain", "told"), [(0.0036, False), (0.05, True), (-0.0036, True)])
def test_friction_by_the_whole_force_is_no_torque_constant(gain, told):
    """Of u = f + μ abs(u) sign v all is 1/(1 − μ²) times what it is by the force without it."""
    share = Estimate(np.float64(0.06), np.float64(4e-4), "1", 20.0)
    values = {"gain": Moved(0.0, Estimate(np.float64(gain), np.float64(6e-5), "1", 20.0))}
    findings = [
        Finding(
            "load_dependent_friction", "", "", (), "", {"load_friction": share}, 0.8, None, 0.0
        ),
        Finding("parameter_mismatch", "", "", (), "", values, 0.1, None, 0.002),
    ]
    left = attributes._without_gain_by_load(findings)
    assert left[:1] == findings[:1] and len(left) == 1 + told
    assert attributes._without_gain_by_load(findings[1:]) == findings[1:]


def test_a_value_that_nothing_can_have_is_not_told_as_the_right_one():
    found = reworded(damping=(0.5, 0.01), mass=(-0.4, 0.06))
    assert set(found.parameters) == {"joint/elbow/damping"} and found.untold == ("body/tool/mass",)
    assert "which cannot be below zero: something else is wrong" in found.sentence


def test_a_change_to_what_cannot_be_is_a_change_of_something_else():
    steps = {"step_viscous": moved("joint/elbow/damping", -2.0, 0.1),
             "step_time": moved("joint/elbow/damping", 14.5, 0.1)}  # fmt: skip
    steps = {name: each.estimate for name, each in steps.items()}
    finding = Finding("friction_step", "", "", (), "", steps, 0.1, None, 0.002)
    found = attributes._stepped(finding, OWN, {name: own.value for name, own in OWN.items()})
    assert "would have to change from 0.6" in found.sentence and found.attribute is None
    assert found.untold == ("joint/elbow/damping",) and set(found.parameters) == set(steps)


def test_an_answer_of_values_that_cannot_be_told_does_not_explain():
    assert attributes.claimed("explained", [reworded(damping=(0.5, 0.01))]) == "explained"
    unsure = [reworded(damping=(0.5, 0.01), armature=(0.0043, 0.023))]
    assert attributes.claimed("explained", unsure) == "partly_explained"
    assert attributes.claimed("unexplained", unsure) == "unexplained"


def test_a_file_that_makes_a_joint_worse_by_itself_is_worse():
    beside = {"before": 0.6178, "file": 0.875, "forces": 0.556}
    assert errors.worse({"force_error": beside})
    assert not errors.worse({"force_error": beside | {"file": 0.6}})
    assert errors.worse({"force_error": beside | {"file": 0.6, "forces": 0.65}})
    assert "61.78% → 87.50% held out" in errors.from_to({"holdout_force_error": beside})


def test_errors_beyond_all_sense_are_said_in_words():
    assert percent(0.1234) == "12.34%" and percent(9.0) == "900.00%"
    assert percent(4092853.4) == percent(np.inf) == percent(np.nan) == "over 1000%"


def joint(verdict="explained"):
    fit = {"filtered_force_error": {"before": 0.6, "after": 0.3}}
    fit["filtered_holdout_force_error"] = {"before": 0.62, "after": 0.32}
    told = types.SimpleNamespace(verdict=verdict, fit=fit, findings=[], warnings=[])
    return robot.Joint("elbow", told, "", [], None, [])


def written(file, forces=None):
    """A patch whose file leaves so much of the elbow's force."""
    beside = {} if forces is None else {"forces": forces}
    error = {"before": 0.6, "file": file, **beside}
    told = {"elbow": {"force_error": error, "holdout_force_error": error}}
    return robot.Patch("", None, [], [], told, "new_forces.py")


def test_the_table_has_what_the_file_leaves_by_itself():
    row = robot._row(joint(), written(0.5, 0.1))
    said = robot_text.joints("user.xml", "a.csv", [row]).splitlines()
    assert said[2].split() == ["joint", "verdict", "error", "after", "callback",
                               "held", "out", "after", "callback", "what"]  # fmt: skip
    assert said[3].split()[2:] == ["60.00%", "50.00%", "10.00%", "62.00%", "50.00%", "10.00%"]
    assert "callback" not in robot_text.joints("user.xml", "a.csv", [robot._row(joint(), None)])


def test_the_table_has_what_noise_alone_makes_where_that_is_known():
    elbow = joint()
    elbow.told.fit["filtered_noise_floor"] = 0.25
    row = robot._row(elbow, None)
    assert row["filtered_noise_floor"] == 0.25
    refused = {"joint": "wrist", "verdict": "refused", "error": "No force."}
    said = robot_text.joints("user.xml", "a.csv", [row, refused]).splitlines()
    assert said[2].split()[2:] == ["error", "after", "noise", "held", "out", "after", "what"]
    assert said[3].split()[2:] == ["60.00%", "30.00%", "25.00%", "62.00%", "32.00%"]
    assert "Noise: what it alone makes." in said[-1]
    page = pages.render("user.xml", "a.csv", [row, refused], {}, [])
    assert ">25.00%<" in page and "Noise: what it alone makes." in page


def test_a_simulator_that_describes_nothing_of_a_joint_is_told():
    elbow = joint()
    elbow.told.fit["filtered_force_error"]["before"] = 1.08
    row = robot._row(elbow, None)
    said = " ".join(robot_text.joints("user.xml", "a.csv", [row]).split())
    assert "elbow: Before, the model describes nothing of this force" in said
    assert "describes_nothing" not in robot._row(joint(), None)


def test_the_table_says_where_an_unexplained_joint_errs_and_what_was_refuted():
    places = ("velocity", 0.2, ""), ("force_rate", 0.31, "period 10.9 mm")
    where = [dict(zip(("coordinate", "share", "detail"), each, strict=True)) for each in places]
    some = {"backlash": None, "tooth_mesh": False, "cogging": False}
    refused = [
        Finding(name, "", "", (), "", {}, 0.1, None, 0.002, confirmed=confirmed)
        for name, confirmed in some.items()
    ]
    elbow = joint("unexplained")
    elbow.told.where, elbow.told.not_confirmed = where, refused
    row = robot._row(elbow, None)
    said = " ".join(robot_text.joints("user.xml", "a.csv", [row]).split())
    assert (
        "elbow: Not explained: most that the model leaves follows force rate (31%: period 10.9 "
        "mm); it looks like backlash, with which the model is worse sample by sample; it looks "
        "like tooth mesh and cogging, which the held-out recording does not confirm. More by "
        "--joint elbow." in said
    )
    assert "see below" in said
    elbow.told.where, elbow.told.not_confirmed = [], []
    assert "no place stands out" in robot._row(elbow, None)["unexplained"]
    elbow.told.findings.append(refused[0])
    elbow.told.warnings.append({"name": "force_sign", "text": "Of another sign.", "severe": True})
    assert "unexplained" not in robot._row(elbow, None)


def test_which_number_would_be_below_zero_is_said():
    weight = Weight(1.5, np.array([0.13, 0.0, 0.0]), np.array([0.002, 0.012, 0.012]), np.eye(3))
    with pytest.raises(ValueError, match="inertia y would be below zero"):
        weight.with_values({"centre_x": 169.8, "inertia_y": -17.3})
    with pytest.raises(ValueError, match="mass would be below zero"):
        weight.with_values({"mass": -0.1})


def told_by(mass, error, verdict="explained", at=12.0):
    """An explanation by which the mass of a body changes from 1.5 kg at a moment."""
    own = Moved(1.5, Estimate(np.float64(mass), np.float64(error), "kg", 20.0))
    moment = Estimate(np.float64(at), np.float64(0.1), "s", 20.0)
    parameters = {"body/fore/mass": own, "step_time": moment}
    finding = Finding("payload_change", "", "", (), "", parameters, 0.9, None, 0.002)
    empty = dict.fromkeys(("where", "not_visible"), [])
    rest = dict.fromkeys(("fit", "baseline_parameters", "recording"), {})
    return Explanation(verdict, findings=[finding], model=None, baseline=None, baseline_name="",
                       **empty, **rest)  # fmt: skip


def test_joints_that_contradict_each_other_on_a_body_explain_nothing():
    told = {"waist": told_by(2.655, 0.025), "elbow": told_by(2.947, 0.014)}
    found = contradictions.with_contradictions(told)
    assert {each.verdict for each in found.values()} == {"partly_explained"}
    (warning,) = found["waist"].warnings
    assert warning == found["elbow"].warnings[0] and not warning["severe"]
    assert "mass of body fore: 2.65" in warning["text"] and "by waist and 2.94" in warning["text"]


def test_joints_that_agree_on_a_body_or_tell_of_two_moments_do_not_contradict():
    alike = {"waist": told_by(2.655, 0.025), "elbow": told_by(2.63, 0.02)}
    assert contradictions.with_contradictions(alike) == alike
    apart = {"waist": told_by(2.655, 0.025), "elbow": told_by(1.6, 0.014, at=5.0)}
    assert contradictions.with_contradictions(apart) == apart


def armed(name, alike, instead=()):
    """A joint that by itself finds its armature wrong; a value of the owners `alike`, or the mass
    of the bodies `instead`, would do as well.
    """
    alike = tuple(Attribute(owner, "mass", 1.0, "kg") for owner in alike)
    key = f"joint/{name}/armature"
    own = {key: Attribute(f"joint {name}", "armature", 5.0, "kg", alike)}
    own |= {f"body/{body}/mass": Attribute(f"body {body}", "mass", 1.0, "kg") for body in instead}
    value = Moved(5.0, Estimate(np.float64(8.0), np.float64(0.01), "kg", 20.0))
    others = {key: tuple(f"body/{body}/mass" for body in instead)}
    finding = Finding("parameter_mismatch", "", "", (), "", {key: value}, 0.9, None, 0.0)
    told = types.SimpleNamespace(findings=[finding._replace(instead=others)])
    return robot.Joint(name, told, "", [], types.SimpleNamespace(attributes=lambda: own), [])


def test_all_joints_are_asked_where_one_body_may_stand_for_values_of_two():
    x = armed("x", ("body bridge", "body carriage"))
    y = armed("y", ("joint y",), ("carriage",))
    assert together._by_one_body([x, y]) == {"body carriage"}
    assert not together._by_one_body([x])
    assert not together._by_one_body([x, armed("y", ("body ram",))])


def test_a_body_s_value_counts_once_of_all_joints():
    x, y = armed("x", ()), armed("y", ())
    assert together._count([x, y]) == 2
    (finding,) = x.told.findings
    mass = {"body/carriage/mass": finding.parameters["joint/x/armature"]}
    told = types.SimpleNamespace(findings=[finding._replace(parameters=mass)])
    assert together._count([x._replace(told=told), y._replace(told=told)]) == 1
