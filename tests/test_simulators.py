"""Another simulator's force as it is: what agrees stays, what is wrong is named, nothing else."""

import dataclasses
import json

import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import Recording, cli, explain, models, predict, simulators, terms
from jaxfric.cli.arguments import whole
from jaxfric.cli.joint_columns import logged
from jaxfric.cli.robot_joints import opened
from jaxfric.data import io
from jaxfric.explanation.mismatch import fewest
from jaxfric.simulators import Known, Mujoco, same_motion
from jaxfric.terms import KNOWN_FORCE, KNOWN_FRICTION
from jaxfric.terms.effects import EFFECTS
from tests.test_explain import CASES, PARAMETERS, healthy, planted

__all__ = ["healthy"]

MACHINE = models.from_parameters(models.gaussian(), PARAMETERS)


def simulator(**wrong):
    """The machine's own force along a motion, with other values."""
    model = models.from_parameters(models.gaussian(), PARAMETERS | wrong)
    return lambda recording: predict(model, recording)


@pytest.mark.slow
def test_a_simulator_that_is_right_stays_as_it_is(healthy):
    found = explain(healthy[0], simulator(), healthy[1])
    assert found.verdict == "consistent" and found.findings == []
    assert found.baseline_name == "simulator"
    assert not any(float(value) for value in found.model.parameters.values())


def test_one_wrong_value_is_one_wrong_value(healthy):
    wrong = simulator(**{"viscous+": 90.0, "viscous-": 78.0})  # both 24 too large
    found = explain(healthy[0], wrong, healthy[1])
    (finding,) = found.findings
    assert finding.effect == "parameter_mismatch" and set(finding.parameters) == {"viscous"}
    moved = finding.parameters["viscous"]
    assert moved.before == 0 and abs(moved.value + 24) < 2.4 * max(moved.standard_error, 0.3)
    assert "viscous is" in finding.sentence and "less" in finding.sentence
    errors = found.fit["filtered_holdout_force_error"]
    assert errors["after"] < 0.2 * errors["before"]
    assert found.verdict == "explained"


@pytest.mark.slow
def test_a_torque_constant_is_a_gain_and_nothing_else(healthy):
    louder = [dataclasses.replace(run, force=1.15 * run.force) for run in healthy]
    found = explain(louder[0], simulator(), louder[1])
    (finding,) = found.findings
    assert set(finding.parameters) == {"gain"}
    assert float(finding.parameters["gain"].value) == pytest.approx(0.15, rel=0.02)
    assert "(the torque constant) is 1.1" in finding.sentence


@pytest.mark.slow
def test_a_dead_time_longer_than_the_kernel_keeps_its_size_beside_a_wrong_value(healthy):
    """Its first order, refitted beside the values as given, would be another time."""
    ahead = [EFFECTS["transport_delay"].undone(run, -0.03) for run in healthy]
    ahead = [dataclasses.replace(run, force=1.15 * run.force) for run in ahead]
    found = explain(ahead[0], simulator(), ahead[1])
    by_name = {finding.effect: finding.parameters for finding in found.findings}
    assert set(by_name) == {"parameter_mismatch", "transport_delay"}
    assert float(by_name["transport_delay"]["delay"].value) == pytest.approx(0.03, rel=0.05)
    assert float(by_name["parameter_mismatch"]["gain"].value) == pytest.approx(0.15, rel=0.02)


@pytest.mark.slow
def test_missing_physics_beside_a_wrong_value(healthy):
    """The values are judged beside what is missing, not instead of it."""
    runs = [planted(run, *CASES["cogging"]) for run in healthy]
    found = explain(runs[0], simulator(inertia=4.0), runs[1])
    named = {finding.effect: finding for finding in found.findings}
    assert set(named) == {"cogging", "parameter_mismatch"}
    moved = named["parameter_mismatch"].parameters
    assert set(moved) == {"inertia"}
    assert float(moved["inertia"].value) == pytest.approx(1.0, rel=0.02)
    assert float(named["cogging"].parameters["pitch"].value) == pytest.approx(0.01, rel=1e-3)


@pytest.mark.slow
def test_a_wrong_value_keeps_its_interval_beside_an_axis_that_warms_in_both_recordings(healthy):
    """Of the held-out one without its warming the friction would be another."""
    warming = terms.ThermalDrift(terms.Coulomb())
    runs = [planted(run, warming, (7.0,), (4.0,)) for run in healthy]
    found = explain(runs[0], simulator(**{"viscous+": 90.0, "viscous-": 78.0}), runs[1])
    named = {finding.effect: finding for finding in found.findings}
    assert set(named) == {"thermal_drift", "parameter_mismatch"}
    moved = named["parameter_mismatch"].parameters["viscous"]
    assert abs(float(moved.value) + 24) < float(moved.estimate.half_width()) + 0.5
    assert float(moved.estimate.half_width()) < 3.0
    assert found.verdict == "explained"


@pytest.mark.slow
def test_a_bump_beside_dry_friction_that_is_wrong(healthy):
    """Beside the value as given the bump would take another shape, and the value would be lost."""
    bare = {"coulomb+": 25.0, "coulomb-": 21.0, "stribeck_force+": 0.0, "stribeck_force-": 0.0}
    found = explain(healthy[0], simulator(**bare), healthy[1])
    named = {finding.effect: finding for finding in found.findings}
    assert set(named) == {"stribeck", "parameter_mismatch"}
    moved = named["parameter_mismatch"].parameters
    assert set(moved) == {"coulomb"}
    assert float(moved["coulomb"].value) == pytest.approx(-3.0, abs=0.2)
    bump = named["stribeck"].parameters
    assert float(bump["stribeck_force+"].value) == pytest.approx(6.6, rel=0.1)


@pytest.mark.slow
def test_the_saved_model_stands_on_the_simulators_force(healthy, tmp_path):
    run = planted(healthy[0], *CASES["spring"])
    found = explain(run, simulator())
    again = models.Model.from_dict(json.loads(json.dumps(found.model.to_dict())))
    beside = Known(simulator()).beside(run)
    left = np.asarray(run.force) - np.asarray(predict(again, beside))
    moving = np.abs(np.gradient(np.asarray(run.position))) > 5e-5
    before = np.asarray(run.force) - np.asarray(simulator()(run))
    assert np.std(left[moving]) < 0.5 * np.std(before[moving])
    with pytest.raises(ValueError, match="known_force"):
        predict(again, run)


def test_arrays_channels_and_functions_say_the_same(healthy):
    force = np.asarray(simulator()(healthy[0]))
    ways = [
        Known(force).beside(healthy[0]),
        Known(simulator()).beside(healthy[0]),
        Known().beside(simulators.along(healthy[0], force)),
    ]
    for way in ways:
        np.testing.assert_array_equal(way.channels[KNOWN_FORCE], force)
    with pytest.raises(ValueError, match="samples"):
        Known(force[:-1]).beside(healthy[0])
    with pytest.raises(ValueError, match="held-out recording|run 1"):
        Known(force).beside(healthy[1], held_out=True)
    gone = np.where(np.arange(force.size) < 100, np.nan, force)
    assert not np.asarray(Known(gone).beside(healthy[0]).mask)[:100].any()


@pytest.mark.slow
def test_a_baseline_without_it_does_not_read_the_simulators_force(healthy):
    run = simulators.along(healthy[0], np.zeros(healthy[0].num_samples))
    ours, theirs = explain(run, "gaussian"), explain(healthy[0], "gaussian")
    assert ours.fit == theirs.fit and KNOWN_FORCE not in str(ours.model)


def test_the_recorded_force_is_no_simulators(healthy):
    with pytest.raises(ValueError, match="is the recorded force, to the last digit"):
        explain(healthy[0], Known(healthy[0].force))


def test_a_revolute_axis_has_gravity_and_a_spring_too():
    rotary = Known().model((("force", "N·m"), ("position", "rad")))
    assert {"gravity_sin", "gravity_cos", "stiffness", "gain"} <= set(rotary.parameters)
    assert "gravity_sin" not in Known().model((("force", "N"), ("position", "m"))).parameters


def test_columns_that_only_cancel_each_other_are_no_wrong_values():
    """Of a force and its parts, all moved against it, no more than a wrong shape is left."""
    time, draw = np.arange(2400) / 100, np.random.default_rng(3)
    rate, sign, speed = np.cos(time), np.sign(np.sin(time)), np.sin(time)
    bump = 0.02 * sign * np.exp(-((speed / 0.1) ** 2))
    whole = rate + sign + 0.3 * speed + bump
    columns, block = np.stack([rate, sign, speed, whole], axis=1), np.arange(2400) // 100
    noise = 1e-3 * draw.normal(size=2400)
    assert 3 not in fewest(columns, 0.2 * rate + bump + noise, block, 0.0)
    assert fewest(columns, 0.2 * rate - 0.02 * speed + noise, block, 0.0) == [0, 2]
    assert fewest(columns, 0.2 * whole + noise, block, 0.0) == [3]


def test_the_fewest_columns_are_enough():
    """Of columns that resemble each other the one that is the difference, and it alone."""
    draw = np.random.default_rng(0)
    q = np.linspace(-0.8, 0.8, 600)
    columns = np.stack([q, np.sin(q), np.cos(q), np.ones_like(q), np.sign(np.sin(40 * q))], axis=1)
    block = np.arange(600) // 25
    noise = 0.003 * draw.normal(size=600)
    assert fewest(columns, 1.5 * q + noise, block, 0.0) == [0]
    assert fewest(columns, np.sin(q) + noise, block, 0.0) == [1]
    both = -0.4 * columns[:, 2] + 0.3 * columns[:, 4]
    assert sorted(fewest(columns, both + noise, block, 0.0)) == [2, 4]
    assert fewest(columns, noise, block, 0.0) == []


def test_two_columns_are_found_where_one_alone_is_unsure():
    """An offset and a slope about a far place cancel each other over most of the record."""
    time = np.linspace(0, 40, 2400)
    place, block = 3 + np.sin(time / 6), np.arange(2400) // 100
    columns = np.stack([np.ones_like(time), place, np.cos(time)], axis=1)
    noise = 1e-3 * np.random.default_rng(2).normal(size=2400)
    assert fewest(columns, columns @ [3.0, -1.0, 0.0] + noise, block, 0.0) == [0, 1]


def test_of_many_columns_none_may_be_sure(monkeypatch):
    """As on an arm: with too many subsets to try them all, and none found of the smaller ones."""
    draw = np.random.default_rng(0)
    columns, noise = draw.normal(size=(600, 60)), draw.normal(size=600)
    monkeypatch.setattr("jaxfric.explanation.fewest._sure", lambda *_: False)
    assert fewest(columns, noise, np.arange(600) // 25, 0.0) == []


def test_another_machine_has_all_its_values_moved():
    draw = np.random.default_rng(0)
    columns = draw.normal(size=(600, 8))
    difference = columns[:, :7] @ np.ones(7) + 0.01 * draw.normal(size=600)
    block = np.arange(600) // 25
    enough = 1e-3 * float(difference @ difference)
    assert fewest(columns, difference, block, enough) == list(range(8))


# ---- the command ----


def written(path, recording, force):
    table = np.stack([recording.time, recording.position, force], axis=1)[:6000]
    np.savetxt(path, table, delimiter=",", header="time,position,force", comments="", fmt="%.9g")
    return str(path)


@pytest.mark.slow
def test_the_command_takes_the_force_from_a_file(healthy, tmp_path, capsys):
    runs = [planted(run, *CASES["cogging"]) for run in healthy]
    logs = [written(tmp_path / f"log{i}.csv", r, r.force) for i, r in enumerate(runs)]
    ours = [written(tmp_path / f"sim{i}.csv", r, simulator()(r)) for i, r in enumerate(healthy)]
    options = ["--holdout", logs[1], "--simulation", ours[0], "--simulation-holdout", ours[1]]
    assert cli.main(["explain", logs[0], *options, "--json", str(tmp_path / "out.json")]) == 0
    document = json.loads((tmp_path / "out.json").read_text())
    assert [finding["effect"] for finding in document["findings"]] == ["cogging"]
    assert document["baseline"]["name"] == "simulator"
    swapped = ["--simulation", ours[0], "--simulation-holdout", ours[0], "--holdout", logs[1]]
    assert cli.main(["explain", logs[0], *swapped]) == 2
    assert "is not the motion of" in capsys.readouterr().err


def still(path, time, force, names="time_s,torque_Nm"):
    rows = np.stack([time, force], axis=1)
    np.savetxt(path, rows, delimiter=",", header=names, comments="", fmt="%.6g")
    return str(path)


def test_a_simulators_force_alone_is_along_the_recorded_motion(tmp_path):
    t = np.arange(300) / 100
    log = Recording(
        time=t, position=np.sin(t), force=np.cos(t), source="log.csv",
        units=(("force", "N·m"), ("position", "deg")),
    )  # fmt: skip
    path = still(tmp_path / "sim.csv", t + 1e-3, 2 * np.cos(t))
    given = {"columns": {"position": "angle"}, "scale": {"position": 0.1}, "period": {}}
    found = io.read_with_notes(path, along=log, **given)[0]
    assert same_motion(log, found)
    assert found.unit_names == log.unit_names
    np.testing.assert_allclose(found.force, 2 * np.cos(t), atol=1e-5)
    with pytest.raises(ValueError, match=r"sim.csv: .* 299 samples are not the 300 of log.csv"):
        io.read_with_notes(still(path, t[:-1], t[:-1]), along=log)
    with pytest.raises(ValueError, match=r"sim.csv: .* stamps are up to 5 s off those of log.csv"):
        io.read_with_notes(still(path, t + 5, np.cos(t)), along=log)
    with pytest.raises(ValueError, match=r"recognised as force. .*--columns force=NAME"):
        io.read_with_notes(still(path, t, t, "time,value"), along=log)


@pytest.mark.slow
def test_the_command_takes_a_file_of_time_and_force(healthy, tmp_path):
    log, run = tmp_path / "log.csv", healthy[0]
    written(log, run, run.force)
    sim = still(tmp_path / "sim.csv", run.time[:6000], simulator()(run)[:6000], "time,force")
    out = tmp_path / "out.json"
    assert cli.main(["explain", str(log), "--simulation", sim, "--json", str(out)]) == 0
    document = json.loads(out.read_text())
    assert document["baseline"]["name"] == "simulator"
    assert document["verdict"] == "consistent"


def test_options_that_do_not_go_together_are_refused(tmp_path, capsys):
    log = tmp_path / "log.csv"
    t = np.arange(200) / 100
    table = np.stack([t, np.sin(t), np.cos(t)], axis=1)
    np.savetxt(log, table, delimiter=",", header="time,position,force", comments="")
    assert cli.main(["explain", str(log), "--joint", "elbow"]) == 2
    assert "--mujoco" in capsys.readouterr().err
    assert cli.main(["explain", str(log), "--simulation-holdout", str(log)]) == 2
    assert "--simulation" in capsys.readouterr().err


# ---- MuJoCo ----

PENDULUM = """<mujoco><option timestep="0.001"/><worldbody><body><joint name="elbow" axis="0 1 0"
  damping="{damping}" frictionloss="0.2" armature="0.02"/>
  <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="{mass}"/></body></worldbody>
  </mujoco>"""


def swung(model, seed, seconds=12.0):
    """A recording of a joint that follows sine waves, with encoder counts and torque noise."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(model)
    data, draw = mujoco.MjData(model), np.random.default_rng(seed)
    rates, sizes = 2 * np.pi * np.array([0.3, 0.7, 1.3]), np.array([0.5, 0.2, 0.1])
    phases = draw.uniform(0, 2 * np.pi, 3)
    data.qpos[0], data.qvel[0] = sizes @ np.sin(phases), (sizes * rates) @ np.cos(phases)
    rows = []
    for step in range(round(seconds / model.opt.timestep)):
        angle = rates * step * model.opt.timestep + phases
        goal, speed = sizes @ np.sin(angle), (sizes * rates) @ np.cos(angle)
        force = 60 * (goal - data.qpos[0]) + 4 * (speed - data.qvel[0]) + data.qfrc_bias[0]
        rows.append((step * model.opt.timestep, force, data.qpos[0]))
        data.qfrc_applied[0] = force
        mujoco.mj_step(model, data)
    time, force, position = np.array(rows)[::2].T
    count = 2 * np.pi / 2**17
    noisy = force + 0.02 * draw.normal(size=force.size)
    units = {"force": "N·m", "position": "rad"}
    return simulators.known.Recording(time, noisy, count * np.round(position / count), units=units)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "moved"),
    [({}, None), ({"damping": 0.6}, "joint/elbow/damping"), ({"mass": 1.3}, "body/body1/mass")],
)
def test_a_wrong_value_of_a_mujoco_model(change, moved):
    values = {"damping": 0.3, "mass": 1.0}
    plant, nominal = PENDULUM.format(**values | change), PENDULUM.format(**values)
    run, held = swung(plant, 1), swung(plant, 2)
    found = explain(run, Mujoco(nominal), held)
    if moved is None:
        assert found.verdict == "consistent" and found.findings == []
        return
    (finding,) = found.findings
    assert set(finding.parameters) == {moved} and finding.attribute == moved
    (before,), (after,) = (values[k] for k in change), change.values()
    own, (kind, owner, what) = finding.parameters[moved], moved.split("/")
    assert own.before == before and abs(own.value - after) < 3 * own.standard_error + 1e-3
    assert f"{kind} {owner}: {what} {before:g} → " in finding.sentence
    assert found.to_dict()["findings"][0]["parameters"][moved]["from"] == before
    errors = found.fit["filtered_holdout_force_error"]
    assert errors["after"] < 0.05 * errors["before"]


@pytest.mark.slow
def test_friction_by_what_the_gear_carries_beside_a_mujoco_model():
    """Of MuJoCo's force it is known what is its own friction, and the gear does not carry that."""
    text, share = PENDULUM.format(damping=0.3, mass=1.0), 0.15
    runs = []
    for seed in (1, 2):
        run = swung(text, seed)
        known = Mujoco(text).beside(run).channels
        borne = np.asarray(known[KNOWN_FORCE]) - np.asarray(known[KNOWN_FRICTION])
        way = np.sign(np.gradient(np.asarray(run.position)))
        runs.append(dataclasses.replace(run, force=run.force + share * np.abs(borne) * way))
    found = explain(runs[0], Mujoco(text), runs[1])
    (finding,) = found.findings
    assert finding.effect == "load_dependent_friction" and found.verdict == "explained"
    told = finding.parameters["reaction_friction"]
    assert abs(float(told.value) - share) < 2 * float(told.half_width())
    for name in ("force_error", "holdout_force_error"):  # by `predict`, sample by sample
        assert found.fit[name]["after"] < 0.3 * found.fit[name]["before"]


def test_a_hinge_by_which_all_turns_has_one_zero_with_the_tilt_of_its_base():
    pytest.importorskip("mujoco")
    arm = """<mujoco><worldbody><body><geom size="0.1"/><body><joint name="a" axis="0 1 0"/>
      <geom size="0.1"/><body><joint name="b" axis="0 1 0"/><geom size="0.1"/></body></body></body>
      {}</worldbody></mujoco>"""
    other = '<body><joint name="c" axis="0 1 0"/><geom size="0.1" pos="9 0 0"/></body>'
    assert [Mujoco(arm.format(""), "a").turns_all(name) for name in "ab"] == [True, False]
    assert not Mujoco(arm.format(other), "a").turns_all("a")


def test_models_that_no_log_of_an_axis_fits_are_refused():
    pytest.importorskip("mujoco")
    with pytest.raises(ValueError, match="no such file"):
        Mujoco("nowhere.xml")
    with pytest.raises(ValueError, match="cannot read"):
        Mujoco("<mujoco><nonsense/></mujoco>")
    two = (
        '<mujoco><worldbody><body><joint name="a"/><geom size="0.1"/><body pos="1 0 0">'
        '<joint name="b"/><geom size="0.1"/></body></body></worldbody></mujoco>'
    )
    with pytest.raises(ValueError, match="2 joints: a, b"):
        Mujoco(two)
    with pytest.raises(ValueError, match="no joint 'c'"):
        Mujoco(two, "c")
    free = '<mujoco><worldbody><body><freejoint/><geom size="0.1"/></body></worldbody></mujoco>'
    with pytest.raises(ValueError, match="free or a ball"):
        Mujoco(free)
    t = np.arange(100) / 100
    alone = simulators.known.Recording(t, t, jnp.sin(t), units={"position": "rad"})
    with pytest.raises(ValueError, match="joint 'b'"):
        Mujoco(two, "a")(alone)


def test_without_mujoco_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(ValueError, match=r"jaxfric\[mujoco\]"):
        Mujoco("arm.xml")
    assert terms.KnownForce().affine == ()


TWO = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>
<body name="upper"><joint name="shoulder" axis="0 1 0" damping="0.8" armature="0.05"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="2"/>
<body name="forearm" pos="0.3 0 0"><joint name="elbow" axis="0 1 0" damping="{damping}"
 armature="0.02"/><geom type="capsule" fromto="0 0 0 0.25 0 0" size="0.02" mass="{mass}"/></body>
</body></worldbody></mujoco>"""


def both(model, seed, seconds=12.0):
    """A table of both joints of an arm: time, positions, forces."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(model)
    data, draw = mujoco.MjData(model), np.random.default_rng(seed)
    rates, sizes = 2 * np.pi * np.array([0.3, 0.7, 1.3]), np.array([0.5, 0.2, 0.1])
    phases, rows = draw.uniform(0, 2 * np.pi, (2, 3)), []
    data.qpos[:], data.qvel[:] = np.sin(phases) @ sizes, np.cos(phases) @ (sizes * rates)
    mujoco.mj_forward(model, data)
    for step in range(round(seconds / model.opt.timestep)):
        angle = rates * step * model.opt.timestep + phases
        away = np.sin(angle) @ sizes - data.qpos
        lag = np.cos(angle) @ (sizes * rates) - data.qvel
        force = model.dof_M0 * (3600 * away + 120 * lag) + data.qfrc_bias
        rows.append([step * model.opt.timestep, *data.qpos, *force])
        data.qfrc_applied[:] = force
        mujoco.mj_step(model, data)
    table, count = np.array(rows)[::2], 2 * np.pi / 2**17
    table[:, 1:3] = count * np.round(table[:, 1:3] / count)
    table[:, 3:] += 0.005 * table[:, 3:].std(axis=0) * draw.normal(size=(len(table), 2))
    return table


def test_a_joint_that_stands_in_the_held_out_log_is_answered_without_it(tmp_path):
    arm = TWO.format(damping=0.5, mass=1.2)
    sticks = arm.replace('<joint name="elbow"', '<joint name="elbow" frictionloss="0.1"')
    (tmp_path / "arm.xml").write_text(sticks)
    paths = [str(tmp_path / f"log{seed}.csv") for seed in (1, 2)]
    for number, path in enumerate(paths):
        table = both(arm, number, seconds=4.0)
        table[:, 2] = table[:, 2] if number == 0 else 0.3
        header = "t,q1,q2,tau1,tau2"
        np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.9g")
    command = ["explain", paths[0], "--holdout", paths[1], "--mujoco", str(tmp_path / "arm.xml")]
    arguments = whole().parse_args(command)
    columns = logged(arguments, ["shoulder", "elbow"])

    def joint(name):
        return opened(name, {}, paths, columns, arguments, True, arguments.mujoco)

    moves, stands = joint("shoulder"), joint("elbow")
    assert len(moves.logs) == 2 and not moves.still
    assert len(stands.logs) == 1 and stands.simulator is not None
    assert "log2.csv: the joint elbow stands there" in stands.still[0]


@pytest.mark.slow
def test_the_command_puts_the_simulators_file_right(tmp_path, capsys):
    nominal, plant = (TWO.format(damping=0.5, mass=mass) for mass in (1.2, 1.6))
    (tmp_path / "arm.xml").write_text(nominal)
    logs = [str(tmp_path / f"log{seed}.csv") for seed in (1, 2)]
    for seed, path in enumerate(logs):
        header = "t,q1,q2,tau1,tau2"
        np.savetxt(path, both(plant, seed), delimiter=",", header=header, comments="", fmt="%.9g")
    out = {name: str(tmp_path / name) for name in ("new.xml", "out.json")}
    command = ["explain", logs[0], "--holdout", logs[1], "--mujoco", str(tmp_path / "arm.xml")]
    assert cli.main([*command, "--save", out["new.xml"], "--json", out["out.json"]]) == 0
    said = capsys.readouterr().out
    mass = (
        "shoulder and elbow together: body forearm: mass with its inertia in proportion 1.2 → 1.6"
    )
    assert " ".join(said.split()).count(mass) == 1
    document = json.loads((tmp_path / "out.json").read_text())
    assert [row["joint"] for row in document["joints"]] == ["shoulder", "elbow"]
    assert [row["verdict"] for row in document["joints"]] == ["explained", "explained"]
    values = [row["explanation"]["findings"][0]["parameters"] for row in document["joints"]]
    assert values[0] == values[1] and list(values[0]) == ["body/forearm/mass"]
    for errors in document["patch"]["errors"].values():
        assert errors["holdout_force_error"]["file"] < 0.02 < errors["force_error"]["before"]
    lines = set((tmp_path / "new.xml").read_text().splitlines()) - set(nominal.splitlines())
    assert len(lines) == 1 and 'mass="1.6' in lines.pop()


def test_a_log_without_the_models_joints_is_refused(tmp_path, capsys):
    pytest.importorskip("mujoco")
    (tmp_path / "arm.xml").write_text(TWO.format(damping=0.5, mass=1.2))
    log = tmp_path / "log.csv"
    log.write_text("time,hip_position,hip_effort\n0,0,0\n1,1,1\n")
    assert cli.main(["explain", str(log), "--mujoco", str(tmp_path / "arm.xml")]) == 2
    error = capsys.readouterr().err
    assert "shoulder, elbow" in error and "--columns shoulder_position=NAME" in error
    options = ["--mujoco", str(tmp_path / "arm.xml"), "--joint", "hip"]
    assert cli.main(["explain", str(log), *options]) == 2
    assert "no joint 'hip'" in capsys.readouterr().err
