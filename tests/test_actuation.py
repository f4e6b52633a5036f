"""A joint's actuator: its own values where the log is of its command, and not where it is not."""

import json

import numpy as np
import pytest

import jaxfric as jf
from jaxfric import cli
from jaxfric.explanation import attributes
from jaxfric.explanation.finding import Finding, Moved
from jaxfric.identification.uncertainty import Estimate
from jaxfric.simulators import Mujoco, actuation, closed
from jaxfric.simulators.inverse import Motion
from jaxfric.simulators.patching import patched
from jaxfric.terms.effects import EFFECTS

mujoco = pytest.importorskip("mujoco")

ARM = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody><body name="arm">
<joint name="hip" axis="0 1 0" damping="0.3" frictionloss="0.2" armature="0.02"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1"/></body></worldbody>
<actuator>{}</actuator></mujoco>"""
UNITS = {"force": "N·m", "position": "rad"}


def motor(gear=2):
    return ARM.format(f'<motor name="m" joint="hip" gear="{gear}"/>')


def general(gain=1.0, bias=(0.3, -0.7, -0.2), constant=0.0):
    law = f'gainprm="{gain}" biastype="affine" biasprm="{" ".join(map(str, bias))}"'
    law += f' dyntype="filterexact" dynprm="{constant}"' if constant else ""
    return ARM.format(f'<general name="m" joint="hip" gear="2" {law}/>')


def servo(kp=50, kv=4):
    return ARM.format(f'<position name="m" joint="hip" kp="{kp}" kv="{kv}"/>')


def goal(t, phase):
    rates, sizes = np.array([2.1, 5.3, 9.7]), np.array([0.5, 0.25, 0.1])
    angle = rates * t + phase * np.array([1, 2, 1])
    return np.sin(angle) @ sizes, np.cos(angle) @ (rates * sizes)


def run(text, seconds=2.0, phase=0.0, own=False, held=1):
    """Time, position, command, reference and joint's force of a closed loop over the actuator,
    whose command is new at every few steps.
    """
    plant = mujoco.MjModel.from_xml_string(text)
    data, rows = mujoco.MjData(plant), []
    data.qpos[0], data.qvel[0] = goal(0.0, phase)
    for k in range(round(seconds / plant.opt.timestep)):
        t = k * plant.opt.timestep
        place, speed = goal(t, phase)
        mujoco.mj_step1(plant, data)
        wanted = 20 * (place - data.qpos[0]) + 1.5 * (speed - data.qvel[0]) + data.qfrc_bias[0] / 2
        if k % held == 0:
            data.ctrl[0] = place if own else wanted
        if not k and plant.na:
            data.act[0] = data.ctrl[0]
        before, start = (t, data.qpos[0], data.ctrl[0], place), data.qvel[0]
        mujoco.mj_step2(plant, data)
        # An implicit integrator takes the speed of the step's end.
        braked = plant.actuator_biasprm[0, 2] * plant.actuator_gear[0, 0] ** 2
        rows.append((*before, data.qfrc_actuator[0] + braked * (data.qvel[0] - start)))
    return np.array(rows).T


def log(ran):
    return jf.Recording(ran[0], ran[2], ran[1], units=UNITS)


@pytest.mark.parametrize("text", [motor(), general(constant=0.02), servo()])
def test_the_force_is_what_the_model_makes_of_its_command(text):
    ran = run(text, own="position" in text)
    made = Mujoco(text, "hip", commanded=True).driven(log(ran))
    known = np.array(made.mask)
    known[:20] = known[-20:] = False
    off = np.asarray(made.force)[known] - ran[4][known]
    assert np.std(off) < 0.01 * np.std(ran[4])
    assert known.sum() == len(known) - 40 - (120 if "dynprm" in text else 0)
    np.testing.assert_array_equal(made.channels["known_command"], ran[2].astype(made.time.dtype))


@pytest.mark.parametrize("number", [0, 1, 2])
def test_the_bias_is_a_column_of_what_the_command_makes_too_much(number):
    bias = [0.3, -0.7, -0.2]
    recording = log(run(general(), 1.0))
    first = Mujoco(general(), "hip", commanded=True)
    bias[number] += 0.05
    second = Mujoco(general(bias=tuple(bias)), "hip", commanded=True)
    difference = np.asarray(first.driven(recording).force - second.driven(recording).force)
    key = {0: "actuator/m/biasprm[0]", 1: "joint/hip/stiffness", 2: "joint/hip/damping"}[number]
    if number:  # at the joint, which is named first, the other way and without the gear
        (alike,) = first.attributes()[key].alike
        assert str(alike) == f"biasprm[{number}] of actuator m"
    column = first.columns.makers[key](first.along(recording))[0]
    expected = 0.05 * (1.0 if number == 0 else -4.0) * column
    size = np.abs(expected).max()
    np.testing.assert_allclose(difference[20:-20], expected[20:-20], atol=0.02 * size)


def test_of_a_time_constant_the_column_is_exact_for_any_change():
    ran = run(general(constant=0.02))
    simulator = Mujoco(general(constant=0.008), "hip", commanded=True)
    made = simulator.driven(log(ran))
    seen, time = simulator.along(made), np.asarray(made.time)
    names = list(simulator.attributes())
    rest, momentum = simulator.columns.along(seen, time)[names.index("actuator/m/dynprm[0]")]
    inner = slice(300, -50)
    column = (rest + np.gradient(momentum, time))[inner]
    known = (seen.rest[:, 0] + np.gradient(seen.momentum[:, 0], time))[inner]
    left = np.asarray(made.force)[inner] - known
    found = float(column @ left / (column @ column))
    assert found == pytest.approx(0.012, rel=0.07)


def test_a_log_of_the_joints_force_tells_no_bias_and_says_so():
    text = general(constant=0.02)
    plain = Mujoco(text, "hip")
    assert not any("prm" in name for name in plain.attributes())
    (said,) = plain.standing
    assert "bias and time constant" in said and "--columns hip_command=NAME" in said
    assert Mujoco(motor(), "hip").standing == []
    (said,) = Mujoco(motor(), "hip", commanded=True).standing
    assert "makes of the recorded command" in said
    with pytest.raises(ValueError, match="driven"):
        Mujoco(motor(), "hip", commanded=True).beside(log(run(motor(), 0.5)))


def test_an_actuator_with_a_law_of_its_own_is_refused():
    integrator = ARM.format('<intvelocity name="m" joint="hip" kp="3" actrange="-1 1"/>')
    with pytest.raises(ValueError, match="give the joint's force"):
        Mujoco(integrator, "hip", commanded=True)
    with pytest.raises(ValueError, match="no actuator, or several"):
        Mujoco(ARM.format(""), "hip", commanded=True)


@pytest.mark.parametrize(
    "text, values, expected",
    [
        (motor(), {"biasprm[0]": 0.4}, {"bias": (0.4, 0, 0), "gear": 2.0}),
        (motor(), {"dynprm[0]": 0.01}, {"constant": 0.01, "bias": (0, 0, 0)}),
        (
            general(),
            {"gainprm[0]": 1.3, "biasprm[1]": -1.5},
            {"gain": 1.3, "bias": (0.3, -1.5, -0.2)},
        ),
        (servo(), {"kp": 60.0, "kv": 5.0}, {"gain": 60.0, "bias": (0, -60, -5)}),
        (servo(), {"kp": 60.0, "biasprm[0]": 1.0}, {"gain": 60.0, "bias": (1, -60, -4)}),
    ],
)  # fmt: skip
def test_what_is_written_is_what_mujoco_reads(text, values, expected):
    done = patched(mujoco, text, {f"actuator/m/{what}": value for what, value in values.items()})
    assert not done.left and len(done.written) == len(values)
    own = Mujoco(done.text, "hip", commanded=True).actuator
    for name, value in expected.items():
        assert getattr(own, name) == pytest.approx(value), name
    outside = [done.text.partition("<actuator>"), text.partition("<actuator>")]
    assert outside[0][0] == outside[1][0]
    if set(values) == {"kp", "kv"}:
        assert '<position name="m" joint="hip" kp="60" kv="5"/>' in done.text


def test_a_motor_with_an_end_tag_is_left():
    text = motor().replace("/></actuator>", "></motor></actuator>")
    done = patched(mujoco, text, {"actuator/m/biasprm[0]": 0.4})
    assert done.text == text and "end tag" in done.left["actuator/m/biasprm[0]"]


def test_the_loop_over_the_models_actuator_repeats_the_recording():
    text = general(constant=0.01)
    time, place, command, wanted, _ = run(text, 3.0)
    speed = np.gradient(place, time)
    columns = (each[:, None] for each in (place, speed, np.gradient(speed, time), command, wanted))
    q, v, a, u, r = columns
    record = closed.Log(time, Motion(q, v, a), u, r)
    plant = mujoco.MjModel.from_xml_string(text)
    law = closed.law_of(mujoco, plant, record)
    acting = closed.ideal(1)._replace(actuators={0: 0})
    again = closed.run(mujoco, plant, record, law, acting)
    assert law.known and np.std(again - q) < 1e-3 * np.std(q)
    # A law of the joint's force has nothing of what the actuator makes of no command beside it.
    alone = closed.run(mujoco, plant, record, law, closed.ideal(1))
    without = mujoco.MjModel.from_xml_string(ARM.format(""))
    np.testing.assert_allclose(alone, closed.run(mujoco, without, record, law, closed.ideal(1)))


def test_a_constant_force_without_an_attribute_says_what_it_may_be():
    own = Mujoco(motor(), "hip").attributes()
    moved = {"offset": Moved(0.0, Estimate(np.float64(0.4), np.float64(0.01), "N·m"))}
    finding = Finding("parameter_mismatch", "", "", (), "", moved, 0.9, None, 0.002)
    said = attributes._reworded(finding, own)
    assert attributes.MAY_BE in said.sentence and said.attribute is None


def test_of_a_servo_the_command_alone_may_be_late():
    text = servo()
    recording = log(run(text, own=True))
    made = Mujoco(text, "hip", commanded=True).driven(recording)
    feedback = np.asarray(made.channels["known_feedback"], float)
    command = np.asarray(made.force, float) - feedback
    later = EFFECTS["transport_delay"].undone(made, 0.004)
    expected = feedback + np.interp(made.time - 0.004, made.time, command)
    np.testing.assert_allclose(later.force, expected, atol=1e-3 * np.std(command))
    # A motor makes nothing of the motion, so that all of its force is the command's.
    plain = Mujoco(motor(), "hip", commanded=True).driven(log(run(motor())))
    assert "known_feedback" not in plain.channels


def test_a_servo_takes_the_speed_that_the_log_shows():
    """That of the model's integrator where the log is its own; of finer steps that of theirs."""
    fine, finer = (servo().replace('"0.001"', f'"{step}"') for step in ("0.0005", "0.0001"))
    for text, every, ahead in ((servo(), 1, 5e-4), (fine, 2, 2.5e-4), (finer, 10, 5e-5)):
        ran = np.array(run(text, own=True))[:, ::every]
        simulator = Mujoco(servo(), "hip", commanded=True)
        recording = log(ran)
        seen = simulator.along(recording)
        found = actuation._timely(simulator.actuator, recording, ran[2], seen, 0)
        # Within a fifth of the model's own.
        assert found.ahead == pytest.approx(ahead, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("held", [1, 2])
def test_a_servo_whose_command_is_held_has_nothing_wrong(held):
    ran, other = (
        np.array(run(servo(300, 18), 12.0, phase, own=True, held=held))[:, ::2]
        for phase in (0.0, 1.0)
    )
    simulator = Mujoco(servo(300, 18), "hip", commanded=True)
    logs = [simulator.driven(log(each)) for each in (ran, other)]
    found = jf.explain(logs[0], simulator, logs[1])
    assert found.findings == [] and found.fit["filtered_force_error"]["after"] < 0.01


@pytest.mark.slow
def test_a_command_that_is_held_is_no_damping():
    """The file's servo steps four times as coarsely as the machine, whose command is held for a
    millisecond: 0.4 ms of kp 300 are a damping of 0.12.
    """
    heavy = servo(300, 18).replace('armature="0.02"', 'armature="0.5"')
    machine = heavy.replace('"0.001"', '"0.00025"')
    ran, other = (
        np.array(run(machine, 12.0, phase, own=True, held=4))[:, ::8] for phase in (0.0, 1.0)
    )
    simulator = Mujoco(heavy, "hip", commanded=True)
    logs = [simulator.driven(log(each)) for each in (ran, other)]
    found = jf.explain(logs[0], simulator, logs[1])
    assert found.findings == [] and found.fit["filtered_force_error"]["after"] < 0.001
    late = found.fit["filtered_force_error"]["force_taken_later"]
    assert late == pytest.approx(-0.375e-3, abs=2e-5)


@pytest.mark.slow
def test_the_command_finds_bias_and_filter_writes_them_and_runs_again(tmp_path, capsys):
    ran = run(general(bias=(0.4, 0.0, 0.0)), 12.0)
    count = 2 * np.pi / 2**17
    table = np.column_stack([ran[0], count * np.round(ran[1] / count), ran[2], ran[3]])[::2]
    header = "t,hip_position,u,hip_reference"
    path, xml = tmp_path / "log.csv", tmp_path / "arm.xml"
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.9g")
    xml.write_text(motor())
    out, new = tmp_path / "out.json", tmp_path / "new.xml"
    options = ["--columns", "hip_command=u", "--json", str(out), "--save", str(new)]
    assert cli.main(["explain", str(path), "--mujoco", str(xml), *options]) == 0
    capsys.readouterr()
    document = json.loads(out.read_text())
    (finding,) = document["findings"]
    assert finding["attribute"] == "actuator/m/biasprm[0]"
    assert "actuator m: biasprm[0] 0 → 0.40" in finding["sentence"]
    assert "makes of the recorded command" in " ".join(document["recording"]["notes"])
    assert Mujoco(new, "hip", commanded=True).actuator.bias[0] == pytest.approx(0.4, abs=0.01)
    (row,) = document["patch"]["rerun"]["joints"]
    assert row["deviation"]["after"] < 0.1 * row["deviation"]["before"]
