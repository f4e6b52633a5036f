"""Bristles: Dahl's and LuGre's friction as a state of the plant, and their stiffness from data."""

import json
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxfric as jf
from jaxfric.cli import main
from jaxfric.identification.presliding import KINDS, Kind, Presliding, doubt
from jaxfric.models import Model

STEP = 1e-3
STIFFNESS, DAMPING = 1e6, 500.0


def pushed(peak=30.0, seconds=0.5):
    """A force that moves an axis at rest there and back."""
    t = np.arange(round(seconds / STEP)) * STEP
    return jf.Recording(t, peak * np.sin(4 * np.pi * t), position=np.zeros(t.size))


def lugre(model, force, stiffness, damping):
    """The equations of Canudas de Wit et al. (1995), solved by another program."""
    p = {name: float(value) for name, value in model.parameters.items()}

    def slope(time, state):
        _, v, z = state
        s = "+" if v > 0 else "-"
        shape = 1 / (1 + (v / p[f"stribeck_velocity{s}"]) ** 2)
        level = p[f"coulomb{s}"] + p[f"stribeck_force{s}"] * shape
        turning = v - stiffness * abs(v) / level * z
        friction = stiffness * z + damping * turning + p[f"viscous{s}"] * v
        held = force[min(int(time / STEP + 1e-9), len(force) - 1)]
        return [v, (held - friction) / p["inertia"], turning]

    time = np.arange(len(force)) * STEP
    return solve_ivp(
        slope, (0, time[-1]), np.zeros(3), "Radau", time, rtol=1e-7, atol=1e-11, max_step=STEP
    ).y


@pytest.mark.slow
def test_the_simulated_motion_is_that_of_another_solver():
    axis, clock = jf.scenario.machine(), pushed()
    x, v, _ = lugre(axis, np.asarray(clock.force), STIFFNESS, DAMPING)
    run = jf.simulate(axis.with_bristles(STIFFNESS, DAMPING), clock, initial=(0.0, 0.0))
    assert np.sqrt(np.mean((np.asarray(run.velocity) - v) ** 2)) < 0.02 * np.std(v)
    assert np.sqrt(np.mean((np.asarray(run.position) - x) ** 2)) < 0.02 * np.std(x)


@pytest.mark.slow
def test_stiffer_than_the_steps_resolve_it_is_stick_slip():
    """L-stable: at 1e10 N/m, unresolved by far, the motion is that of friction that jumps."""
    axis, clock = jf.scenario.machine(), pushed()
    stiff = jf.simulate(axis.with_bristles(1e10), clock, initial=(0.0, 0.0)).velocity
    stick = jf.simulate(axis, clock, initial=(0.0, 0.0)).velocity
    assert float(jnp.max(jnp.abs(stiff - stick))) < 0.02 * float(jnp.max(jnp.abs(stick)))


def dahl(force, distance=1e-4):
    slip = {"coulomb+": 20.0, "viscous+": 60.0, "coulomb-": 18.0, "viscous-": 80.0}
    bristle = {"presliding_force": force, "presliding_distance": distance}
    values = {"inertia": 5.0} | slip | bristle
    return jf.models.from_parameters(jf.models.coulomb_viscous() + jf.terms.Dahl(), values)


@pytest.mark.slow
def test_a_push_below_break_away_is_held_by_a_spring():
    """Dahl: 5 N move the axis by some of x_d, and nearly back when they are gone."""
    t = np.arange(2000) * STEP
    force = 5.0 * np.clip(np.minimum(t / 0.5, (1.5 - t) / 0.5), 0.0, 1.0)
    clock = jf.Recording(t, force, position=np.zeros(t.size))
    x = np.asarray(jf.simulate(dahl(19.0), clock, initial=(0.0, 0.0)).position)
    # Within the friction that jumps the spring is x_d F/F_p long at least; hysteresis remains.
    assert 0.1e-4 < x[900:1000].mean() < 0.5e-4
    assert abs(x[-200:].mean()) < 0.4 * x[900:1000].mean()


@pytest.mark.slow
@pytest.mark.parametrize("force", [15.0, 19.0, 40.0])
def test_memory_never_drives_the_axis(force):
    """Not even where it takes more off than there is friction (40 N of 20)."""
    still = pushed(peak=0.0)
    run = jf.simulate(dahl(force), still, initial=(0.0, 0.0))
    np.testing.assert_array_equal(np.asarray(run.velocity), 0.0)
    fast = jf.simulate(dahl(force, 1e-6), pushed(), initial=(0.0, 0.0)).velocity
    plain = jf.simulate(dahl(15.0, 1e-9), pushed(), initial=(0.0, 0.0)).velocity
    assert float(jnp.max(jnp.abs(fast - plain))) < 0.02 * float(jnp.max(jnp.abs(plain)))


def test_smoothing_is_refused():
    with pytest.raises(ValueError, match="smooth"):
        jf.simulate(dahl(15.0), pushed(), smooth=1e-3)


@pytest.fixture(scope="module")
def bristled():
    axis = jf.scenario.machine().with_bristles(STIFFNESS, DAMPING)
    log = jf.scenario.record(
        axis, force_noise=0.3, encoder=jf.Encoder(1e-7), key=jax.random.key(3), sample_rate=2000.0
    )
    return axis, log, jf.identify("lorentzian", log)


@pytest.mark.slow
def test_a_simulated_lugre_machine_is_identified_within_its_intervals(bristled):
    axis, log, found = bristled
    test = jf.presliding(log, found)
    for estimate, truth in ((test.stiffness, STIFFNESS), (test.damping, DAMPING)):
        low, high = estimate.interval(0.99)
        assert low < truth < high
    assert float(test.stiffness.standard_error) < 0.05 * STIFFNESS
    # Beside them the slip curve is right, which presliding bends for the identification of slip.
    for name in ("coulomb+", "coulomb-", "viscous+", "stribeck_force+", "stribeck_force-"):
        truth = float(axis.parameters[name])
        assert abs(float(test.model.parameters[name]) - truth) < 0.05 * truth
        assert abs(float(found.model.parameters["stribeck_force-"]) - 10.0) > 5.0
    assert test.kind == "lugre" and {each.name for each in test.kinds} == {"jump", "dahl", "lugre"}
    after = jf.predict(test.model, log) - log.force
    before = jf.predict(found.model, log) - log.force
    assert float(jnp.std(after)) < 0.5 * float(jnp.std(before))


@pytest.mark.slow
def test_without_bristles_none_are_found():
    log = jf.scenario.record(
        jf.scenario.machine(), force_noise=0.3, encoder=jf.Encoder(1e-6), key=jax.random.key(4),
        sample_rate=1000.0,
    )  # fmt: skip
    test = jf.presliding(log, jf.identify("lorentzian", log))
    # None, or a distance below what the encoder counts.
    assert test.stiffness is None and test.why or test.distance < 2e-6
    assert test.kind == "jump"
    none = repr(test).startswith("No bristles identified: ")
    assert none == (test.stiffness is None)


@pytest.mark.slow
def test_the_command_says_what_it_found_and_saves_it(bristled, tmp_path, capsys):
    _, log, _ = bristled
    file, saved, out = (tmp_path / name for name in ("axis.csv", "model.json", "found.json"))
    columns = np.stack([log.time, log.position, log.force], axis=1)
    np.savetxt(file, columns, delimiter=",", header="time,position,force", comments="")
    command = ["presliding", str(file), "--model", "lorentzian", "--save", str(saved)]
    assert main([*command, "--json", str(out)]) == 0
    said = capsys.readouterr().out
    assert "* LuGre" in said and "Presliding: stiffness" in said.replace("\n", " ")
    document = json.loads(out.read_text())
    assert document["kind"] == "lugre"
    assert document["force_error"]["bristles"] < document["force_error"]["jumping"]
    assert Model.from_dict(json.loads(saved.read_text())).bristles is not None
    assert main(["presliding", str(file), "--model", "gausian"]) == 2
    assert "gaussian" in capsys.readouterr().err


def test_bristles_are_saved_and_said_at_export():
    from jaxfric.export import export

    axis = jf.scenario.machine().with_bristles(STIFFNESS, DAMPING)
    again = Model.from_dict(json.loads(json.dumps(axis.to_dict())))
    np.testing.assert_allclose(again.bristles, axis.bristles)
    assert again.with_parameters({"inertia": 4.0}).bristles is not None
    for target in ("c", "st", "modelica", "mujoco", "urdf", "table"):
        assert any("bristles" in remark for remark in export(axis, target).remarks)
    with pytest.raises(ValueError, match="stiffness"):
        axis.with_bristles(-1.0)


@pytest.mark.parametrize(
    ("name", "kind", "left", "inertia", "said"),
    [
        ("not_passive", "dahl", 0.01, 5.0, ""),
        ("not_described", "lugre", 0.01, 5.0, ""),
        ("not_passive", "dahl", 0.01, -5.0, "not_passive: "),
        ("not_passive", "dahl", 0.8, 5.0, "not_described: "),
        ("not_passive", "jump", 0.01, 5.0, "not_passive: of friction that jumps"),
        ("on_border", "dahl", 0.01, 5.0, "on_border: of friction that jumps"),
        ("successful", "jump", 0.01, 5.0, ""),
    ],
)
def test_friction_beside_bristles_is_judged_with_them(name, kind, left, inertia, said):
    """Friction that jumps may seem to drive an axis whose friction bends."""
    found = SimpleNamespace(result_name=name, diagnosis="of friction that jumps")
    model = jf.scenario.machine().with_parameters({"inertia": inertia})
    errors = dict.fromkeys(model.parameters, 0.1)
    kinds = tuple(Kind(each, left, 0.0 if each == kind else 100.0) for each in KINDS)
    test = Presliding(None, None, 1e-5, 1.0, "", model, errors, kinds)
    assert test.kind == kind
    against = doubt(test, found)
    assert against.startswith(said) and bool(against) == bool(said)


@pytest.mark.slow
def test_misuse_is_said(bristled):
    _, log, found = bristled
    with pytest.raises(ValueError, match="batch"):
        jf.presliding(jf.stack([log] * 2), found)
    still = jf.Recording(log.time, log.force, velocity=jnp.ones_like(log.time))
    with pytest.raises(ValueError, match="position"):
        jf.presliding(still, found)
