"""A multibody model's force in two parts, and by its own parameters, held against MuJoCo's own."""

import numpy as np
import pytest

import jaxfric as jf
from jaxfric.explanation.evidence import gather
from jaxfric.explanation.motion import motion_of
from jaxfric.simulation.errors import in_motion
from jaxfric.simulation.prediction import Prepared
from jaxfric.simulators.columns import GAIN, distinct
from jaxfric.simulators.inverse import Motion, along, forces
from jaxfric.terms import Dahl

mujoco = pytest.importorskip("mujoco")

ARM = """<mujoco><worldbody><body name="upper"><joint name="shoulder" axis="0 1 0" damping="0.1"
 armature="0.02" frictionloss="0.3"/>
 <geom type="capsule" fromto="0 0 0 .3 0 .1" size=".02" mass="1"/>
 <body name="fore" pos=".3 0 .1" euler="20 30 0">
 <joint name="elbow" axis="1 0 1" stiffness="2" springref="10" frictionloss="0.1"/>
 <inertial pos=".1 .02 .03" mass="2" diaginertia=".02 .03 .04" euler="10 20 30"/>
 <body name="hand" pos=".1 0 0"><joint name="grip" type="slide" axis="0 1 0" stiffness="3"/>
 <geom type="box" size=".1 .02 .05" pos=".1 0 0" mass="3"/></body></body></body></worldbody>
 <actuator><motor name="drive" joint="elbow" gear="40"/></actuator></mujoco>"""


def smooth(model, count=400, step=1e-3):
    """Positions, velocities and accelerations of sine waves, exactly."""
    draw = np.random.default_rng(0)
    time = step * np.arange(count)[:, None]
    rate, phase = draw.uniform(1, 5, model.nv), draw.uniform(0, 6, model.nv)
    angle = rate * time + phase
    return Motion(np.sin(angle), rate * np.cos(angle), -(rate**2) * np.sin(angle))


def slope(values, step=1e-3):
    """The derivative of fourth order; two at each end are lost."""
    inner = 8 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])
    return inner / (12 * step)


def test_the_force_is_a_rest_and_the_rate_of_a_momentum():
    model = mujoco.MjModel.from_xml_string(ARM)
    seen = along(mujoco, model, smooth(model))
    both = seen.rest[2:-2] + slope(seen.momentum)
    np.testing.assert_allclose(both, seen.force[2:-2], atol=1e-6 * np.abs(seen.force).max())


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_columns_are_the_derivatives_of_the_simulators_force(joint):
    model = mujoco.MjModel.from_xml_string(ARM)
    motion, name = smooth(model, 60), ("shoulder", "elbow", "grip")[joint]
    seen = along(mujoco, model, motion)
    found = distinct(mujoco, model, joint, name)
    for key, (rest, momentum) in zip(
        found.attributes, found.along(seen, 1e-3 * np.arange(60)), strict=True
    ):
        column = rest[2:-2] + slope(momentum)
        if key == GAIN:
            expected = seen.force[:, joint]
        else:
            step = 1e-5
            moved = [_moved(model, key, joint, sign * step) for sign in (1, -1)]
            pair = [along(mujoco, other, motion).force[:, joint] for other in moved]
            expected = (pair[0] - pair[1]) / (2 * step)
        np.testing.assert_allclose(
            column, expected[2:-2], atol=1e-4 * max(np.abs(expected).max(), 1), err_msg=key
        )


def _moved(model, key, joint, step):
    """The model with one of its own values moved."""
    model = mujoco.MjModel.from_xml_string(ARM)
    kind, owner, what = key.split("/")
    if kind == "joint":
        values = model.jnt_stiffness if what == "stiffness" else getattr(model, f"dof_{what}")
        values[joint] += step
        return model
    body = model.body(owner).id
    if what == "mass":
        model.body_inertia[body] *= 1 + step / model.body_mass[body]
        model.body_mass[body] += step
    else:
        values = model.body_ipos if what.startswith("centre") else model.body_inertia
        values[body, "xyz".index(what[-1])] += step
    return model


def test_what_no_motion_tells_apart_is_one_column():
    """Of the last joint's body the inertia about its axis is as its armature."""
    model = mujoco.MjModel.from_xml_string(ARM)
    found = distinct(mujoco, model, 2, "grip")
    assert found.attributes["joint/grip/armature"].alike == ()  # a mass has weight, too
    single = ARM.replace('<body name="hand" pos=".1 0 0"><joint name="grip"', "<!--").replace(
        "</body></body></body>", "--></body></body>"
    )
    model = mujoco.MjModel.from_xml_string(single)
    assert "body/upper/mass" not in distinct(mujoco, model, 1, "elbow").attributes
    assert distinct(mujoco, model, 1, "elbow").attributes[GAIN].owner == "actuator drive"


def stopping(count=16000, step=5e-4):
    """A joint that stops under dry friction: its recording, with the force that acted."""
    text = """<mujoco><option timestep="5e-4" integrator="implicitfast"/><worldbody><body>
     <joint name="hinge" axis="0 1 0" damping="0.2" frictionloss="3" armature="0.05"/>
     <geom type="capsule" fromto="0 0 0 .4 0 0" size=".02" mass="5"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data, position, force = mujoco.MjData(model), [], []
    data.qvel[0] = 2.0
    for time in step * np.arange(count):
        goal, speed = np.sin(2 * time), 2 * np.cos(2 * time)
        late = 60 * (goal - data.qpos) + 8 * (speed - data.qvel) + data.qfrc_bias
        data.qfrc_applied[:] = late
        position.append(data.qpos[0])
        force.append(late[0])
        mujoco.mj_step(model, data)
    counted = 5e-5 * np.round(np.array(position) / 5e-5)
    units = {"force": "N·m", "position": "rad"}
    return text, jf.Recording(step * np.arange(count), np.array(force), counted, units=units)


def test_where_its_friction_creeps_to_rest_nothing_is_compared():
    text, recording = stopping()
    simulator = jf.simulators.mujoco(text)
    force, known = np.asarray(recording.force), np.asarray(simulator(recording))
    seen = simulator.beside(recording)
    moving = in_motion(seen)
    # All but five stops of 0.12 s, which the derivative reaches into from either side, and but the
    # ends, where it has less than half of its samples on one side.
    reach = Prepared(seen).choice.half_width * 5e-4
    assert moving.mean() == pytest.approx(1 - (5 * (0.12 + 2 * reach) + reach) / 8, abs=0.02)
    wrong = np.linalg.norm((force - known)[moving | ~np.asarray(seen.mask)])
    left = np.linalg.norm((force - known)[moving])
    assert left < 0.015 * np.linalg.norm(force[moving])
    assert left < 0.7 * wrong


def test_where_its_friction_drives_before_the_axis_has_turned_nothing_is_compared():
    """At 60 rad/s² it changes its sign 0.5 rad/s before the motion does: no machine's friction."""
    text, _ = stopping(count=2)
    time, rate = 5e-4 * np.arange(8000), 10.0
    speed = 6.0 * np.sin(rate * time)
    position = -0.6 * np.cos(rate * time)
    smooth_model = mujoco.MjModel.from_xml_string(text.replace('frictionloss="3"', ""))
    motion = Motion(*(x[:, None] for x in (position, speed, 60.0 * np.cos(rate * time))))
    force = forces(mujoco, smooth_model, motion)[:, 0] + 3.0 * np.sign(speed)
    units = {"force": "N·m", "position": "rad"}
    recording = jf.Recording(time, force, position, units=units)
    seen = jf.simulators.mujoco(text).beside(recording)
    moving = in_motion(seen)
    left = (force - np.asarray(seen.channels["known_force"]))[moving]
    assert moving.mean() > 0.9
    assert np.max(np.abs(left)) < 0.05 * 3.0


def test_friction_that_builds_up_goes_on_where_the_simulators_force_is_not_compared():
    """Its reversals are masked, since MuJoCo's friction is soft there; the bristle bends on."""
    text, _ = stopping(count=2)
    time, distance, level = 1e-3 * np.arange(12000), 0.05, 3.0
    speed, position = 0.9 * np.sin(1.5 * time), -0.6 * np.cos(1.5 * time)
    smooth_model = mujoco.MjModel.from_xml_string(text.replace('frictionloss="3"', ""))
    motion = Motion(*(x[:, None] for x in (position, speed, 1.35 * np.cos(1.5 * time))))
    steps = np.diff(position, prepend=position[0])
    bent = [1.0]  # as in steady slip
    for step in steps[1:]:  # Dahl's equation, exact for each step
        bent.append(np.sign(step) + (bent[-1] - np.sign(step)) * np.exp(-abs(step) / distance))
    force = forces(mujoco, smooth_model, motion)[:, 0] + level * np.array(bent)
    units = {"force": "N·m", "position": "rad"}
    seen = jf.simulators.mujoco(text).beside(jf.Recording(time, force, position, units=units))
    assert not np.asarray(seen.mask).all()
    rows = gather(motion_of(seen))
    lacking = rows.columns(Dahl(), np.array([[distance]]))[0, :, 0]
    assert np.linalg.norm(rows.target) > 0.02 * np.linalg.norm(rows.force)
    assert np.linalg.norm(rows.target - level * lacking) < 0.02 * np.linalg.norm(rows.target)
    # A load on a spring begins anew after each: it swings by an acceleration that is derived.
    assert len(np.unique(rows.motion.segment)) == 1
    assert len(np.unique(rows.pieces)) >= 6
