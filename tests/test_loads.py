"""What a robot has picked up: one mass in one place, by all of its joints."""

import json

import numpy as np
import pytest

from jaxfric import cli
from jaxfric.explanation import loads
from jaxfric.explanation.loads import Load
from jaxfric.identification.uncertainty import Estimate
from jaxfric.simulators.weights import Weight
from jaxfric.terms import KnownColumns, Offset, PayloadChange
from jaxfric.terms.base import Sum
from jaxfric.terms.effects.steps import PAYLOAD_CHANGE, hanging
from tests.test_bodies import LOAD, arm, motion

mujoco = pytest.importorskip("mujoco")

FORE = Weight(1.2, np.array([0.1, 0.0, 0.0]), np.array([0.002, 0.009, 0.009]), np.eye(3))
TRUE = np.array([0.5, 0.24, 0.03, -0.02])


def test_a_load_changes_a_mass_alone_or_its_place_too():
    fore = [f"body/fore/{name}" for name in ("mass", "centre_x", "inertia_y")]
    names = ("joint/elbow/damping", "body/upper/mass", *fore)
    base = Sum((KnownColumns(names, ("1",) * len(names)), Offset()))
    loads_ = hanging(PayloadChange(), base, None)
    every = [f"payload_{name}" for name in fore]
    assert [[p.name for p in load.affine] for load in loads_] == [every[:1], every[:2], every]
    texts = [
        PAYLOAD_CHANGE.variant(dict.fromkeys([*every[:count], "step_time"], 0.1), None)
        for count in (1, 2, 3)
    ]
    assert texts[0].endswith("if its centre of mass is where that of body fore is")
    assert "its centre of mass along x by {payload_body/fore/centre_x}, or what" in texts[1]
    assert "{payload_body/fore/centre_x} and its inertia, or what makes the same" in texts[2]


def rows(draw, seen=10):
    """Rows by ten parameters of which some combinations show, with the load's force and noise."""
    columns = draw.normal(size=(400, seen)) @ draw.normal(size=(seen, 10))
    return columns, columns @ loads._of_point(TRUE) + 0.01 * draw.normal(size=400)


def test_a_mass_and_its_place_are_found():
    columns, target = rows(np.random.default_rng(0))
    found = loads._point(columns, target, FORE)
    assert found == pytest.approx(TRUE, rel=0.02, abs=0.002)
    assert loads._suffices(found, columns, target, [100, 300], [1e-9, 1e-9])
    slopes, step = loads._slopes(TRUE, FORE.extent()), 1e-6
    for i, unit in enumerate(np.eye(4)):
        sides = [loads._of_point(TRUE + sign * step * unit) for sign in (1, -1)]
        assert slopes[:, i] == pytest.approx((sides[0] - sides[1]) / (2 * step), abs=1e-8)


def test_what_is_no_mass_at_one_place_is_told_apart():
    draw = np.random.default_rng(1)
    columns, target = rows(draw)
    target = target + columns @ np.eye(10)[6]  # inertia about z that no point has
    found = loads._point(columns, target / 0.01, FORE)
    assert not loads._suffices(found, columns / 0.01, target / 0.01, [400], [1e-9])


def known(value, error, unit):
    return Estimate(np.float64(value), np.float64(error), unit)


def test_a_load_in_words():
    place = {"x": known(0.24, 0.002, "m"), "z": known(-0.02, 0.001, "m")}
    load = Load("fore", known(6.0, 0.02, "s"), known(-0.5, 0.01, "kg"), place)
    text = load.sentence(["shoulder", "elbow"])
    assert "has put down 0.500 kg ± 0.023 kg, at x = 0.2400 m ± 0.0046 m and z = -0.0200 m" in text
    assert text.endswith("in its frame (shoulder and elbow together).")
    assert set(load.parameters()) == {"step_time", "load_mass", "load_x", "load_z"}


def carried(path, seed, moment=6.5):
    """A log of both joints under a controller, the fore arm with a load from a moment on."""
    models = [mujoco.MjModel.from_xml_string(arm(load=load)) for load in ("", LOAD)]
    data, draw = mujoco.MjData(models[0]), np.random.default_rng(seed)
    along, time = motion(12000)
    turn, gains, table = draw.uniform(0.8, 1.0), np.array([900.0, 300.0]), []
    data.qpos[:], data.qvel[:] = turn * along.position[0], turn * along.velocity[0]
    for i in range(len(time)):
        away = turn * along.position[i] - data.qpos
        force = gains * away + 0.06 * gains * (turn * along.velocity[i] - data.qvel)
        if i % 3 == 0:
            table.append([i * models[0].opt.timestep, *data.qpos, *force])
        now = models[i * models[0].opt.timestep > moment]
        there = mujoco.MjData(now)
        there.qpos[:], there.qvel[:], there.qfrc_applied[:] = data.qpos, data.qvel, force
        mujoco.mj_step(now, there)
        data.qpos[:], data.qvel[:] = there.qpos, there.qvel
    table = np.array(table)
    table[:, 1:3] += 1e-5 * draw.normal(size=(len(table), 2))
    table[:, 3:] += 0.003 * table[:, 3:].std(axis=0) * draw.normal(size=(len(table), 2))
    header = "time,shoulder_position,elbow_position,shoulder_torque,elbow_torque"
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.9g")


@pytest.mark.slow
def test_a_load_is_told_once_with_its_place(tmp_path, capsys):
    (tmp_path / "arm.xml").write_text(arm())
    logs = [str(tmp_path / f"log{seed}.csv") for seed in (1, 2)]
    for seed, path in enumerate(logs):
        carried(path, seed)
    command = ["explain", logs[0], "--holdout", logs[1], "--mujoco", str(tmp_path / "arm.xml")]
    assert cli.main([*command, "--json", str(tmp_path / "out.json")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert said.count("body fore has picked up") == 1 and "contradict" not in said
    document = json.loads((tmp_path / "out.json").read_text())
    for row in document["joints"]:
        (finding,) = row["explanation"]["findings"]
        found = finding["parameters"]
        assert finding["effect"] == "payload_change"
        for name, true in {"load_mass": 0.5, "load_x": 0.24, "step_time": 6.5}.items():
            low, high = found[name]["interval"]
            assert low - 0.01 * true < true < high + 0.01 * true
            assert high - low < 0.1 * true
