"""A base that is tilted is gravity of another direction: no zero of an encoder, no physics."""

import json

import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import Recording, cli
from jaxfric.explanation.acceptance import LINEARITY
from jaxfric.explanation.bodies import Bodies
from jaxfric.explanation.joint_rows import by_chance, joint_rows, missing, needless
from jaxfric.explanation.sanity import Part, faults
from jaxfric.explanation.sanity.faults import Faults, FaultSearch
from jaxfric.models import Model
from jaxfric.simulators import Mujoco
from jaxfric.simulators.weights import GRAVITY, weights
from jaxfric.terms import Gravity, Sum

mujoco = pytest.importorskip("mujoco")

ARM = """<mujoco><compiler angle="radian"/>
<option gravity="{gravity}" timestep="0.001" integrator="implicitfast"/><worldbody>
<body name="b1" pos="0 0 .2">
 <joint name="yaw" axis="0 0 1" damping="1.2" frictionloss="1.1" armature="{armature}"/>
 <inertial pos=".03 0 .1" mass="6" diaginertia=".05 .05 .04"/>
 <body name="b2" pos="0 0 .2">
  <joint name="shoulder" axis="0 1 0" damping="1" frictionloss="1.2" armature=".4"/>
  <inertial pos=".18 0 0" mass="4.2" diaginertia=".01 .06 .06"/>
  <body name="b3" pos=".4 0 0">
   <joint name="elbow" axis="0 1 0" damping=".5" frictionloss=".7" armature=".12"/>
   <inertial pos=".15 .02 0" mass="2.1" diaginertia=".005 .025 .025"/>
  </body></body></body></worldbody></mujoco>"""
JOINTS = ("yaw", "shoulder", "elbow")
UNITS = {"force": "N·m", "position": "rad"}
TILTED = np.array([0.593, 0.342, -9.786])
GIVEN = ARM.format(gravity="0 0 -9.81", armature=0.35)
PLANT = ARM.format(gravity=" ".join(map(str, TILTED)), armature=0.50)


def course(time):
    """Position, velocity and acceleration of all joints, `(N, 3)` each."""
    rates = 2 * np.pi * np.array([[0.11, 0.31], [0.17, 0.43], [0.23, 0.37]])
    sizes = np.array([[0.8, 0.25], [0.4, 0.15], [0.5, 0.2]])
    angle = rates * time[:, None, None] + np.array([[0.3, 1.0], [2.0, 0.5], [4.0, 1.7]])
    waves = sizes * np.sin(angle), sizes * rates * np.cos(angle), -sizes * rates**2 * np.sin(angle)
    return [wave.sum(axis=2) for wave in waves]


def parts(plant, moved=(0.0, 0.0, 0.0)):
    """All joints' recordings beside the simulator as given; by how much each encoder is off."""
    time, draw = np.arange(0, 20, 0.005), np.random.default_rng(2)
    model = mujoco.MjModel.from_xml_string(plant)
    data, (position, velocity, acceleration) = mujoco.MjData(model), course(time)
    force = np.empty_like(position)
    for i in range(len(time)):
        data.qpos[:], data.qvel[:], data.qacc[:] = position[i], velocity[i], acceleration[i]
        mujoco.mj_inverse(model, data)
        force[i] = data.qfrc_inverse
    force += 0.15 * draw.normal(size=force.shape)
    seen, shared = position + np.array(moved), dict[bytes, object]()
    return [
        Part(
            Recording(
                time, force[:, j], seen[:, j], units=UNITS,
                channels={JOINTS[k]: seen[:, k] for k in range(3) if k != j},
            ),
            None, Mujoco(GIVEN, name, shared=shared), name,
        )
        for j, name in enumerate(JOINTS)
    ]  # fmt: skip


def test_a_tilt_is_gravity_and_no_zero():
    """Shoulder and elbow by themselves feel it as a wrong zero of the shoulder."""
    tilted = parts(PLANT)
    recorded = [faults._rows(part) for part in tilted]
    alone = faults._searched(tilted[1:], recorded[1:], Faults())
    assert alone.faults.zeros.keys() == {"shoulder"} and alone.left > 0.1
    assert not faults.find(tilted[1:]).faults.zeros
    beside = faults._searched(tilted, recorded, Faults(), gravity=True)
    gravity = {name for name in beside.chosen if name.startswith("option/gravity")}
    assert {"option/gravity/x", "option/gravity/y"} <= gravity and beside.left < 0.01
    assert set(beside.chosen) - gravity == {"joint/yaw/armature"}


@pytest.mark.parametrize(
    ("chosen", "left", "says"),
    [
        (("body/b3/mass", "body/b3/centre_z"), 0.105, True),
        (("body/b3/mass", "body/b3/centre_z"), 0.12, False),  # clearly more
        (("body/b3/mass", "body/b2/centre_z"), 0.10, False),  # another body is wrong, too
        (("body/b3/mass", "joint/yaw/armature"), 0.10, False),
        (("body/b3/mass", "body/b3/centre_z", "body/b3/centre_x"), 0.05, False),  # more numbers
    ],
)
def test_a_body_that_is_another_one_anyway_stands_for_a_zero(monkeypatch, chosen, left, says):
    monkeypatch.setattr(faults, "_enough", lambda rows: 0.01)
    monkeypatch.setattr(faults, "_energy", lambda rows: 1.0)
    seen = FaultSearch(Faults({"elbow": 0.08}), {}, ("body/b3/mass",), [], 0.10)
    plain = FaultSearch(Faults(), {}, chosen, [], left)
    assert faults._says_as_much(plain, seen, []) is says


def test_a_zero_stays_a_zero_beside_gravity():
    found = faults.find(parts(GIVEN, (0.0, 0.06, 0.0))).faults
    assert found.zeros.keys() == {"shoulder"}
    assert found.zeros["shoulder"] == pytest.approx(0.06, abs=2e-3)


@pytest.mark.parametrize(
    ("chosen", "left", "more"),
    [
        (("a",), 0.10, False),  # as many numbers, as good: the zero stands
        (("a",), 0.05, True),  # clearly less
        ((), 0.10, True),  # fewer
        (("a", "b"), 0.08, False),  # more numbers have to halve it
        (("a", "b"), 0.01, True),
        (("a", "b", "c", "d", "e", "f"), 0.0, False),  # another machine
    ],
)
def test_gravity_stands_for_a_zero_where_it_explains_more(monkeypatch, chosen, left, more):
    monkeypatch.setattr(faults, "_enough", lambda rows: 0.01)
    monkeypatch.setattr(faults, "_energy", lambda rows: 1.0)
    seen = FaultSearch(Faults({"shoulder": 0.03}), {}, (), [], 0.10)
    other = FaultSearch(Faults(), {}, chosen, [], left)
    assert faults._explains_more(other, seen, []) is more


def test_an_unbalance_that_gravity_accounts_for_is_needless():
    """Beside the file's gravity it is needed; so it is beside a centre that gravity pulls on."""
    tilted, rows = parts(PLANT), []
    for part in tilted:
        base = part.simulator.baseline(part.recording.units).term
        term = Sum((*base.terms, Gravity()))
        model = Model(term, jnp.zeros(len(term.affine)), part.recording.units)
        gone = missing(model)
        rows.append(
            joint_rows(part.simulator, part.recording, model, 0.0, LINEARITY, needless=gone)
        )
        last = model
    simulator = tilted[0].simulator
    bodies = weights(simulator.mujoco, simulator.model)
    robot = Bodies(rows, bodies, simulator.model.opt.gravity)
    gravity = dict(zip(GRAVITY, TILTED, strict=True))
    right = gravity | {"yaw:joint/yaw/armature": 0.15}
    wrong = gravity | {"body/b1/centre_x": 0.1615}
    for state, told in ((right, 1), (wrong, 0), ({}, 0)):
        assert len(needless(rows[0], last, robot.shift(state)[robot.at(0)])) == told


def test_what_noise_puts_into_directions_at_most():
    """Of white noise hardly a draw is beyond; of noise that is correlated over a block neither."""
    draw, block = np.random.default_rng(0), np.arange(800) // 20
    basis = np.linalg.qr(draw.normal(size=(800, 12)).cumsum(axis=0))[0]
    beyond = 0
    for _ in range(200):
        noise = np.convolve(draw.normal(size=805), np.ones(6), "valid")
        beyond += np.sum((basis.T @ noise) ** 2) > by_chance(basis, noise, block)
    assert beyond <= 4
    told = noise + 100 * basis[:, 3]
    assert np.sum((basis.T @ told) ** 2) > by_chance(basis, told, block)
    assert by_chance(basis[:, :0], noise, block) == 0.0


@pytest.mark.slow
def test_a_tilt_beside_an_armature_is_all_that_is_told(tmp_path, capsys):
    (tmp_path / "arm.xml").write_text(GIVEN)
    log(tmp_path / "log.csv", PLANT)
    command = ["explain", str(tmp_path / "log.csv"), "--mujoco", str(tmp_path / "arm.xml")]
    assert cli.main([*command, "--json", str(tmp_path / "out.json")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "zero" not in said and "body b1: centre" not in said and "not all" not in said
    rows = json.loads((tmp_path / "out.json").read_text())["joints"]
    assert [row["verdict"] for row in rows] == ["explained"] * 3
    values = {}
    for row in rows:
        for finding in row["explanation"]["findings"]:
            assert finding["effect"] == "parameter_mismatch"
            values |= {name: own["to"] for name, own in finding["parameters"].items()}
    gravity = {f"option/gravity/{letter}": g for letter, g in zip("xyz", TILTED, strict=True)}
    assert values.keys() == gravity.keys() | {"joint/yaw/armature"}
    assert values.pop("joint/yaw/armature") == pytest.approx(0.50, abs=0.003)
    assert values == pytest.approx(gravity, abs=0.02)


def log(path, plant):
    """A log of all joints under a controller, at 250 Hz, with noise."""
    model = mujoco.MjModel.from_xml_string(plant)
    data, draw = mujoco.MjData(model), np.random.default_rng(4)
    time = np.arange(0, 20, 0.001)
    wanted, speed, _ = course(time)
    data.qpos[:], data.qvel[:] = wanted[0], speed[0]
    table, gains = [], np.array([900.0, 900.0, 300.0])
    for i in range(len(time)):
        force = gains * (wanted[i] - data.qpos) + 0.06 * gains * (speed[i] - data.qvel)
        if i % 4 == 0:
            table.append([time[i], *data.qpos, *force])
        data.qfrc_applied[:] = force
        mujoco.mj_step(model, data)
    table = np.array(table)
    table[:, 1:4] += 1e-5 * draw.normal(size=(len(table), 3))
    table[:, 4:] += 0.003 * table[:, 4:].std(axis=0) * draw.normal(size=(len(table), 3))
    columns = [f"{name}_{what}" for what in ("position", "force") for name in JOINTS]
    np.savetxt(path, table, delimiter=",", header=",".join(["time", *columns]), comments="",
               fmt="%.9g")  # fmt: skip
