"""Sanity before physics: what is wrong with a log and no physics is told as itself, first."""

import dataclasses
import json

import numpy as np
import pytest

from jaxfric import Recording, cli, explain
from jaxfric.explanation import sanity
from jaxfric.explanation.sanity import Part, check_logs, faults, limits
from jaxfric.simulators import Known, Mujoco

mujoco = pytest.importorskip("mujoco")

ARM = """<mujoco><worldbody><body name="upper"><joint name="shoulder" axis="0 1 0" damping="0.8"
 frictionloss="0.3" armature="0.05"/><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"
 mass="2" contype="0"/><body name="forearm" pos="0.3 0 0"><joint name="elbow" axis="0 1 0"
 damping="0.5" frictionloss="0.15" armature="0.02"/><geom type="capsule" fromto="0 0 0 0.25 0 0"
 size="0.03" mass="1.2" contype="0"/></body></body></worldbody></mujoco>"""
JOINTS = ("shoulder", "elbow")
UNITS = {"force": "N·m", "position": "rad"}


@pytest.fixture(scope="module")
def motion():
    """Time, positions and forces of both joints, `(N, 2)`, by MuJoCo's inverse dynamics."""
    draw = np.random.default_rng(1)
    time = np.arange(0, 12, 0.002)
    rates = 2 * np.pi * np.array([0.3, 0.7, 1.3])
    phases, sizes = draw.uniform(0, 6, (2, 3)), np.array([0.5, 0.2, 0.1])
    angle = rates * time[:, None, None] + phases
    position, speed = np.sin(angle) @ sizes, np.cos(angle) @ (rates * sizes)
    force = needed(ARM, position, speed, -np.sin(angle) @ (rates**2 * sizes))
    count = 2 * np.pi / 2**17
    noisy = force + 0.005 * force.std(axis=0) * draw.normal(size=force.shape)
    return time, count * np.round(position / count), noisy


def needed(text, position, speed, acceleration):
    """The force of both joints along a motion, `(N, 2)`."""
    model = mujoco.MjModel.from_xml_string(text)
    force, data = np.empty_like(position), mujoco.MjData(model)
    for i, rate in enumerate(acceleration):
        data.qpos[:], data.qvel[:], data.qacc[:] = position[i], speed[i], rate
        mujoco.mj_inverse(model, data)
        force[i] = data.qfrc_inverse
    return force


def parts(time, position, force, model=ARM):
    """Both joints' recordings beside their simulators."""
    shared: dict = {}
    return [
        Part(
            Recording(
                time, force[:, j], position[:, j], units=UNITS,
                channels={JOINTS[1 - j]: position[:, 1 - j]},
            ),
            None, Mujoco(model, JOINTS[j], shared=shared), JOINTS[j],
        )
        for j in (0, 1)
    ]  # fmt: skip


def wrong(checked):
    return {check.effect: check for check in checked.checks if check.wrong}


def test_nothing_is_nothing(motion):
    for joint in check_logs(parts(*motion)):
        assert not wrong(joint) and not joint.changed and joint.wrong is None
        effects = [check.effect for check in joint.checks]
        assert effects == [
            "columns", "force_sign", "force_gain", "position_zero", "clock", "force_limit",
            "joint_limit",
        ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("joint", [0, 1])
def test_a_wrong_zero_is_a_zero_and_no_mass(motion, joint):
    time, position, force = motion
    moved = position + 0.1 * np.eye(2)[joint]
    checked = check_logs(parts(time, moved, force))
    for each in checked:
        assert set(wrong(each)) == {"position_zero"}
        zero = wrong(each)["position_zero"]
        assert zero.attribute == f"joint/{JOINTS[joint]}/ref"
        assert abs(zero.value.value - 0.1) < 3 * zero.value.standard_error + 2e-4
        assert each.power[1] < 0.01 * each.power[0]
    right = checked[1].part.simulator
    assert right.model.qpos0[joint] == pytest.approx(0.1, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.0, 2e-3])
def test_two_clocks(motion, rate):
    time, position, force = motion
    middle = (time[0] + time[-1]) / 2
    late = 0.03 + rate * (time - middle)
    shifted = np.stack([np.interp(time - late, time, f) for f in force.T], axis=1)
    for each in check_logs(parts(time, position, shifted)):
        assert set(wrong(each)) == {"clock"} and "another clock" in wrong(each)["clock"].text
        assert each.faults.late == pytest.approx(0.03, abs=1e-3)
        assert each.faults.drift == pytest.approx(rate, abs=1e-4)


def test_one_joint_that_is_late_is_found_beside_others_on_time(motion):
    time, position, force = motion
    late = np.column_stack([force[:, 0], np.interp(time - 0.03, time, force[:, 1])])
    shoulder, elbow = check_logs(parts(time, position, late))
    assert "clock" not in wrong(shoulder)
    assert elbow.faults.late == pytest.approx(0.03, abs=2e-3)


def test_a_joint_has_its_own_clock_where_the_log_has_none(motion, monkeypatch):
    late = faults.Faults(late=0.012, errors={"clock": 1e-4})

    def find(some, zeros=True):
        own = late if [part.name for part in some] == ["elbow"] else faults.Faults()
        return faults.FaultSearch(own, {}, (), [None] * len(some))

    monkeypatch.setattr(faults, "find", find)
    shoulder, elbow = faults.find_each(parts(*motion))
    assert not shoulder.faults.clock and elbow.faults.late == 0.012
    assert elbow.alone and not shoulder.alone


def test_a_force_that_acts_late_is_no_clock(motion):
    """A command that comes before its motion is a dead time, which is told from a lag elsewhere."""
    time, position, force = motion
    early = np.stack([np.interp(time + 0.01, time, f) for f in force.T], axis=1)
    assert not any(joint.changed for joint in check_logs(parts(time, position, early)))


def test_a_command_beyond_what_arrives_is_a_limit(motion):
    time, position, force = motion
    top = 0.8 * np.abs(force[:, 1]).max()
    arrived, units = np.clip(force[:, 1], -top, top), UNITS
    recording = Recording(time, force[:, 1], position[:, 1], units=units)
    (checked,) = check_logs([Part(recording, None, Known(arrived))])
    limit = wrong(checked)["force_limit"]
    assert limit.value.value == pytest.approx(top, rel=1e-3)
    assert f"in {np.count_nonzero(np.abs(force[:, 1]) > limit.value.value)} samples" in limit.text
    assert checked.power[1] < 0.01 * checked.power[0]


def test_a_soft_knee_is_no_hard_limit(motion):
    time, position, force = motion
    size = np.abs(force[:, 1])
    asked = force[:, 1] + np.sign(force[:, 1]) * 0.5 * np.maximum(size - 0.6 * size.max(), 0)
    recording = Recording(time, asked, position[:, 1], units=UNITS)
    assert "force_limit" not in wrong(check_logs([Part(recording, None, Known(force[:, 1]))])[0])


@pytest.mark.parametrize(("spread", "found"), [(0.002, True), (0.014, False)])
def test_what_is_needed_beyond_a_limit_is_one_value(spread, found):
    """A load that the simulator lacks asks for more as well, of a motion that needs any force."""
    draw, count = np.random.default_rng(0), 3000
    more = np.repeat(draw.integers(0, 4, count // 10), 10) == 0  # a quarter of the time
    needed = np.where(
        more, 0.083 + spread * draw.normal(size=count), draw.uniform(0.01, 0.07, count)
    )
    side = np.where(np.sin(np.arange(count) / 50) > 0, 1.0, -1.0)
    asked = needed + np.where(more, 0.02 + draw.exponential(0.06, count), 0)
    limit = limits.limit_of(side * asked, side * needed, side * draw.uniform(1, 2, count), "N")
    assert (limit is not None) == found


def test_friction_of_another_level_is_no_hard_limit(motion):
    """Where friction is nearly all of the force, what it is more by is like a command cut off."""
    time, position, force = motion
    way = np.sign(np.gradient(position[:, 1], time))
    known = 0.02 * force[:, 1] + np.std(force[:, 1]) * way
    for more in (0.3 * way, 0.3 * (way > 0)):
        recording = Recording(time, known + more * np.std(known), position[:, 1], units=UNITS)
        (checked,) = check_logs([Part(recording, None, Known(known))])
        assert "force_limit" not in wrong(checked)


def test_a_machine_that_warms_has_no_hard_limit(motion):
    """Where friction is nearly all of the force, what a cold machine needs beyond is flat too."""
    time, position, force = motion
    speed = np.gradient(position[:, 1], time)
    known = 0.02 * force[:, 1] + np.std(force[:, 1]) * np.sign(speed)
    for lasting in (0.2, 0.6):
        cold = np.exp(-time / (lasting * time[-1])) * speed / np.std(speed)
        recording = Recording(time, known + np.std(known) * cold, position[:, 1], units=UNITS)
        (checked,) = check_logs([Part(recording, None, Known(known))])
        assert "force_limit" not in wrong(checked)


def test_zeros_are_not_believed_where_few_columns_do_not_account_for_the_mismatch(motion):
    time, position, force = motion
    way = np.sign(np.gradient(position[:, 1], time))
    curved = np.std(force[:, 1]) * (way + np.cos(40 * position[:, 1]) * way)
    asymmetric = np.stack([force[:, 0], force[:, 1] + curved * (way > 0)], axis=1)
    for each in check_logs(parts(time, position, asymmetric)):
        assert "position_zero" not in wrong(each)


@pytest.mark.slow
def test_columns_of_another_joint(motion):
    time, position, force = motion
    for each, other in zip(
        check_logs(parts(time, position, force[:, ::-1])), JOINTS[::-1], strict=True
    ):
        assert f"is that of joint {other}" in each.wrong and f"{other}_force=NAME" in each.wrong
    for each in check_logs(parts(time, position[:, ::-1], force)):
        assert "positions of the joints shoulder and elbow are swapped" in each.wrong
    for each in check_logs(parts(time, position * [1, -1], force)):
        assert "position of joint elbow counts the other way" in each.wrong
    shoulder, elbow = check_logs(parts(time, position, force[:, [0, 0]]))
    assert shoulder.wrong is None and "one column for two joints" in elbow.wrong


def test_forces_are_swapped_on_a_robot_that_pauses(motion):
    """At rest nothing is compared, and nodes there have no time."""
    time, position, _ = motion
    way = np.cumsum((time > 1.5) & (np.abs(time - 7) > 0.6)) * (time[1] - time[0])
    way = np.convolve(np.pad(way, 200, mode="edge"), np.hanning(401) / 200, mode="valid")
    stopping = np.stack([np.interp(way, time, place) for place in position.T], axis=1)
    speed = np.gradient(stopping, time, axis=0)
    force = needed(ARM, stopping, speed, np.gradient(speed, time, axis=0))
    for each in check_logs(parts(time, stopping, force)):
        assert "columns" not in wrong(each) and each.wrong is None
    swapped = check_logs(parts(time, stopping, force[:, ::-1]))
    for each, other in zip(swapped, JOINTS[::-1], strict=True):
        assert f"is that of joint {other} in the simulator" in each.wrong
        assert "shoulder_force=NAME,elbow_force=NAME" in each.wrong


@pytest.mark.slow
def test_angles_in_degrees_and_columns_of_whole_joints_that_are_swapped(motion):
    time, position, force = motion
    for each in check_logs(parts(time, np.rad2deg(position), force)):
        assert "in degrees" in each.wrong and "--scale position=0.0174533" in each.wrong
    shoulder, elbow = check_logs(parts(time, position * [1, 180 / np.pi], force))
    assert "position of joint elbow is in degrees" in elbow.wrong
    assert "--scale elbow_position=0.0174533" in elbow.wrong
    assert shoulder.wrong == f"Nothing is compared: {elbow.wrong}"
    for each in check_logs(parts(time, position[:, ::-1], force[:, ::-1])):
        assert "columns of the joints shoulder and elbow are swapped" in each.wrong
        assert "elbow_position=NAME,elbow_force=NAME" in each.wrong


@pytest.mark.slow
def test_beside_forces_that_are_swapped_no_value_is_told(motion):
    swapped = parts(*motion)[1]
    other = dataclasses.replace(swapped.recording, force=parts(*motion)[0].recording.force)
    both = [parts(*motion)[0]._replace(recording=dataclasses.replace(
        parts(*motion)[0].recording, force=swapped.recording.force)), swapped._replace(
        recording=other)]  # fmt: skip
    checked = check_logs(both)[1]
    assert checked.wrong
    found = explain(other, checked)
    assert found.findings == [] and found.verdict == "unexplained"


def test_noise_on_a_flat_friction_is_no_limit(motion):
    time, position, force = motion
    flat = np.sign(np.gradient(position[:, 1], time))
    noisy = flat + 0.15 * np.random.default_rng(3).normal(size=len(flat))
    recording = Recording(time, noisy, position[:, 1], units=UNITS)
    limit = limits.Estimate(np.float64(1.0), np.float64(0.01), "N·m")
    assert limits.noisy(recording, limit)
    assert not limits.noisy(dataclasses.replace(recording, force=2 * force[:, 1] / np.std(
        force[:, 1])), limit)  # fmt: skip
    (checked,) = check_logs([Part(recording, None, Known(flat))])
    assert "force_limit" not in wrong(checked)


def test_sign_and_torque_constant(motion):
    time, position, force = motion
    shoulder, elbow = check_logs(parts(time, position, force * [-1.0, 1.15]))
    assert wrong(shoulder)["force_sign"].value.value == pytest.approx(-1.0, abs=2e-3)
    assert "torque constant is 1.15" in wrong(elbow)["force_gain"].text


def test_where_the_joint_is_at_its_limit_nothing_is_compared(motion):
    model = ARM.replace('name="elbow"', 'name="elbow" limited="true" range="-30 90"')
    elbow = check_logs(parts(*motion, model))[1]
    ends = np.asarray(elbow.part.simulator.limited(elbow.part.recording))
    assert 0 < ends.mean() < 0.5 and "at a limit of the joint" in wrong(elbow)["joint_limit"].text
    seen = elbow.beside(elbow.part.recording)
    assert not np.asarray(seen.mask)[ends].any()


def test_a_force_from_elsewhere_has_a_clock_and_a_limit_too(motion):
    time, position, force = motion
    late = np.interp(time - 0.02, time, force[:, 1])
    recording = Recording(time, late, position[:, 1], units=UNITS)
    (checked,) = check_logs([Part(recording, None, Known(force[:, 1]))])
    assert set(wrong(checked)) == {"clock"}
    assert checked.faults.late == pytest.approx(0.02, abs=1e-3)


@pytest.mark.slow
def test_an_explanation_tells_what_was_looked_at(motion):
    time, position, force = motion
    moved = position + [0.0, 0.1]
    recording = parts(time, moved, force)[1].recording
    found = explain(recording, Mujoco(ARM, "elbow"))
    (finding,) = found.findings
    assert finding.effect == "position_zero" and found.verdict == "explained"
    assert (
        found.fit["filtered_force_error"]["after"]
        < 0.2 * found.fit["filtered_force_error"]["before"]
    )
    document = json.loads(json.dumps(found.to_dict()))
    assert [row["check"] for row in document["sanity"] if row["wrong"]] == ["position_zero"]
    turned = dataclasses.replace(recording, position=-recording.position)
    assert (
        "elbow counts the other way" in sanity.check_log(turned, Mujoco(ARM, "elbow"), None).wrong
    )


@pytest.mark.slow
def test_the_command_names_the_columns_to_swap(motion, tmp_path, capsys):
    time, position, force = motion
    table = np.column_stack([time, position, force[:, ::-1]])
    header = "t,shoulder_position,elbow_position,shoulder_effort,elbow_effort"
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=header, comments="")
    (tmp_path / "arm.xml").write_text(ARM)
    options = ["--mujoco", str(tmp_path / "arm.xml"), "--report", str(tmp_path / "out.html")]
    assert cli.main(["explain", str(tmp_path / "log.csv"), *options]) == 0
    assert "the columns are permuted" in " ".join(capsys.readouterr().out.split())
    assert "Looked at before any physics" in (tmp_path / "out_elbow.html").read_text()


@pytest.mark.slow
def test_a_payload_picked_up_is_mass_of_the_last_body_from_its_moment_on(motion):
    time, position, force = motion
    speed = np.gradient(position, time, axis=0)
    acceleration = np.gradient(np.gradient(position, time, axis=0), time, axis=0)
    heavier = ARM.replace('mass="1.2"', 'mass="1.8"')
    more = [needed(text, position, speed, acceleration) for text in (ARM, heavier)]
    carried = force + np.where(time[:, None] > 6, more[1] - more[0], 0)
    found = explain(parts(time, position, carried)[1].recording, Mujoco(ARM, "elbow"))
    (finding,) = found.findings
    assert finding.effect == "payload_change" and finding.attribute == "body/forearm/mass"
    assert "body forearm's mass changes from 1.2 to 1.8" in finding.sentence
    assert "something was picked up" in finding.sentence
    moment, mass = (finding.parameters[n] for n in ("step_time", "payload_body/forearm/mass"))
    moved = finding.parameters["body/forearm/mass"]
    assert moved.before == 1.2 and float(moved.value) == pytest.approx(1.8, abs=0.02)
    assert float(moment.value) == pytest.approx(6.0, abs=0.2)
    assert float(mass.value) == pytest.approx(0.6, abs=0.02)


def test_a_motion_that_repeats_and_a_force_of_another_unit_are_no_clock():
    """A current beside a simulator without friction: half a period later it would be nearer."""
    time = np.arange(0, 12, 0.002)
    rate = 2 * np.pi * 0.5
    position, speed = np.sin(rate * time), rate * np.cos(rate * time)
    needed = -12.0 * rate**2 * position
    noise = 0.01 * np.random.default_rng(0).normal(size=time.shape)
    current = needed / 20 + 1.5 * np.tanh(speed / 1e-3) + 1.9 * speed + noise
    count = 2 * np.pi / 2**17
    log = Recording(time, current, count * np.round(position / count), units=UNITS)
    (joint,) = check_logs([Part(log, None, Known(needed))])
    assert not wrong(joint).keys() & {"clock", "force_limit", "end_stop"}


def bristled(stiffness, seed):
    """An axis whose friction builds up over a way, beside a simulator in which it jumps."""
    step, draw = 0.001, np.random.default_rng(seed)
    time = np.arange(0, 16, step)
    rates, sizes = 2 * np.pi * np.array([0.25, 0.8, 2.3]), np.array([0.02, 0.004, 0.0004])
    angle = rates * time[:, None] + draw.uniform(0, 6, 3)
    position, speed = np.sin(angle) @ sizes, np.cos(angle) @ (rates * sizes)
    plain = 20 * speed - 3 * np.sin(angle) @ (rates**2 * sizes)
    level = 14 + 3 * np.exp(-((speed / 0.01) ** 2))
    bent = np.zeros_like(time)
    for i in range(1, len(time)):
        rate = speed[i] - abs(speed[i]) * stiffness / level[i] * bent[i - 1]
        bent[i] = bent[i - 1] + step * rate
    noise = 0.15 * draw.normal(size=time.shape)
    log = Recording(time, plain + stiffness * bent + noise, position)
    return Part(log, None, Known(plain + level * np.sign(speed)))


@pytest.mark.parametrize(("stiffness", "seed"), [(70e3, 0), (20e3, 1)])
def test_friction_that_builds_up_over_a_way_is_no_clock(stiffness, seed):
    (axis,) = check_logs([bristled(stiffness, seed)])
    assert not wrong(axis)


def test_rows_that_a_shift_spoils_weigh_as_much_as_before():
    """They have more noise for it, which must not make what is left of them small."""
    part = bristled(70e3, 0)
    rows = faults._rows(part)
    (shifted,) = faults._put_right([part], [rows], faults.Faults(late=0.8))
    assert shifted.power > 4 * rows.power
    assert faults._energy([shifted]) > 4 * faults._energy([rows])


def test_a_factor_of_a_thousand_is_a_unit(motion):
    time, position, force = motion
    recording = Recording(time, 1000 * force[:, 1], position[:, 1], units=UNITS)
    (checked,) = check_logs([Part(recording, None, Known(force[:, 1]))])
    assert "nearly 10^3" in checked.wrong and "--units" in checked.wrong
    (checked,) = check_logs([Part(recording, None, Known(800 * force[:, 1]))])
    assert checked.wrong is None and "1.25" in wrong(checked)["force_gain"].text


def test_a_force_that_acts_by_its_own_state_says_nothing_of_the_torque_constant(motion):
    """What wrong values leave is most of it: neither their size nor their sign is told."""
    time, position, force = motion
    speed, state, states = np.gradient(position[:, 1], time), 0.0, []
    for each in speed * (time[1] - time[0]):
        state += each / 0.2 - abs(each) / 0.2 * state
        states.append(state)
    level = 3 * np.std(force[:, 1])
    real = force[:, 1] + level * np.array(states)
    recording = Recording(time, real, position[:, 1], units=UNITS)
    (checked,) = check_logs([Part(recording, None, Known(force[:, 1] + level * np.sign(speed)))])
    assert not {"force_gain", "force_sign"} & set(wrong(checked))
