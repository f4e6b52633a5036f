"""A simulator's closed loop run again with the recording's reference and controller."""

import json
import types

import numpy as np
import pytest

from jaxfric import Recording, cli
from jaxfric.data.joints import references_of
from jaxfric.explanation.evidence import gather
from jaxfric.explanation.motion import motion_of
from jaxfric.export import readback
from jaxfric.export.errors import as_read
from jaxfric.simulators import Mujoco, closed
from jaxfric.simulators.inverse import Motion
from jaxfric.simulators.patching import patched

mujoco = pytest.importorskip("mujoco")

PENDULUM = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>
<body name="arm"><joint name="elbow" axis="0 1 0" damping="{damping}" frictionloss="0.1"
 armature="0.02"/><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1"/></body>
</worldbody>{actuator}</mujoco>"""
SERVO = '<actuator><position name="m" joint="elbow" kp="50" kv="4"/></actuator>'


def model(damping=0.3, actuator=""):
    return PENDULUM.format(damping=damping, actuator=actuator)


def driven(text, seconds=4.0, every=2, servo=False):
    """A closed loop's log: k_p e + k_d ė + gravity, or the model's own servo."""
    plant = mujoco.MjModel.from_xml_string(text)
    data, rows = mujoco.MjData(plant), []
    for k in range(round(seconds / plant.opt.timestep)):
        t = k * plant.opt.timestep
        goal, speed = (
            0.5 * np.sin(4 * t) + 0.1 * np.sin(9 * t),
            2 * np.cos(4 * t) + 0.9 * np.cos(9 * t),
        )
        if k == 0:
            data.qvel[0] = speed
        mujoco.mj_step1(plant, data)
        force = 50 * (goal - data.qpos[0]) + 4 * (speed - data.qvel[0]) + data.qfrc_bias[0]
        rows.append((t, data.qpos[0], data.qvel[0], force, goal))
        if servo:
            data.ctrl[0] = goal
        else:
            data.qfrc_applied[0] = force
        mujoco.mj_step2(plant, data)
    t, q, v, force, goal = np.array(rows)[::every].T
    columns = (each[:, None] for each in (q, v, np.gradient(v, t), force, goal))
    q, v, a, force, goal = columns
    return closed.Log(t, Motion(q, v, a), force, goal)


def off(text, log, law, **acting):
    plant = mujoco.MjModel.from_xml_string(text)
    actuation = closed.ideal(1)._replace(**{k: np.array([v]) for k, v in acting.items()})
    run = closed.run(mujoco, plant, log, law, actuation)
    return float(np.sqrt(np.mean((run - log.motion.position) ** 2)))


def test_the_controller_is_read_off_the_log_and_the_loop_repeats_the_recording():
    log = driven(model())
    law = closed.law_of(mujoco, mujoco.MjModel.from_xml_string(model()), log)
    assert law.known and law.parts[:3] == ("position error", "velocity error", "gravity and motion")
    np.testing.assert_allclose(law.gains[0, :3], [50, 4, 1], rtol=0.05)
    assert off(model(), log, law) < 2e-4
    assert off(model(damping=0.9), log, law) > 20 * off(model(), log, law)


def test_a_controller_keeps_the_weight_that_it_knows():
    """Of one joint a wrong mass with a gain is the right one: the command is the same."""
    log, heavy = driven(model()), model().replace('mass="1"', 'mass="1.5"')
    laws = [
        closed.law_of(mujoco, mujoco.MjModel.from_xml_string(text), log)
        for text in (model(), heavy)
    ]
    assert laws[1].gains[0, 2] == pytest.approx(laws[0].gains[0, 2] / 1.5, rel=1e-3)
    for law in laws:
        assert off(model(), log, law) < 2e-4
    assert off(heavy, log, laws[0]) > 20 * off(model(), log, laws[0])


def test_a_command_that_is_no_law_of_the_reference_is_told():
    log = driven(model())
    noise = np.random.default_rng(0).normal(size=log.force.shape)
    law = closed.law_of(mujoco, mujoco.MjModel.from_xml_string(model()), log._replace(force=noise))
    assert not law.known


def test_the_models_own_servo_is_its_controller():
    text = model(actuator=SERVO)
    plant = mujoco.MjModel.from_xml_string(text)
    assert closed.servos(mujoco, plant) and not closed.servos(
        mujoco, mujoco.MjModel.from_xml_string(model())
    )
    assert off(text, driven(text, servo=True), None) < 1e-4


def test_gain_limit_and_dead_time_stand_between_command_and_joint():
    log = driven(model())
    law = closed.law_of(mujoco, mujoco.MjModel.from_xml_string(model()), log)
    plain = off(model(), log, law)
    top = 0.5 * float(np.abs(log.force).max())
    assert off(model(), log, law, gain=2.0) > 10 * plain
    assert off(model(), log, law, limit=top) > 10 * plain
    assert off(model(), log, law, delay=0.005) > 3 * plain


def test_what_was_put_right_is_written_as_attributes():
    done = patched(mujoco, model(), {"joint/elbow/ref": 0.1, "joint/elbow/actuatorfrcrange": 3.2})
    new = mujoco.MjModel.from_xml_string(done.text)
    assert new.qpos0[0] == pytest.approx(0.1) and not done.left
    np.testing.assert_allclose(new.jnt_actfrcrange[0], [-3.2, 3.2])
    sprung = model().replace('armature="0.02"', 'armature="0.02" stiffness="2" springref="10"')
    done = patched(mujoco, sprung, {"joint/elbow/ref": 0.1})
    new = mujoco.MjModel.from_xml_string(done.text)
    assert new.qpos_spring[0] == pytest.approx(np.radians(10) + 0.1)
    motor = model(actuator='<actuator><motor name="m" joint="elbow"/></actuator>')
    done = patched(mujoco, motor, {"actuator/m/delay": 0.006})
    if hasattr(mujoco.MjModel.from_xml_string(motor), "actuator_delay"):
        assert mujoco.MjModel.from_xml_string(done.text).actuator_delay[0] == pytest.approx(0.006)
    else:
        assert "actuator/m/delay" in done.left


def test_references_are_columns_too():
    names = ["t", "q_elbow", "tau_elbow", "elbow_position_cmd", "hip_position"]
    assert references_of(names, ["hip", "elbow"], {}) == {"elbow": "elbow_position_cmd"}
    names = ["t", "q1", "q2", "qref1", "qref2"]
    assert references_of(names, ["hip", "elbow"], {}) == {"hip": "qref1", "elbow": "qref2"}
    assert references_of(["goal"], ["hip"], {"hip_reference": "goal"}) == {"hip": "goal"}


@pytest.mark.slow
def test_the_command_runs_the_loops_again(tmp_path, capsys):
    log = driven(model(damping=0.9), seconds=12.0)
    noise = 0.005 * log.force.std() * np.random.default_rng(0).normal(size=log.force.shape)
    count = 2 * np.pi / 2**17
    position = count * np.round(log.motion.position / count)
    table = np.column_stack([log.time, position, log.force + noise, log.reference])
    header = "t,elbow_position,elbow_effort,elbow_reference"
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=header, comments="", fmt="%.9g")
    (tmp_path / "arm.xml").write_text(model())
    out = {name: str(tmp_path / name) for name in ("new.xml", "out.json", "out.html")}
    options = ["--save", out["new.xml"], "--json", out["out.json"], "--report", out["out.html"]]
    command = ["explain", str(tmp_path / "log.csv"), "--mujoco", str(tmp_path / "arm.xml")]
    assert cli.main([*command, *options]) == 0
    assert "run again" in capsys.readouterr().out
    (row,) = json.loads((tmp_path / "out.json").read_text())["patch"]["rerun"]["joints"]
    assert row["deviation"]["after"] < 0.1 * row["deviation"]["before"]
    track = row["tracking_error"]
    assert track["after"] == pytest.approx(track["recorded"], rel=0.02)
    assert abs(track["before"] / track["recorded"] - 1) > 0.02
    assert "Run again" in (tmp_path / "out.html").read_text()


CART = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="x" type="slide"
 axis="1 0 0" damping="4"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></worldbody>
 <actuator><general name="m" joint="x"{}/></actuator></mujoco>"""


def carted(seed, delay=0.0, lag=0.0, noise=0.01, rate=9.0):
    """A cart's motion and command, which is so much earlier, s, and ahead of a lag."""
    time = 1e-3 * np.arange(6000)
    phase, size = rate * (time + delay), 0.3 * rate
    force = 4 * size * np.cos(phase) - 2 * size * rate * np.sin(phase)
    force -= lag * rate * (4 * size * np.sin(phase) + 2 * size * rate * np.cos(phase))
    draw = noise * np.random.default_rng(seed).normal(size=(2, len(time)))
    units = {"force": "N", "position": "m"}
    position = 0.3 * np.sin(rate * time) + 1e-3 * draw[1]
    return Recording(time, force + draw[0], position, units=units)


def answered(logs, width=0.03):
    """What an explanation says of its own rows."""
    known = {"width": width, "force_taken_later": 0.0, "force_taken_later_after": 0.0}
    fit = {"filtered_force_error": known | {"across_reversals": False}}
    return types.SimpleNamespace(fit=fit), logs


LATE = {"delay": ' delay="0.02" nsample="10"', "lag": ' dyntype="filterexact" dynprm="0.02"'}


@pytest.mark.parametrize("what", LATE)
def test_a_file_with_a_late_actuator_is_measured_with_its_late_force(what):
    """20 ms at 9 rad/s are a fifth of the force, which the file's actuator accounts for."""
    told, logs = answered([carted(1, **{what: 0.02})])
    before, after = (Mujoco(CART.format(own)) for own in ("", LATE[what]))
    (errors,) = readback.errors(told, before, after, logs, None).values()
    assert errors["before"] > 0.1
    assert errors["file"] < 0.01


def test_a_held_out_recording_is_read_through_the_same_kernel():
    """By a kernel of its own it had another error, though nothing is new."""
    told, logs = answered([carted(1), carted(2)], 0.06)
    before, after = Mujoco(CART.format("")), Mujoco(CART.format(""))
    errors = readback.errors(told, before, after, logs, None)[readback.HELD]
    seen = before.beside(logs[1])
    rows = gather(motion_of(seen), reach=0.06)
    expected = np.linalg.norm(rows.target) / np.linalg.norm(rows.force)
    assert gather(motion_of(seen)).reach != pytest.approx(0.06, rel=0.1)
    assert errors["before"] == pytest.approx(expected, rel=1e-6) == errors["file"]


def test_a_log_that_was_put_right_is_said_beside_what_it_was():
    fit = {"filtered_force_error": {"before": 0.9, "after": 0.01}}
    told = types.SimpleNamespace(fit=fit, sanity=[{"check": "clock", "wrong": True}])
    text = as_read("x", told, {"force_error": {"before": 0.012, "file": 0.01}})
    assert text.endswith("of the log as it was read it was 90.00%")
    assert as_read("x", told, {"force_error": {"before": 0.9, "file": 0.01}}) == ""
