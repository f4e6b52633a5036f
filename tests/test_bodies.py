"""What a robot's bodies weigh, by all its joints together: one value each, the fewest that do."""

import dataclasses
import json

import numpy as np
import pytest

import jaxfric as jf
from jaxfric import cli
from jaxfric.explanation import agreement, agreement_text, fewest_numbers
from jaxfric.explanation.acceptance import LINEARITY
from jaxfric.explanation.bodies import Bodies
from jaxfric.explanation.fewest_numbers import answer
from jaxfric.explanation.finding import Moved
from jaxfric.explanation.joint_rows import JointRows
from jaxfric.export.patch import patch
from jaxfric.identification.uncertainty import Estimate
from jaxfric.simulators import Mujoco, inverse
from jaxfric.simulators.patching import patched
from jaxfric.simulators.weights import by_gravity, linear, possible, pulled, weights

mujoco = pytest.importorskip("mujoco")

ARM = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.001" integrator="implicitfast"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" damping="0.8" armature="0.05"/>
      <inertial pos="0.15 0 0" mass="2.0" diaginertia="0.004 0.02 0.02"/>
      <body name="fore" pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0" damping="0.5" armature="0.02"/>
        <inertial pos="{centre}" mass="{mass}" diaginertia="0.002 0.009 0.009"/>{load}
      </body>
    </body>
  </worldbody>
</mujoco>
"""
RIGHT = {"centre": "0.1 0 0", "mass": "1.2", "load": ""}
# A load of 0.5 kg at 0.24 m: the sum weighs 1.7 kg and has its centre at 0.2400 / 1.7 m.
LOAD = """<body pos="0.24 0 0">
  <inertial pos="0 0 0" mass="0.5" diaginertia="4e-4 4e-4 4e-4"/></body>"""
FORE = "body/fore/"


def arm(**other):
    return ARM.format(**RIGHT | other)


def motion(count=1500, seconds=12.0):
    """A motion of both joints with its exact derivatives, and the time, s."""
    time = np.linspace(0, seconds, count)
    rates, sizes = (
        2 * np.pi * np.array([[0.3, 0.7], [0.5, 1.1]]),
        np.array([[0.6, 0.2], [0.7, 0.2]]),
    )
    angle = rates[:, :, None] * time + np.array([[0.3, 2.0], [1.0, 0.1]])[:, :, None]
    size, rate = sizes[:, :, None], rates[:, :, None]
    parts = size * np.sin(angle), size * rate * np.cos(angle), -size * rate**2 * np.sin(angle)
    return inverse.Motion(*(part.sum(axis=1).T for part in parts)), time


def rows(
    nominal, plant, noise=0.005, seed=0, names=("shoulder", "elbow"), correlated=1, error=None
):
    """The rows of both joints, the force that of the plant by MuJoCo, and what the bodies weigh.

    **Arguments:** `noise` of each joint, N·m; `correlated`: samples over which it is a mean;
    `error` of the second joint's sensor, relative, where a sensor is known to a thousandth or two.
    """
    model, true = (mujoco.MjModel.from_xml_string(text) for text in (nominal, plant))
    along, time = motion()
    seen = inverse.along(mujoco, model, along)
    whole = inverse.forces(mujoco, true, along) * (1 + np.array([0.0, error or 0.0]))
    forces = whole - inverse.forces(mujoco, model, along)
    power = np.sum(whole**2, axis=0)
    mean = np.ones(correlated) / np.sqrt(correlated)
    draw, found = np.random.default_rng(seed), []
    for joint, (name, size) in enumerate(zip(names, np.broadcast_to(noise, 2), strict=True)):
        turned, products = (
            [(rest, 0 * rest) for rest in each(mujoco, model, joint, seen)]
            for each in (by_gravity, pulled)
        )
        parts = turned + linear(mujoco, model, joint, seen) + products
        columns = np.array([rest + np.gradient(moving, time) for rest, moving in parts]).T
        own = np.array([along.velocity[:, joint], along.acceleration[:, joint]]).T
        inner = slice(2, -2)  # the ends have one-sided differences
        drawn = np.convolve(draw.normal(size=len(time)), mean, "same")
        target = (forces[:, joint] + size * drawn)[inner] / size
        values = (f"joint/{name}/damping", f"joint/{name}/armature")
        every = np.concatenate([own, columns], axis=1)[inner] / size
        block = np.arange(len(time) - 4) * 24 // (len(time) - 4)
        enough = 1.0 if error is None else (LINEARITY / size) ** 2 * power[joint]
        found.append(JointRows(name, values, every, target, block, enough))
    return Bodies(found, weights(mujoco, model), model.opt.gravity)


@pytest.mark.parametrize(
    "other,values",
    [
        ({"mass": "1.7"}, {"mass_alone": 1.7}),
        ({"centre": "0.17 0 0"}, {"centre_x": 0.17}),
        ({"centre": "0.14 0 0", "mass": "1.7"}, {"mass_alone": 1.7, "centre_x": 0.14}),
    ],
)
def test_the_fewest_numbers_are_those_that_differ(other, values):
    robot = rows(arm(), arm(**other))
    found = answer(robot, {"upper", "fore"})
    assert set(found.values) == {FORE + name for name in values}
    for name, value in values.items():
        estimate = found.estimates[FORE + name]
        assert abs(found.values[FORE + name] - value) < max(3 * estimate.standard_error, 1e-4)
        assert estimate.standard_error < 0.01 * value


COLUMN = """<mujoco>
  <worldbody>
    <body name="column">
      <joint name="lift" type="slide" axis="0 0 1" damping="180" armature="25"/>
      <inertial pos="0.1 0 0.3" mass="38" diaginertia="2 2 1"/>
      <body name="turn" pos="0.2 0 0.2">
        <joint name="rot" axis="0 0 1" damping="0.9" armature="0.1"/>
        <inertial pos="0.15 0 0" mass="{mass}" diaginertia="0.08 0.2 0.2"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize("seed", [0, 3])
def test_one_mass_that_does_as_well_as_two_numbers_is_the_answer(seed):
    """The column's mass and an armature leave a little less of the noise; so do mass and centre."""
    noise, names = (2.0, 0.07), ("lift", "rot")
    plants = (COLUMN.format(mass=mass) for mass in (9, 13.5))
    robot = rows(*plants, noise, seed, names, correlated=6)
    found = answer(robot, {"column", "turn"})
    assert list(found.values) == ["body/turn/mass_alone"]
    known = found.estimates["body/turn/mass_alone"]
    assert abs(known.value - 13.5) < 3 * known.standard_error < 0.1
    two = robot.fitted(["body/column/mass_alone", "rot:joint/rot/armature"], {})[1]
    assert robot.energies(two).sum() < robot.energies(found.values).sum()
    assert not fewest_numbers._less(robot, two, found.values)


@pytest.mark.parametrize("seed", [1, 3])
def test_what_no_sensor_resolves_is_no_number_beside_a_noisy_joint(seed):
    """The shoulder's noise is more than all numbers take; the elbow's sensor is 0.18 % wrong."""
    noise = 0.1, 0.002
    robot = rows(arm(), arm(mass="1.7"), noise, seed, correlated=6, error=0.9 * LINEARITY)
    found = answer(robot, {"upper", "fore"})
    assert not fewest_numbers.sufficient(robot, found.values)
    assert list(found.values) == [FORE + "mass_alone"]
    assert found.values[FORE + "mass_alone"] == pytest.approx(1.7, rel=3 * LINEARITY)


def test_a_load_is_one_body_of_one_mass_and_centre():
    found = answer(rows(arm(), arm(load=LOAD)), {"upper", "fore"})
    assert {name.split("/")[1] for name in found.values} == {"fore"}
    assert abs(found.values[FORE + "mass_alone"] - 1.7) < 0.02
    assert abs(found.values[FORE + "centre_x"] - 0.24 / 1.7) < 0.002


def test_one_body_is_tried_where_the_search_over_all_goes_astray(monkeypatch):
    """It keeps a few sets of each size: a load may become two bodies that are not enough."""
    robot = rows(arm(), arm(load=LOAD))
    search = fewest_numbers._fewest

    def astray(robot, bodies, apart, most=100):
        if len(bodies) < 2:
            return search(robot, bodies, apart, most)
        return {FORE + "centre_x": 0.16, "body/upper/mass_alone": 2.1}

    monkeypatch.setattr(fewest_numbers, "_fewest", astray)
    found = fewest_numbers.fewest(robot, {"upper", "fore"})
    assert {name.split("/")[1] for name in found} == {"fore"}
    assert abs(found[FORE + "mass_alone"] - 1.7) < 0.02


def test_a_value_of_a_body_that_may_be_as_it_was_is_not_told(monkeypatch):
    """The held-out recording has its centre as much nearer as this one has it further out."""
    centres = "0.12 0 0", "0.08 0 0"
    own, held = (rows(arm(), arm(centre=each, mass="1.7")) for each in centres)

    def given(told, bodies, wide=1, **of):
        return None if wide > 1 else held if of else own

    monkeypatch.setattr(agreement, "_rows", given)
    told = [agreement.Told(Mujoco(arm(), name), [], None) for name in ("shoulder", "elbow")]
    found = agreement.agreed(told, {"upper", "fore"})
    assert set(found.parameters) == {FORE + "mass_alone"} and "centre" not in found.text


def test_what_cannot_be_on_another_recording_is_not_known(monkeypatch):
    """A mass that is below zero there is a value that is not told, and no end of the run."""
    own, held = rows(arm(), arm(mass="1.7")), rows(arm(), arm())
    below = {FORE + "mass_alone": -0.1}
    monkeypatch.setattr(held, "fitted", lambda names, start: (np.inf, below))

    def given(told, bodies, wide=1, **of):
        return None if wide > 1 else held if of else own

    monkeypatch.setattr(agreement, "_rows", given)
    told = [agreement.Told(Mujoco(arm(), name), [], None) for name in ("shoulder", "elbow")]
    assert agreement.agreed(told, {"upper", "fore"}).parameters == {}
    assert np.isinf(own.energies(below)).all() and own.impossible(below) == set(below)


def test_what_one_joint_cannot_tell_apart_is_said():
    """One hinge sees m c and the inertia about itself: mass, centre, inertia and armature make
    these two, so that either of two numbers may be another.
    """
    robot = rows(arm(), arm(load=LOAD))
    alone = Bodies([robot.joints[1]], robot.weights, np.array([0.0, 0.0, -9.81]))
    found = answer(alone, {"upper", "fore"})
    assert len(found.values) == 2
    others = {name for each in found.instead.values() for name in each}
    assert others & {"elbow:joint/elbow/armature", FORE + "inertia_y"}


def test_nothing_is_found_where_nothing_differs():
    assert answer(rows(arm(), arm()), ()).values == {}


def standing(gravity):
    """The arm where gravity is another one than in the file."""
    return arm().replace("<option ", f'<option gravity="{gravity}" ')


def test_a_base_that_is_tilted_is_no_fault_of_the_bodies():
    tilt = np.radians(3.0)
    robot = rows(arm(), standing(f"{9.81 * np.sin(tilt)} 0 {-9.81 * np.cos(tilt)}"))
    found = answer(robot, {"upper", "fore"})
    assert list(found.values) == ["option/gravity/x"]
    known = found.estimates["option/gravity/x"]
    assert abs(known.value - 9.81 * np.sin(tilt)) < 3 * known.standard_error < 0.05
    assert known.unit == "m/s²"
    # Its size stays.
    assert robot.gravity(found.values) == pytest.approx(-9.81 * np.cos(tilt), abs=1e-3)


def test_gravity_of_another_direction_pulls_on_what_the_bodies_weigh():
    """Of another mass under another gravity the force is a product, which is no small one here."""
    tilt = np.radians(10.0)
    gravity = f"{9.81 * np.sin(tilt)} 0 {-9.81 * np.cos(tilt)}"
    plant = standing(gravity).replace('mass="1.2"', 'mass="1.8"')
    found = answer(rows(arm(), plant), {"upper", "fore"})
    assert set(found.values) == {f"{FORE}mass_alone", "option/gravity/x"}
    for name, value in ((f"{FORE}mass_alone", 1.8), ("option/gravity/x", 9.81 * np.sin(tilt))):
        known = found.estimates[name]
        assert abs(known.value - value) < 3 * known.standard_error < 0.02 * value


@pytest.mark.parametrize("gravity", [9.81, 9.80, -9.81])
def test_a_base_on_a_wall_is_told_with_a_finite_error(gravity):
    """Gravity's largest component is next to nothing then, and its derivative infinite."""
    down = -np.sqrt(max(9.81**2 - gravity**2, 0.0))
    robot = rows(arm(), standing(f"{gravity} 0 {down}"))
    found = answer(robot, {"upper", "fore"})
    assert {name.split("/")[0] for name in found.values} == {"option"}
    assert found.values["option/gravity/x"] == pytest.approx(gravity, abs=0.02)
    moved = agreement._down(robot, {"option/gravity/x": gravity}, found.estimates)
    assert np.isfinite(moved.estimate.standard_error)
    assert abs(moved.value - down) <= 3 * moved.estimate.standard_error


def test_a_gravity_of_another_size_is_one_number():
    found = answer(rows(standing("0 0 -9"), arm()), {"upper", "fore"})
    assert list(found.values) == ["option/gravity/z"]
    assert found.values["option/gravity/z"] == pytest.approx(-9.81, abs=0.01)


@pytest.mark.parametrize(("value", "error", "told"), [(-9.2, 0.01, True), (-9.2, 0.4, False),
                                                     (-9.81, 0.001, False)])  # fmt: skip
def test_gravity_of_a_size_that_it_has_nowhere_stands_for_something_else(value, error, told):
    robot = rows(arm(), arm())
    moved = {robot.down: Moved(-9.0, Estimate(np.float64(value), np.float64(error), "m/s²"))}
    assert agreement._impossible(moved, robot) is told
    assert not agreement._impossible({}, robot)


@pytest.mark.slow
def test_of_a_gravity_that_is_nowhere_nothing_is_written(tmp_path, capsys, monkeypatch):
    """As on another planet, where the file's is right."""
    monkeypatch.setattr(agreement, "EARTH", (8.9, 9.1))
    (tmp_path / "arm.xml").write_text(standing("0 0 -9"))
    log(tmp_path / "log.csv", arm(), 1)
    command = ["explain", str(tmp_path / "log.csv"), "--mujoco", str(tmp_path / "arm.xml")]
    new, out = str(tmp_path / "new.xml"), str(tmp_path / "out.json")
    assert cli.main([*command, "--save", new, "--json", out]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "gravity is of that size nowhere: something else is wrong" in said
    document = json.loads((tmp_path / "out.json").read_text())
    assert document["patch"]["written"] == []
    for row in document["joints"]:
        (finding,) = row["explanation"]["findings"]
        assert row["verdict"] == "partly_explained" and not finding["parameters"]
        assert finding["untold"] == ["option/gravity/z"]


@pytest.mark.parametrize("text", [arm(), standing("0 1 -9")])
def test_gravity_is_written_into_the_file_s_option(text):
    done = patched(mujoco, text, {"option/gravity/x": 0.5, "option/gravity/z": -9.8})
    assert not done.left and len(done.written) == 2
    model, before = (mujoco.MjModel.from_xml_string(each) for each in (done.text, text))
    assert model.opt.gravity == pytest.approx([0.5, before.opt.gravity[1], -9.8])
    assert model.opt.timestep == before.opt.timestep
    bare = "\n".join(line for line in text.splitlines() if "<option" not in line)
    done = patched(mujoco, bare, {"option/gravity/x": 0.5})
    assert mujoco.MjModel.from_xml_string(done.text).opt.gravity == pytest.approx([0.5, 0, -9.81])


def test_an_inertia_is_one_that_a_body_can_have():
    assert np.allclose(possible(np.array([1.0, 4.0, 2.0]), [1]), [1.5, 4.0, 2.5], rtol=1e-4)
    assert np.array_equal(possible(np.array([1.0, 2.0, 2.5]), [1]), [1.0, 2.0, 2.5])
    with pytest.raises(ValueError, match="no body"):
        possible(np.array([1.0, 4.0, 2.0]), [0, 1, 2])
    done = patched(mujoco, arm(), {FORE + "inertia_y": 0.02})
    assert done.written == (FORE + "inertia_y",) and not done.left
    inertia = mujoco.MjModel.from_xml_string(done.text).body_inertia[2]
    assert inertia[1] == pytest.approx(0.02) and inertia[0] + inertia[2] >= inertia[1]


def test_an_inertia_that_has_to_go_along_counts_as_a_number():
    """A hinge's armature and its body's inertia are one to it: the one that stands alone."""
    robot = rows(arm(), arm())
    assert robot.raised({FORE + "inertia_y": 0.010}) == []
    ((body, axis, before, after), *more) = robot.raised({FORE + "inertia_y": 0.029})
    assert (body, axis, before) == ("fore", "x", 0.002) and after > before and len(more) == 1
    changed = [
        fewest_numbers._changed(robot, state, ())
        for state in ({FORE + "inertia_y": 0.029}, {"elbow:joint/elbow/armature": 0.02})
    ]
    assert changed[0] > changed[1]


def test_other_bodies_would_leave_less_only_beyond_noise():
    noisy = rows(arm(), arm(mass="1.7"), correlated=40)
    assert answer(noisy, {"upper", "fore"}).short == ()
    loaded = rows(arm(), arm(load=LOAD))
    assert "elbow" in fewest_numbers._short(loaded, {FORE + "mass": 1.7})


def test_a_mass_alone_is_one_number_of_the_file():
    done = patched(mujoco, arm(), {FORE + "mass_alone": 1.7})
    changed = set(done.text.splitlines()) - set(arm().splitlines())
    assert len(changed) == 1 and 'mass="1.7" diaginertia="0.002 0.009 0.009"' in changed.pop()


def log(path, plant, seed, names=("shoulder", "elbow"), gains=(900.0, 300.0)):
    """A log of both joints under a controller, with noise."""
    model = mujoco.MjModel.from_xml_string(plant)
    data, draw = mujoco.MjData(model), np.random.default_rng(seed)
    along, time = motion(12000)
    turn = draw.uniform(0.8, 1.0)
    data.qpos[:], data.qvel[:] = turn * along.position[0], turn * along.velocity[0]
    table, gains = [], np.array(gains)
    for i in range(len(time)):
        away = turn * along.position[i] - data.qpos
        force = gains * away + 0.06 * gains * (turn * along.velocity[i] - data.qvel)
        if i % 3 == 0:
            table.append([i * model.opt.timestep, *data.qpos, *force])
        data.qfrc_applied[:] = force
        mujoco.mj_step(model, data)
    table = np.array(table)
    table[:, 1:3] += 1e-5 * draw.normal(size=(len(table), 2))
    table[:, 3:] += 0.003 * table[:, 3:].std(axis=0) * draw.normal(size=(len(table), 2))
    columns = [f"{name}_{what}" for what in ("position", "force") for name in names]
    header = ",".join(["time", *columns])
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.9g")


@pytest.mark.slow
def test_a_load_is_written_once_and_the_file_keeps_its_word(tmp_path, capsys):
    (tmp_path / "arm.xml").write_text(arm())
    logs = [str(tmp_path / f"log{seed}.csv") for seed in (1, 2)]
    for seed, path in enumerate(logs):
        log(path, arm(load=LOAD), seed)
    command = ["explain", logs[0], "--holdout", logs[1], "--mujoco", str(tmp_path / "arm.xml")]
    out = {name: str(tmp_path / name) for name in ("new.xml", "out.json")}
    assert cli.main([*command, "--save", out["new.xml"], "--json", out["out.json"]]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert said.count("shoulder and elbow together: body fore") == 1 and "not all of" not in said
    document = json.loads((tmp_path / "out.json").read_text())
    model = mujoco.MjModel.from_xml_path(out["new.xml"])
    assert model.body_mass[2] == pytest.approx(1.7, rel=0.02)
    assert model.body_ipos[2][0] == pytest.approx(0.24 / 1.7, rel=0.02)
    for errors in document["patch"]["errors"].values():
        assert errors["holdout_force_error"]["file"] < 0.02 < errors["force_error"]["before"]
    assert document["patch"]["misses"] == [] and document["patch"]["left"] == []


@pytest.mark.slow
def test_gravity_is_told_by_all_joints_and_written_once(tmp_path, capsys):
    (tmp_path / "arm.xml").write_text(standing("0 0 -9"))
    logs = [str(tmp_path / f"log{seed}.csv") for seed in (1, 2)]
    for seed, path in enumerate(logs):
        log(path, arm(), seed)
    command = ["explain", logs[0], "--holdout", logs[1], "--mujoco", str(tmp_path / "arm.xml")]
    new, out = str(tmp_path / "new.xml"), str(tmp_path / "out.json")
    assert cli.main([*command, "--save", new, "--json", out]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert said.count("shoulder and elbow together: gravity along z -9 → -9.8") == 1
    assert "body" not in said
    assert mujoco.MjModel.from_xml_path(new).opt.gravity[2] == pytest.approx(-9.81, rel=0.01)
    document = json.loads((tmp_path / "out.json").read_text())
    assert [row["verdict"] for row in document["joints"]] == ["explained"] * 2
    for errors in document["patch"]["errors"].values():
        assert errors["holdout_force_error"]["file"] < 0.02 < errors["force_error"]["before"]


@pytest.mark.slow
def test_a_value_that_makes_a_joint_worse_is_not_written(tmp_path):
    path, file = tmp_path / "log.csv", tmp_path / "arm.xml"
    file.write_text(arm())
    log(path, arm(mass="1.7"), 1)
    columns = {"position": "elbow_position", "force": "elbow_force"}
    units = {"force": "N·m", "position": "rad"}
    others = {"shoulder": "shoulder_position"}
    recording = jf.read(str(path), columns=columns | others, units=units)
    told = jf.explain(recording, jf.simulators.mujoco(str(file), joint="elbow"))
    done = patch(str(file), {"elbow": told}, {"elbow": [recording]}, "new.xml")
    assert any(line.startswith("body/fore/") for line in done.written)
    finding = next(f for f in told.findings if f.effect == "parameter_mismatch")
    worse = {
        name: m._replace(estimate=m.estimate._replace(value=4 * m.value))
        for name, m in finding.parameters.items()
        if name.startswith("body/")
    }
    told = dataclasses.replace(told, findings=[finding._replace(parameters=worse)])
    done = patch(str(file), {"elbow": told}, {"elbow": [recording]}, "new.xml")
    assert not done.written and "joint elbow would be worse" in done.left[0]
    assert "not all of its answer is in the file" in done.misses[0]
    error = done.errors["elbow"]["force_error"]
    assert error["file"] == pytest.approx(error["before"])


def test_values_of_several_bodies_raise_a_doubt_about_the_geometry():
    robot = rows(arm(), arm())
    estimate = Estimate(np.float64(2.5), np.float64(0.01), "kg")

    def said(*names):
        return agreement_text.geometry({name: Moved(2.0, estimate) for name in names}, robot)

    assert said(FORE + "mass", FORE + "centre_x", "option/gravity/x") == []
    (doubt,) = said(FORE + "mass", "body/upper/mass")
    assert "2 bodies" in doubt and "geometry" in doubt


GANTRY = """<mujoco>
  <option timestep="0.001" integrator="implicitfast"/>
  <worldbody>
    <body name="bridge">
      <joint name="x" type="slide" axis="1 0 0" damping="60" armature="9"/>
      <inertial pos="0 0 0" mass="25" diaginertia="2 1 2"/>
      <body name="carriage">
        <joint name="y" type="slide" axis="0 1 0" damping="35" armature="5"/>
        <inertial pos="0 0 0" mass="{mass}" diaginertia="0.1 0.1 0.1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plant", "values"),
    [
        (GANTRY.format(mass=15.4), {"body/carriage/mass"}),
        (GANTRY.format(mass=12).replace('"9"', '"11"').replace('"5"', '"8"'),
         {"joint/x/armature", "joint/y/armature"}),
    ],
)  # fmt: skip
def test_one_mass_is_written_where_it_stands_for_two_armatures(tmp_path, plant, values):
    """By itself each joint of a gantry tells of its armature; other changes are two numbers."""
    (tmp_path / "gantry.xml").write_text(GANTRY.format(mass=12))
    log(tmp_path / "log.csv", plant, 1, ("x", "y"), (40000.0, 20000.0))
    command = ["explain", str(tmp_path / "log.csv"), "--mujoco", str(tmp_path / "gantry.xml")]
    new, out = str(tmp_path / "new.xml"), str(tmp_path / "out.json")
    assert cli.main([*command, "--save", new, "--json", out]) == 0
    document = json.loads((tmp_path / "out.json").read_text())
    assert {line.partition(":")[0] for line in document["patch"]["written"]} == values
    assert [row["verdict"] for row in document["joints"]] == ["explained"] * 2
    made, true = mujoco.MjModel.from_xml_path(new), mujoco.MjModel.from_xml_string(plant)
    assert made.body_mass[1:] == pytest.approx(true.body_mass[1:], rel=0.01)
    assert made.dof_armature == pytest.approx(true.dof_armature, rel=0.02)
