"""A joint that another one pulls along: of a robot every other joint's velocity is tried."""

import numpy as np
import pytest

from jaxfric import Recording, cli, explain
from jaxfric.simulators import Mujoco
from jaxfric.terms import CrossAxis
from jaxfric.terms.effects.cross_axis import CROSS_AXIS, force_channels, neighbour_channel
from jaxfric.units import DAMPING, DIMENSIONLESS

mujoco = pytest.importorskip("mujoco")

GANTRY = """<mujoco><worldbody><body name="bridge"><joint name="x" type="slide" axis="1 0 0"
 damping="60" armature="6"/><inertial pos="0 0 0" mass="18" diaginertia="1 1 1"/>
<body name="carriage"><joint name="y" type="slide" axis="0 1 0" damping="30" armature="2"/>
<inertial pos="0 0 0" mass="6" diaginertia="0.1 0.1 0.1"/>
<body name="head"><joint name="turn.z" axis="0 0 1" damping="0.2" armature="0.05"/>
<inertial pos="0.05 0 0" mass="1" diaginertia="0.01 0.01 0.01"/></body></body></body>
</worldbody></mujoco>"""
JOINTS = ("x", "y", "turn.z")
UNITS = ({"force": "N", "position": "m"},) * 2 + ({"force": "N·m", "position": "rad"},)


@pytest.fixture(scope="module")
def motion():
    """Time, positions, velocities and forces of all joints, `(N, 3)`, by MuJoCo."""
    draw, time = np.random.default_rng(2), np.arange(0, 12, 0.002)
    rates = 2 * np.pi * np.array([[0.3, 0.7, 1.3], [0.4, 0.9, 1.1], [0.5, 0.6, 1.7]])
    phases, sizes = draw.uniform(0, 6, (3, 3)), np.array([0.3, 0.12, 0.06])
    angle = rates * time[:, None, None] + phases
    speed = (np.cos(angle) * rates) @ sizes
    position, acceleration = np.sin(angle) @ sizes, -(np.sin(angle) * rates**2) @ sizes
    model = mujoco.MjModel.from_xml_string(GANTRY)
    force, data = np.empty_like(position), mujoco.MjData(model)
    for i in range(len(time)):
        data.qpos[:], data.qvel[:], data.qacc[:] = position[i], speed[i], acceleration[i]
        mujoco.mj_inverse(model, data)
        force[i] = data.qfrc_inverse
    noisy = force + 0.005 * force.std(axis=0) * draw.normal(size=force.shape)
    return time, position + 1e-6 * draw.normal(size=position.shape), speed, noisy


def recording(motion, joint, more=0.0):
    """The recording of one joint beside the positions of the others, and its simulator."""
    time, position, _, force = motion
    others = {name: position[:, i] for i, name in enumerate(JOINTS) if i != joint}
    log = Recording(
        time, force[:, joint] + more, position[:, joint], units=UNITS[joint], channels=others
    )
    return log, Mujoco(GANTRY, JOINTS[joint])


def test_each_other_joint_is_a_candidate_in_its_own_units(motion):
    log, simulator = recording(motion, 2)
    laws = CROSS_AXIS.recorded(simulator.beside(log))
    assert [law.neighbour[0] for law in laws] == ["x", "x", "y", "y"]
    assert [p.dimension for p in laws[0].affine] == ["N·m·s²/m", "N·m·s/m"]
    assert [p.dimension for p in laws[1].affine] == ["m"]
    log, simulator = recording(motion, 0)
    y, by_force, turn, turned = CROSS_AXIS.recorded(simulator.beside(log))
    assert y.affine[1].dimension == DAMPING
    assert by_force.affine[0].dimension == DIMENSIONLESS
    assert turn.affine[1].dimension == "N·s/rad"
    assert turned.affine[0].dimension == "1/m"
    assert CROSS_AXIS.recorded(log) == ()


def test_a_joint_that_stands_pulls_nothing(motion):
    time, position, speed, force = motion
    log, simulator = recording((time, position * [1, 1, 0], speed, force), 1)
    assert {law.neighbour[0] for law in CROSS_AXIS.recorded(simulator.beside(log))} == {"x"}


@pytest.mark.slow
def test_the_neighbour_that_pulls_is_named(motion):
    found = explain(*recording(motion, 1, 15.0 * motion[2][:, 0]))
    (finding,) = found.findings
    assert finding.effect == "cross_axis" and found.verdict == "explained"
    assert finding.sentence.startswith("Joint x pulls along: ")
    drag = finding.parameters["coupling_viscous_x"]
    assert abs(float(drag.value) - 15) < 3 * float(drag.standard_error) + 0.05
    assert "N·s/m times its velocity" in finding.sentence


def test_the_dry_friction_of_a_neighbour_is_at_its_limit_as_soon_as_it_slips(motion):
    """MuJoCo's creeps about a reversal, as no friction of a machine does."""
    log, _ = recording(motion, 0)
    simulator = Mujoco(GANTRY.replace('damping="30"', 'damping="30" frictionloss="8"'), "x")
    seen, channels = simulator.along(log), simulator.beside(log).channels
    dry = np.asarray(channels[force_channels("y", "m")[0]]) - seen.rest[:, 1] + seen.friction[:, 1]
    assert dry == pytest.approx(8 * np.sign(seen.motion.velocity[:, 1]), abs=1e-6)
    assert np.any(np.abs(seen.friction[:, 1]) < 4)


@pytest.mark.slow
@pytest.mark.parametrize(("other", "share"), [(0, 0.3), (2, -2.0)])
def test_a_motor_that_rests_on_another_joint_is_told_by_its_force(motion, other, share):
    """A part of all that a neighbour needs, its friction too: no part of its acceleration."""
    found = explain(*recording(motion, 1, share * motion[3][:, other]))
    (finding,) = found.findings
    name = f"coupling_force_{JOINTS[other]}"
    assert finding.effect == "cross_axis" and set(finding.parameters) == {name}
    known = finding.parameters[name]
    assert abs(float(known.value) - share) < max(3 * float(known.standard_error), 0.01 * abs(share))
    assert known.unit == ("1" if other == 0 else "1/m")
    assert f"joint {JOINTS[other]} needs is needed here too" in finding.sentence


@pytest.mark.slow
def test_a_name_with_a_dot_and_another_kind_of_joint(motion):
    found = explain(*recording(motion, 0, 20.0 * motion[2][:, 2]))
    (finding,) = found.findings
    assert "Joint turn.z pulls along" in finding.sentence and "N·s/rad times" in finding.sentence
    assert float(finding.parameters["coupling_viscous_turn.z"].value) == pytest.approx(20, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("joint", [0, 1, 2])
def test_a_healthy_robot_stays_consistent(motion, joint):
    found = explain(*recording(motion, joint))
    assert found.verdict == "consistent" and found.findings == []


@pytest.mark.slow
def test_an_axis_that_the_model_lacks_is_named_by_its_column(motion, tmp_path, capsys):
    time, position, _, force = motion
    belt = 0.4 * np.sin(2 * np.pi * 0.37 * time) + 0.2 * np.sin(2 * np.pi * 1.9 * time + 1)
    pulled = force + np.array([0.0, 15.0, 0.0]) * belt[:, None]
    table = np.column_stack([time, position, pulled, belt])
    header = "time,x_position,y_position,turn.z_position,x_effort,y_effort,turn.z_effort,belt"
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=header, comments="", fmt="%.9g")
    (tmp_path / "gantry.xml").write_text(GANTRY)
    options = ["--mujoco", str(tmp_path / "gantry.xml"), "--joint", "y"]
    columns = ["--columns", "neighbour_velocity=belt"]
    assert cli.main(["explain", str(tmp_path / "log.csv"), *options, *columns]) == 0
    assert "The other axis pulls along" in " ".join(capsys.readouterr().out.split())


def test_the_law_is_the_same_whatever_the_channel():
    term = CrossAxis(("x", "m"))
    assert term.coordinates == {neighbour_channel("x", "m")}
    assert [p.name for p in term.affine] == ["coupling_inertia_x", "coupling_viscous_x"]
