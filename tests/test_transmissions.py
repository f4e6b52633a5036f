"""Which answer stands: that of a robot's model, one with a spring in it, or none that is sure."""

import dataclasses
import itertools
from argparse import Namespace

import numpy as np
import pytest

from jaxfric.cli import transmissions
from jaxfric.cli.robot_joints import Joint
from jaxfric.explanation import Explanation
from jaxfric.explanation.elasticity import DAMPING, STIFFNESS, ElasticJoint, Suspicion
from jaxfric.explanation.finding import Finding, Moved
from jaxfric.identification.uncertainty import Estimate
from jaxfric.simulators import Mujoco
from jaxfric.terms.effects.compliance import COMPLIANCE
from jaxfric.terms.effects.parameter_mismatch import MISMATCH

pytest.importorskip("mujoco")

LINK = """<body name="{0}_link" pos="0 0 0.3"><joint name="{0}" axis="0 1 0" armature="0.1"/>
<inertial pos="0 0 0.1" mass="2" diaginertia="0.02 0.02 0.01"/>"""
NAMES = ("base", "shoulder", "elbow")
ROBOT = f"<mujoco><worldbody>{''.join(map(LINK.format, NAMES))}{'</body>' * 3}</worldbody></mujoco>"
MASS, ARMATURE = "body/elbow_link/mass", "joint/shoulder/armature"
UNITS = {STIFFNESS: "N·m/rad", DAMPING: "N·m·s/rad"}
FELT = frozenset({"shoulder", "elbow"})


def wrong(*keys):
    values = {key: Moved(2.0, Estimate(np.float64(2.4), np.float64(0.1), "kg")) for key in keys}
    text = f"Wrong in the simulator: {', '.join(keys)}; 9% of the unexplained force."
    return Finding(MISMATCH, "", text, (), "", values, 0.9, None, 0.002)


def explained(left, *findings):
    """Of a tenth of the force so much is left."""
    names = ("force_error", "filtered_force_error")
    fit = {name: {"before": 0.1, "after": left} for name in names}
    fit |= {f"holdout_{names[0]}": None, f"filtered_holdout_{names[0]}": None}
    return Explanation("explained", [], list(findings), fit, [], None, None, "", {}, {})


def joints(base, shoulder, elbow):
    """The answer by which the joints are left with so much, the last two with wrong values."""
    values = wrong("joint/base/damping"), wrong(ARMATURE, MASS), wrong(MASS)
    told = map(explained, (base, shoulder, elbow), values)
    simulators = [Mujoco(ROBOT, name) for name in NAMES]
    return [
        Joint(name, each, "", [], simulator, [])
        for name, each, simulator in zip(NAMES, told, simulators, strict=True)
    ]


def spring(share=0.9):
    known = {n: Estimate(np.float64(90.0), np.float64(1.0), unit) for n, unit in UNITS.items()}
    return ElasticJoint("elbow", known, share, share, FELT)


@pytest.fixture
def answered(monkeypatch, tmp_path):
    """The answer where one without a spring leaves 1 % of the force, and what is `found`; `again`:
    the joints with a spring.
    """
    path = tmp_path / "robot.xml"
    path.write_text(ROBOT)

    def answer(*found, again=None, first=None):
        some = itertools.chain(found, itertools.repeat(None))
        monkeypatch.setattr(transmissions, "elastic_joint", lambda *_: next(some))
        first = joints(0.01, 0.01, 0.01) if first is None else first

        def by(source):
            return first if source == str(path) else again

        return transmissions.with_springs(by, Namespace(mujoco=str(path)), lambda text: None)

    return answer


def effects(answer, name):
    told = next(joint.told for joint in answer.joints if joint.name == name)
    return [finding.effect for finding in told.findings]


def sure(answer):
    return [bool(joint.told.findings[-1].parameters) for joint in answer.joints]


def test_a_spring_that_leaves_less_is_in_the_model_and_told(answered):
    answer = answered(spring(), again=joints(0.01, 0.003, 0.003))
    assert 'name="elbow_elastic" stiffness="90"' in answer.source
    assert effects(answer, "elbow") == [COMPLIANCE.name, MISMATCH]
    # What a joint does not feel it is not told of.
    assert effects(answer, "base") == [MISMATCH]
    (told, _) = next(j.told.findings for j in answer.joints if j.name == "elbow")
    assert (
        "transmission of joint elbow gives" in told.sentence and "a spring of 90" in told.sentence
    )


def test_a_spring_with_which_a_joint_is_left_with_more_is_not(answered):
    answer = answered(spring(), again=joints(0.02, 0.003, 0.003))
    assert "elastic" not in answer.source and effects(answer, "elbow") == [MISMATCH]
    assert sure(answer) == [True, True, True]


def test_beside_a_spring_that_does_as_well_no_value_is_sure(answered):
    def others():
        base, shoulder, _ = joints(0.01, 0.01, 0.01)
        told = explained(0.01, wrong("joint/elbow/damping"))
        return [base, shoulder, shoulder._replace(name="elbow", told=told)]

    answer = answered(spring(), again=others())
    assert "elastic" not in answer.source and sure(answer) == [True, False, False]
    # A twentieth of what no value explains is no reason to doubt those that explain the rest.
    assert sure(answered(spring(0.05), again=others())) == [True, True, True]
    # Nor is a spring beside which the same values are wrong.
    assert sure(answered(spring(), again=joints(0.01, 0.01, 0.01))) == [True, True, True]


def test_two_springs_are_told_without_their_stiffness(answered):
    other = spring(0.4)._replace(joint="shoulder")
    # Found; asked once more, the same; then another one beside it.
    answer = answered(spring(), None, other, again=joints(0.01, 0.003, 0.003))
    assert "elastic" not in answer.source and sure(answer) == [True, False, False]
    (warning,) = answer.joints[2].told.warnings
    assert "transmission of joint elbow and shoulder may give" in warning["text"]
    assert "neither stiffness is told" in warning["text"]


def test_a_second_spring_that_does_next_to_nothing_is_no_doubt_of_the_first(answered):
    with_it = joints(0.01, 0.003, 0.003)
    felt = frozenset({"shoulder"})
    for more in (spring(0.4)._replace(joint="shoulder"), Suspicion("shoulder", "?", 0.4, felt)):
        # Of the 6 % that the first leaves.
        answer = answered(spring(0.94), None, more, again=with_it)
        assert 'name="elbow_elastic"' in answer.source
        assert effects(answer, "elbow") == [COMPLIANCE.name, MISMATCH]
        assert not any(joint.told.warnings for joint in answer.joints)
    # Beside one that leaves less than any spring has to take no other one is looked for.
    doubt = spring(1.0)._replace(joint="shoulder")
    assert 'name="elbow_elastic"' in answered(spring(0.98), None, doubt, again=with_it).source


def test_beside_a_doubtful_spring_no_value_is_sure_that_may_stand_for_it(answered):
    doubt = Suspicion("elbow", "its stiffness is not told", 0.6, frozenset({"shoulder"}))
    answer = answered(doubt)
    # The elbow hardly feels it, but says the same of its link.
    assert sure(answer) == [True, False, False]
    _, shoulder, _ = (joint.told for joint in answer.joints)
    assert shoulder.verdict == "partly_explained"
    (finding,) = shoulder.findings
    assert set(finding.untold) == {MASS, ARMATURE} and "not sure" in finding.sentence
    (warning,) = shoulder.warnings
    assert "transmission of joint elbow may give" in warning["text"]


def test_where_the_robot_is_as_its_model_no_spring_is_looked_for(answered):
    fine = dataclasses.replace(explained(0.01), verdict="consistent")
    consistent = [joint._replace(told=fine) for joint in joints(0.01, 0.01, 0.01)]
    assert answered(spring(), first=consistent).joints == consistent
