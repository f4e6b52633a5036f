"""A joint of a robot whose transmission gives: a spring between its motor and its link."""

import json

import numpy as np
import pytest

import jaxfric as jf
from jaxfric import cli
from jaxfric.explanation import spring_trial
from jaxfric.explanation.agreement import Told
from jaxfric.explanation.elasticity import STIFFNESS, ElasticJoint, elastic_joint
from jaxfric.export.springs import new_springs
from jaxfric.simulators import Mujoco, elastic
from jaxfric.simulators.swing import swing

mujoco = pytest.importorskip("mujoco")

ARM = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.001" integrator="implicitfast"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" damping="0.8" armature="0.08"/>
      <inertial pos="0 0 -0.22" mass="3.0" diaginertia="0.05 0.05 0.006"/>
      <body name="fore" pos="0 0 -0.45">
        <joint name="elbow" axis="0 1 0" damping="0.3" armature="{armature}"/>
        <inertial pos="0 0 -0.18" mass="{mass}" diaginertia="0.02 0.02 0.003"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
NAMES = ("shoulder", "elbow")
SECONDS, RATE, SUB = 14.0, 500, 8


def arm(mass=1.6, armature=0.03):
    return ARM.format(mass=mass, armature=armature)


def sprung(stiffness, damping=0.5, **other):
    return elastic.with_spring(mujoco, arm(**other), 1, stiffness, damping, None)


def recorded(text, seed=0, noise=0.003):
    """A table of time, positions and forces of both motors, as a controller moves the arm."""
    draw, model = np.random.default_rng(seed), mujoco.MjModel.from_xml_string(text)
    model.opt.timestep = 1 / RATE / SUB
    names = [model.joint(i).name for i in range(model.nv)]
    at, data = [names.index(name) for name in NAMES], mujoco.MjData(model)
    rates = 2 * np.pi * draw.uniform(0.3, 2.6, (2, 5))
    sizes, phases = draw.uniform(0.06, 0.12, (2, 5)) * 2, draw.uniform(0, 6, (2, 5))
    gains, rates_of = np.array([900.0, 120.0]), np.array([45.0, 6.0])
    rows = []
    for i in range(int(SECONDS * RATE)):
        time = i / RATE
        fade = min(time, 1.0) ** 2
        wanted = fade * np.sum(sizes * np.sin(rates * time + phases), axis=1)
        speed = fade * np.sum(sizes * rates * np.cos(rates * time + phases), axis=1)
        force = gains * (wanted - data.qpos[at]) + rates_of * (speed - data.qvel[at])
        rows.append([time, *np.array(data.qpos[at]), *force])
        data.qfrc_applied[at] = force
        for _ in range(SUB):
            mujoco.mj_step(model, data)
    table = np.array(rows)
    table[:, 1:3] += 2e-6 * draw.normal(size=(len(table), 2))
    table[:, 3:] += noise * table[:, 3:].std(axis=0) * draw.normal(size=(len(table), 2))
    return table


def logs(table):
    """The recordings of both joints."""
    units = {"force": "N·m", "position": "rad"}
    return [
        jf.Recording(
            table[:, 0], table[:, 3 + i], table[:, 1 + i], units=units,
            channels={NAMES[1 - i]: table[:, 2 - i]},
        )
        for i in range(2)
    ]  # fmt: skip


class Answered:
    """Of an explanation what the rows of a joint need."""

    fit = {"filtered_force_error": {"force_taken_later": 0.5 / RATE}}


def told(text, *tables):
    pairs = zip(NAMES, zip(*map(logs, tables), strict=True), strict=True)
    return [Told(Mujoco(text, name), own, Answered()) for name, own in pairs]


@pytest.mark.parametrize("ratio", [0.02, 0.3, 1.5])
def test_a_swing_is_exact_for_a_load_that_is_straight(ratio):
    mass, stiffness, time = 0.07, 60.0, np.linspace(0, 2, 201)
    damping = 2 * ratio * np.sqrt(stiffness * mass)
    begins, one = np.arange(len(time)) == 0, np.ones(len(time))
    load = 3 * np.sin(5 * time) + 2.0
    coarse = swing(time, begins, mass * one, damping * one, stiffness * one, load)
    fine = np.linspace(0, 2, 200_001)
    x, v, step = load[0] / stiffness, 0.0, fine[1]
    found = []
    for i, force in enumerate(np.interp(fine, time, load)):
        if i % 1000 == 0:
            found.append((x, v))
        v += step * (force - damping * v - stiffness * x) / mass
        x += step * v
    np.testing.assert_allclose(coarse.place, np.array(found)[:, 0], atol=3e-5)
    np.testing.assert_allclose(coarse.speed, np.array(found)[:, 1], atol=2e-3)
    balance = mass * coarse.acceleration + damping * coarse.speed + stiffness * coarse.place
    np.testing.assert_allclose(balance, load, rtol=1e-4, atol=1e-4)


def test_a_spring_is_a_second_joint_behind_the_motors():
    text = sprung(350.0)
    model = mujoco.MjModel.from_xml_string(text)
    assert elastic.springs_of(mujoco, model) == {2: 1}
    assert elastic.logged(mujoco, model, ["shoulder", "elbow", "elbow_elastic"]) == list(NAMES)
    assert model.jnt_stiffness[2] == 350 and model.dof_armature[2] == 0
    line = next(line for line in text.split("\n") if "elbow_elastic" in line)
    assert text.replace(line + "\n", "") == arm()
    rigid = mujoco.MjModel.from_xml_string(arm())
    assert elastic.springs_of(mujoco, rigid) == {}
    # A joint with a spring and an actuator is driven.
    motor = '<actuator><motor joint="elbow_elastic"/></actuator></mujoco>'
    driven = mujoco.MjModel.from_xml_string(text.replace("</mujoco>", motor))
    assert elastic.springs_of(mujoco, driven) == {}


def test_a_file_that_takes_no_spring_is_translated():
    assert elastic.taking(mujoco, arm(), None) == (arm(), "")
    assert elastic.taking(mujoco, sprung(350.0), None) == (sprung(350.0), "")
    ended = arm().replace('armature="0.03"/>', 'armature="0.03"></joint>')
    text, why = elastic.taking(mujoco, ended, None)
    assert "end tag" in why
    model = mujoco.MjModel.from_xml_string(elastic.with_spring(mujoco, text, 1, 9.0, 0.1, None))
    assert elastic.springs_of(mujoco, model) == {2: 1}


def test_the_motors_need_what_moved_the_arm_along_its_motion():
    table = recorded(sprung(350.0), noise=0.0)
    for text, least, most in ((arm(), 0.015, 0.5), (sprung(350.0), 0.0, 0.012)):
        for name, log in zip(NAMES, logs(table), strict=True):
            simulator = Mujoco(text, name)
            rest = (np.asarray(log.force) - simulator(log))[1000:-100]
            # The force is held over a sample; both signals pass a filter as wide as the kernel.
            weight = np.hanning(31) / np.hanning(31).sum()
            force = 0.5 * np.asarray(log.force)[1:] + 0.5 * np.asarray(log.force)[:-1]
            rest = (np.append(force[0], force) - simulator(log))[1000:-100]
            left = np.convolve(rest, weight, "valid")
            part = left.std() / np.convolve(force, weight, "valid").std()
            assert least < part < most, (name, part)


def test_where_a_spring_may_still_ring_nothing_is_compared():
    log = logs(recorded(arm(), noise=0.0))[1]
    model = mujoco.MjModel.from_xml_string(sprung(350.0, 0.5))
    since = elastic.ringing(mujoco, model, log)
    # Six of 2 s/c, the link's inertia 0.02 + 1.6 · 0.18².
    long = np.log(500.0) * 2 * 0.07184 / 0.5
    assert np.count_nonzero(since) / RATE == pytest.approx(long, abs=0.01)
    stiff = mujoco.MjModel.from_xml_string(sprung(350.0, 0.0))
    assert np.mean(elastic.ringing(mujoco, stiff, log)) == pytest.approx(0.25, abs=0.01)
    assert not elastic.ringing(mujoco, mujoco.MjModel.from_xml_string(arm()), log).any()


def test_what_mujoco_cannot_run_is_said():
    (good,) = new_springs(arm(), sprung(350.0))
    assert not good.why and 'name="elbow_elastic" stiffness="350"' in good.text
    (massless,) = new_springs(arm(armature=0), sprung(350.0, armature=0))
    assert "no armature" in massless.why and 'stiffness="350"' in massless.why
    (stiff,) = new_springs(arm(), sprung(1e6))
    assert "timestep below 0.00015" in stiff.why
    assert new_springs(sprung(350.0), sprung(350.0)) == []


def test_a_spring_is_no_neighbour():
    log = logs(recorded(arm(), noise=0.0))[0]
    channels = Mujoco(sprung(350.0), "shoulder").beside(log).channels
    assert any("elbow" in name for name in channels)
    assert not any("elastic" in name for name in channels)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stiffness", "mass"), [(90.0, 1.6), (350.0, 1.6), (900.0, 1.6), (350.0, 1.75)]
)
def test_the_stiffness_is_told_by_both_joints(stiffness, mass):
    tables = [recorded(sprung(stiffness, mass=mass), seed) for seed in (0, 1)]
    found = elastic_joint(told(arm(), *tables), arm(), None)
    assert isinstance(found, ElasticJoint) and found.joint == "elbow"
    assert found.felt == set(NAMES)
    known = found.estimates[STIFFNESS]
    # Where the link weighs something else the spring is told once that is known.
    tolerance = 0.03 if mass == 1.6 else 0.15
    assert float(known.value) == pytest.approx(stiffness, rel=tolerance)
    assert np.isinf(found.estimates["damping"].standard_error)
    assert found.share > 0.8 and found.held > 0.8


@pytest.mark.slow
@pytest.mark.parametrize("text", [arm(), arm(mass=1.9), sprung(3e4, 5.0)])
def test_no_spring_of_a_rigid_arm(text):
    tables = [recorded(text, seed) for seed in (2, 3)]
    assert elastic_joint(told(arm(), *tables), arm(), None) is None


def explained(tmp_path, text, model, *options):
    header = "time,shoulder_position,elbow_position,shoulder_torque,elbow_torque"
    for name, seed in (("log", 4), ("hold", 5)):
        table = recorded(text, seed)
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header=header, comments="")
    (tmp_path / "arm.xml").write_text(model)
    names = [str(tmp_path / name) for name in ("log.csv", "arm.xml", "hold.csv", "new.xml", "o")]
    command = ["explain", names[0], "--mujoco", names[1], "--holdout", names[2], "--save", names[3]]
    assert cli.main([*command, "--json", names[4], *options]) == 0
    return json.loads((tmp_path / "o").read_text()), (tmp_path / "new.xml").read_text()


@pytest.mark.slow
def test_a_transmission_that_gives_is_named_written_and_runs(tmp_path, capsys):
    table = recorded(sprung(350.0), 4)
    found, text = explained(tmp_path, sprung(350.0), arm())
    said = " ".join(capsys.readouterr().out.split())
    assert "The transmission of joint elbow gives" in said and "N·m/rad ±" in said
    for row in found["joints"]:
        assert row["verdict"] == "explained"
        (finding,) = row["explanation"]["findings"]  # and no value of any joint or body
        assert finding["effect"] == "compliance" and finding["confirmed"]
        assert finding["attribute"] == "joint/elbow_elastic/stiffness"
        assert finding["parameters"]["stiffness"]["value"] == pytest.approx(350, rel=0.03)
        assert finding["parameters"]["damping"]["standard_error"] is None
        assert row["file"]["holdout_force_error"] < 0.1 * row["filtered_force_error"]["before"]
    assert not found["patch"]["left"]
    line = next(line for line in text.split("\n") if "elbow_elastic" in line)
    assert text.replace(line + "\n", "") == arm()
    # The written file, driven by the same controller, moves as the arm did.
    runs = {"before": recorded(arm(), 4), "after": recorded(text, 4)}
    off = {when: np.abs(run[:, 4] - table[:, 4])[1000:].mean() for when, run in runs.items()}
    assert off["after"] < 0.3 * off["before"]


@pytest.mark.slow
def test_the_inertia_of_a_motor_that_the_file_lacks_is_found_beside_its_spring(tmp_path, capsys):
    found, text = explained(tmp_path, sprung(350.0), arm(armature=0.0))
    capsys.readouterr()
    assert not found["patch"]["left"]
    model = mujoco.MjModel.from_xml_string(text)
    assert model.jnt_stiffness[2] == pytest.approx(350, rel=0.1)
    assert model.dof_armature[1] == pytest.approx(0.03, rel=0.1)


def test_nodes_without_samples_have_times():
    """What is averaged over no sample is zero; beyond the nodes the last one is repeated."""
    times = np.array([1.0, 2.0, 3.0, 0.0, 5.0, 6.0, 0.0, 0.0, 9.0, 0.0, 9.0, 9.0])
    np.testing.assert_allclose(spring_trial._steady(times, 10), 1.0 + np.arange(12), rtol=1e-12)
