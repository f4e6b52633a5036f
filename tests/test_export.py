"""A model handed over computes the same force, or says what it costs."""

import csv
import ctypes
import json
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import models, terms
from jaxfric.cli import main, saving
from jaxfric.data.recording import Recording
from jaxfric.export import TARGETS, export
from jaxfric.terms import Directional
from jaxfric.terms.actuator import carried

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
needs_cc = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler here")

# Every law with numbers for its nonlinear parameters; places and times inside ±1.
LAWS = {
    "coulomb": terms.Coulomb(),
    "viscous": terms.Viscous(),
    "inertia": terms.Inertia(),
    "offset": terms.Offset(),
    "gaussian": terms.Gaussian(0.05),
    "lorentzian": terms.Lorentzian(0.05),
    "exponential": terms.Exponential(0.05),
    "generalised": terms.Generalised(0.05, 1.3),
    "asymmetry": terms.FrictionAsymmetry(),
    "coulomb forwards": terms.CoulombAsymmetry("forwards"),
    "coulomb backwards": terms.CoulombAsymmetry("backwards"),
    "coulomb by half": terms.CoulombAsymmetry("both"),
    "drag": terms.QuadraticDrag(),
    "power": terms.PowerLaw(0.7, unit_speed=0.3),
    "thinning": terms.ShearThinning(0.2),
    "unbalance": terms.GravityUnbalance(3.0),
    "cogging": terms.Cogging(0.12, harmonics=3),
    "spring": terms.Spring(-0.2),
    "hardening": terms.HardeningSpring(0.1),
    "stop": terms.EndStop(0.4),
    "lower stop": terms.LowerEndStop(-0.3),
    "friction": terms.PositionDependentFriction(0.4),
    "spot": terms.StickySpot(0.1, 0.2),
    "local force": terms.LocalForce(0.1, 0.2),
    "encoder": terms.EncoderError(0.7, 3.0),
    "gain drift": terms.GainDrift(0.6, start=-1.0),
    "varying inertia": terms.PositionDependentInertia(0.7),
    "tone": terms.PeriodicDisturbance(2.0),
    "load drift": terms.LoadDrift(start=-0.8, duration=1.5, degree=5),
    "pulses": terms.DisturbancePulses((-0.4, 0.5), 0.2),
    "push": terms.DisturbanceForce(-0.3, 0.5),
    "push ramps": terms.DisturbanceForce(-0.3, 0.5, ramp=0.2),
    "table over position": terms.Table("position", (-0.5, 0.0, 0.2, 0.7)),
    "table over velocity": terms.Table("velocity", (0.0, 0.3)),
    "directional table": Directional(terms.Table("position", (-0.5, 0.1, 0.7))),
    "warming": terms.ThermalDrift(terms.Viscous(), 0.6, start=-1.0),
    "step": terms.FrictionStep(terms.Coulomb(), 0.2),
    "ramp": terms.FrictionStep(terms.Coulomb(), 0.2, ramp=0.3),
    "gradual": terms.FrictionRamp(terms.Coulomb(), 0.2, 0.5),
    "warming by direction": terms.ThermalDrift(Directional(terms.Coulomb()), 0.6),
    "crossing": Directional(terms.SmoothCrossing(0.1), terms.SmoothCrossing(0.2)),
    "directional": Directional(
        terms.Coulomb() + terms.Viscous() + terms.Gaussian(0.05),
        terms.Coulomb() + terms.Viscous() + terms.Gaussian(0.08),
    ),
    "directions of two kinds": Directional(terms.Gaussian(0.05), terms.Viscous()),
    "gravity": terms.Gravity(0.8),
    "payload": terms.PayloadChange(step_time=0.1),
    "payload on an angle": terms.PayloadChange(
        terms.Inertia() + terms.Gravity(0.7), step_time=-0.3, ramp=0.2
    ),
    "gain asymmetry": terms.GainAsymmetry(),
    "force ripple": terms.ForceRipple(0.2),
    "force constant": terms.PositionDependentForceConstant(-0.6, 0.9),
    "steep force constant": terms.PositionDependentForceConstant(-0.9, 0.3, 4),
    "dead-band": terms.ActuatorDeadband(),
    "saturation": terms.ActuatorSaturation(4.0),
    "soft saturation": terms.SoftSaturation(4.0),
    "load friction": terms.LoadDependentFriction(),
    "reaction friction": terms.ReactionFriction(),
    "gain step": terms.GainStep(-0.1, ramp=0.3),
    "gain by direction": Directional(terms.GainAsymmetry()),
}


def model(term, seed=0, units=None):
    count = len(term.affine)
    alpha = np.random.default_rng(seed).uniform(0.5, 2.0, count)
    return models.Model(term, jnp.asarray(alpha), tuple((units or {}).items()))


def everything():
    return model(sum(list(LAWS.values())[1:], terms.Coulomb()))


def motion(count=400, seed=1):
    """Unrelated signals: whatever a law takes for another shows."""
    signals = np.random.default_rng(seed).uniform(-1, 1, (4, count))
    signals[1, :3] = 0.0
    return [jnp.asarray(row) for row in signals]


def force_of(model, x, v, a, t):
    """The library's force, the derivative of momentum taken exactly."""
    channels = {}

    def motion_of(position, velocity, time):
        return Recording(time, jnp.zeros_like(t), position, velocity, channels=channels)

    def whole(some):
        def momentum(position, velocity, time):
            return some.momentum(motion_of(position, velocity, time))

        # Of a load that is taken up in a ramp the momentum changes with time, too.
        rate = jax.jvp(momentum, (x, v, t), (v, a, jnp.ones_like(t)))[1]
        return some.force(motion_of(x, v, t)) + rate

    sound = {"predicted_force": lambda term: True, "predicted_reaction": carried}
    if model.term.coordinates & set(sound):
        rest = model.without("predicted_")
        channels = {name: whole(rest.only(kept)) for name, kept in sound.items()}
    return whole(model)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """The C text of all laws together, compiled strictly and loaded."""
    if COMPILER is None:
        pytest.skip("there is no C compiler here")
    folder = tmp_path_factory.mktemp("c")
    return load(folder, everything())


def load(folder, model):
    source, library = folder / "axis.c", folder / "axis.so"
    source.write_text(export(model, "c").text, "utf-8")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-shared", "-fPIC"]
    done = subprocess.run(
        [COMPILER, *flags, "-o", str(library), str(source), "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    loaded = ctypes.CDLL(str(library))
    for function, count in ((loaded.axis_friction, 1), (loaded.axis_force, 4)):
        function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double] * count
    return loaded


def test_every_law_of_the_present_motion_is_tried():
    def kinds(term):
        yield type(term)
        for name in ("terms", "positive", "negative", "term"):
            inner = getattr(term, name, None)
            for part in inner if isinstance(inner, tuple) else [inner]:
                if isinstance(part, terms.AbstractTerm):
                    yield from kinds(part)

    tried = {kind for term in LAWS.values() for kind in kinds(term)}
    laws = (law for law in vars(terms).values() if isinstance(law, type))
    spelled = {law for law in laws if {"text", "factor_text"} & set(vars(law))}
    plain = {terms.AbstractTerm, terms.AbstractModulated}
    assert tried >= spelled - plain and len(spelled) > 25


@pytest.mark.slow
@needs_cc
def test_c_computes_the_library_s_force(compiled):
    signals = motion()
    wanted = np.asarray(force_of(everything(), *signals))
    rows = zip(*(np.asarray(signal).tolist() for signal in signals), strict=True)
    given = np.array([compiled.axis_force(*row) for row in rows])
    np.testing.assert_allclose(given, wanted, rtol=1e-12, atol=1e-12 * np.abs(wanted).max())


@needs_cc
def test_c_computes_the_library_s_friction(compiled):
    velocity = motion()[1]
    wanted = np.asarray(everything().friction(velocity))
    given = np.array([compiled.axis_friction(v) for v in np.asarray(velocity).tolist()])
    np.testing.assert_allclose(given, wanted, rtol=1e-12, atol=1e-12 * np.abs(wanted).max())


@needs_cc
@pytest.mark.parametrize("name", ["gaussian", "symmetric-generalised"])
def test_c_of_a_named_model(name, tmp_path):
    term = models.named(name)
    values = {p.name: 0.3 + 0.1 * i for i, p in enumerate((*term.affine, *term.nonlinear))}
    known = models.from_parameters(term, values)
    loaded = load(tmp_path, known)
    for v in (-0.7, -0.01, 0.0, 0.02, 1.1):
        assert loaded.axis_friction(v) == pytest.approx(float(known.friction(v)), rel=1e-12)
        inertial = loaded.axis_force(0.0, v, 2.0, 0.0) - loaded.axis_friction(v)
        assert inertial == pytest.approx(2.0 * values["inertia"])


def test_c_states_values_units_and_cost():
    found = export(model(terms.Coulomb() + terms.Viscous(), units={"force": "kN"}), "c")
    assert re.search(r"static const double viscous = \S+; /\* viscous, kN·s/m \*/", found.text)
    assert found.force_error == (0.0, 0.0, 0.0, "kN") and not found.left_out


def test_a_unit_cannot_break_out_of_a_comment():
    text = export(model(terms.Coulomb(), units={"force": "*/ int x; /*"}), "c").text
    assert "int x" in text
    assert "int x" not in re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)


# ---- Modelica ----


def translated(expression, names):
    """A Modelica expression by Python's rules: what is left to differ is the spelling."""
    text = expression.replace("noEvent", "").replace("^", "**")
    while found := re.search(r"\(if ([^()]*?) then ", text):
        depth, end, other = 1, found.end(), None
        while depth:  # the parenthesis that closes the choice, and its else
            if depth == 1 and text.startswith(" else ", end):
                other = end
            depth += {"(": 1, ")": -1}.get(text[end], 0)
            end += 1
        yes, no = text[found.end() : other], text[other + 6 : end - 1]
        text = f"{text[: found.start()]}where({found[1]}, {yes}, {no}){text[end:]}"
    return eval(text, names)


def parsed(text):
    """Parameters and equations of a block."""
    parameters = re.findall(r"parameter Real (\w+)(?:\(unit=\"[^\"]*\"\))? = (\S+) \"", text)
    equations = re.findall(r"^  (friction|f|r|force) = (.*?);$", text, re.MULTILINE | re.DOTALL)
    return {name: float(value) for name, value in parameters}, dict(equations)


@pytest.mark.slow
def test_modelica_computes_the_library_s_force():
    known, (x, v, a, t) = everything(), motion()
    parameters, equations = parsed(export(known, "modelica").text)
    assert len(parameters) == len(known.parameters)
    functions = {"where": np.where, "max": np.maximum, "min": np.minimum}
    functions |= {name: getattr(np, name) for name in ("sign", "abs", "exp", "sin", "cos")}
    names = parameters | functions | {"x": x, "v": v, "a": a, "t": t}
    names = {k: np.asarray(z) if isinstance(z, jax.Array) else z for k, z in names.items()}
    for name in ("friction", "f", "r", "force"):
        names[name] = translated(" ".join(equations[name].split()), names)
    friction, force = names["friction"], names["force"]
    np.testing.assert_allclose(friction, known.friction(v), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(force, force_of(known, x, v, a, t), rtol=1e-11, atol=1e-10)


def test_modelica_gives_a_bristle_its_state():
    text = export(model(terms.Coulomb() + terms.LuGre(1e-3, 0.05)), "modelica").text
    assert "der(deflection_presliding_force) = noEvent(v / presliding_distance" in text
    assert "initial equation" in text
    assert "presliding_stribeck_force * exp(" in text


def test_modelica_is_accepted_by_a_parser():
    parser = pytest.importorskip("pymoca.parser", reason="pymoca is not installed")
    bristle = model(everything().term + terms.Dahl(1e-3))
    tree = parser.parse(export(bristle, "modelica", name="stage").text)
    assert tree is not None and "stage" in tree.classes


def test_modelica_spells_units_its_own_way():
    units = {"force": "N·m", "position": "rad"}
    text = export(model(terms.Inertia() + terms.Viscous(), units=units), "modelica").text
    assert 'viscous(unit="N.m.s/rad")' in text and 'inertia(unit="kg.m2")' in text


# ---- joints of simulators ----


def joint_of(text):
    found = ET.fromstring(text)
    return found.find(".//joint" if found.tag == "mujoco" else ".//dynamics").attrib


def numbers_of(text):
    return {key: float(value) for key, value in joint_of(text).items() if " " not in value}


@pytest.mark.parametrize("target", ["mujoco", "urdf"])
def test_a_joint_that_is_all_there_is_costs_nothing(target):
    values = {"inertia": 3.0, "coulomb": 5.0, "viscous": 20.0}
    known = models.from_parameters(terms.Inertia() + terms.Coulomb() + terms.Viscous(), values)
    found = export(known, target)
    joint = numbers_of(found.text)
    assert joint["damping"] == pytest.approx(20.0)
    assert joint["frictionloss" if target == "mujoco" else "friction"] == pytest.approx(5.0)
    if target == "mujoco":
        assert joint["armature"] == 3.0
    assert found.force_error.relative < 1e-12 and not found.left_out
    assert found.speed == (0.0, 0.25)  # where viscous friction has grown to Coulomb friction


def stribeck():
    values = {
        "inertia": 3.0,
        **{
            f"{name}{side}": value
            for side in "+-"
            for name, value in {"coulomb": 5.0, "viscous": 20.0, "stribeck_force": 4.0}.items()
        },
        "stribeck_velocity+": 0.02,
        "stribeck_velocity-": 0.02,
    }
    return models.from_parameters(models.gaussian(), values)


@pytest.mark.parametrize("target", ["mujoco", "urdf"])
def test_the_cost_of_a_joint_is_the_distance_between_the_curves(target):
    known = stribeck()
    found = export(known, target, speed=(0.0, 0.4))
    joint = numbers_of(found.text)
    level = joint["frictionloss" if target == "mujoco" else "friction"]
    v = np.linspace(1e-9, 0.4, 40001)
    wanted = np.asarray(known.friction(jnp.asarray(v)))
    left = wanted - level - joint["damping"] * v
    assert found.force_error.rms == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-3)
    assert found.force_error.relative == pytest.approx(
        np.sqrt(np.mean(left**2) / np.mean(wanted**2)), rel=1e-3
    )
    assert found.force_error.worst == pytest.approx(np.abs(left).max(), rel=1e-3)
    # No other pair of numbers is nearer.
    for step in (0.99, 1.01):
        worse = wanted - step * level - joint["damping"] * v
        assert np.mean(worse**2) > np.mean(left**2)
    assert [entry.split(":")[0] for entry in found.left_out] == ["stribeck"]


def test_the_cost_does_not_depend_on_units():
    known, scale = stribeck(), 1e6
    lengths = {"inertia": 1.0, "viscous": 1.0, "coulomb": scale, "stribeck_force": scale}
    scaled = {  # force in µN, position in µm
        name: float(value) * lengths.get(name.rstrip("+-"), scale)
        for name, value in known.parameters.items()
    }
    other = models.from_parameters(models.gaussian(), scaled, {"force": "µN", "position": "µm"})
    first, second = export(known, "mujoco"), export(other, "mujoco")
    assert second.force_error.relative == pytest.approx(first.force_error.relative, rel=1e-9)
    assert second.speed[1] == pytest.approx(scale * first.speed[1])
    assert any("SI" in remark for remark in second.remarks)
    assert not any("SI" in remark for remark in first.remarks)


def test_what_a_joint_lacks_is_counted_and_said():
    base = terms.Coulomb() + terms.Viscous()
    values = {"coulomb": 5.0, "viscous": 20.0}
    clean = models.from_parameters(base, values)
    cogging = {"cogging_sin": 0.6, "cogging_cos": 0.8, "pitch": 0.01, "offset": 2.0}
    known = models.from_parameters(base + terms.Cogging() + terms.Offset(), values | cogging)
    assert export(clean, "urdf").force_error.rms < 1e-12
    found = export(known, "urdf")
    assert found.force_error.rms == pytest.approx(np.sqrt(0.5 + 4.0), rel=5e-3)
    assert found.force_error.worst == pytest.approx(3.0, rel=5e-3)
    assert [entry.split(":")[0] for entry in found.left_out] == ["cogging", "offset"]


@pytest.mark.parametrize(
    ("terms_", "values"),
    [
        (terms.Coulomb() + terms.Offset(), {"coulomb": 0.2, "offset": -0.9}),
        (terms.Directional(terms.Coulomb()), {"coulomb+": -0.7, "coulomb-": 1.1}),
    ],
)
def test_a_spring_rests_where_the_constant_force_says(terms_, values):
    """Whether a model holds the constant of a spring as an offset or between directions."""
    known = models.from_parameters(terms_ + terms.Spring(), values | {"stiffness": 3.0})
    found = export(known, "mujoco", position=(-1.0, 1.0))
    assert float(joint_of(found.text)["springref"]) == pytest.approx(0.3)
    assert float(joint_of(found.text)["frictionloss"]) == pytest.approx(0.2)
    assert found.force_error.relative < 1e-9 and not found.left_out
    assert any("rests at 0.3" in remark for remark in found.remarks)


def test_a_spring_is_part_of_a_joint_where_the_target_has_one():
    known = models.from_parameters(
        terms.Coulomb() + terms.Spring(0.3), {"coulomb": 5.0, "stiffness": 7.0}
    )
    found = export(known, "mujoco", position=(0.0, 1.0))
    assert joint_of(found.text)["stiffness"] == "7.0" and joint_of(found.text)["springref"] == "0.3"
    assert found.force_error.relative < 1e-12 and not found.left_out
    without = export(known, "urdf", position=(0.0, 1.0))
    assert without.force_error.worst == pytest.approx(7 * 0.7, rel=1e-2)
    unknown = export(known, "urdf")
    assert "--position" in unknown.left_out[0]


def test_a_joint_cannot_drive():
    """Friction and damping below zero would: the nearest that is none stands instead."""
    known = models.from_parameters(
        terms.Coulomb() + terms.Viscous(), {"coulomb": 5.0, "viscous": -1.0}
    )
    joint = joint_of(export(known, "urdf", speed=(0.0, 1.0)).text)
    assert float(joint["damping"]) == 0.0 and 4.0 < float(joint["friction"]) < 5.0


@pytest.mark.parametrize("target", ["mujoco", "urdf"])
def test_memory_and_channels_are_left_out_of_a_joint_and_said(target):
    term = terms.Coulomb() + terms.Dahl(1e-3) + terms.ActuatorDeadband()
    found = export(model(term), target)
    assert "presliding: up to" in found.left_out[0]
    whole = "actuator_deadband: it depends on the whole force, which is not all here (not counted)"
    assert whole in found.left_out[1]
    assert found.force_error.worst > 0


def test_mujoco_moves_as_the_joint_says():
    """Held below break-away, and above it the speed at which friction takes up the force."""
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
    text = export(stribeck(), "mujoco").text
    body = (
        '<option gravity="0 0 0" timestep="0.001"/><worldbody><body>'
        '<joint class="axis" type="slide"/><geom size="1" mass="0.01"/></body></worldbody>'
    )
    read = mujoco.MjModel.from_xml_string(text.replace("</mujoco>", body + "</mujoco>"))
    friction, damping = read.dof_frictionloss[0], read.dof_damping[0]
    for force, speed in ((0.5 * friction, 0.0), (3 * friction, 2 * friction / damping)):
        data = mujoco.MjData(read)
        data.qfrc_applied[0] = force
        mujoco.mj_step(read, data, 5000)
        assert data.qvel[0] == pytest.approx(speed, rel=1e-3, abs=2e-3 * friction / damping)


# ---- table ----


def rows_of(text):
    head, *rows = csv.reader(text.splitlines())
    return dict(zip(head, np.array(rows, float).T, strict=True))


def test_a_table_holds_friction_and_every_further_term():
    term = (
        terms.Inertia()
        + Directional(terms.Coulomb() + terms.Viscous() + terms.Gaussian(0.02))
        + terms.Cogging(0.01)
        + terms.StickySpot(0.1, 0.01)
        + terms.PeriodicDisturbance(3.0)
    )
    known = model(term)
    found = export(known, "table", speed=(0.0, 0.3))
    columns = rows_of(found.text)
    assert list(columns) == [
        "velocity [m/s]",
        "friction [N]",
        "position [m]",
        "cogging [N]",
        "sticky_spot [N]",
        "time [s]",
        "periodic_disturbance [N]",
    ]
    velocity, friction = columns["velocity [m/s]"], columns["friction [N]"]
    np.testing.assert_allclose(friction, known.friction(jnp.asarray(velocity)), rtol=1e-12)
    assert velocity.min() == -0.3 and velocity.max() == 0.3 and 0.0 not in velocity
    x = columns["position [m]"]
    angle = 2 * np.pi * x / 0.01
    a = known.parameters
    cogging = float(a["cogging_sin"]) * np.sin(angle) + float(a["cogging_cos"]) * np.cos(angle)
    np.testing.assert_allclose(columns["cogging [N]"], cogging, atol=1e-12)
    assert columns["sticky_spot [N]"].max() == pytest.approx(float(a["spot_force"]), rel=0.1)
    assert 0 < found.force_error.relative < 1e-2


def test_a_table_without_a_range_asks_for_one():
    known = model(terms.Coulomb() + terms.Spring())
    with pytest.raises(ValueError, match="--position"):
        export(known, "table")
    assert "spring [N]" in export(known, "table", position=(0.0, 0.4)).text


# ---- refusals ----


@pytest.mark.parametrize(
    ("target", "term", "words"),
    [
        ("c", terms.Dahl(1e-3), "presliding: it has a memory.*; up to .* N around a reversal"),
        ("fmu", terms.Dahl(1e-3), "presliding: it has a memory"),
        ("c", terms.Backlash(1e-3), "backlash: it has a memory"),
        ("st", terms.Compliance(20.0, 0.1), "compliance: it has a memory, and a .* has none$"),
        ("table", terms.Dahl(1e-3), "presliding.*memory"),
        ("c", terms.LoadDependentFriction("load"), "load_dependent_friction: it needs load, which"),
        ("c", terms.TransportDelay(), "delay: hand over the motion commanded 0.* s later instead$"),
        ("modelica", terms.ActuatorLag(), "actuator_lag: hand over .* instead, to first order"),
        ("c", terms.SensorFilter(), "sensor_filter: the log's alone, and the machine has none"),
        ("fmu", terms.KnownForce(), "the other simulator's force: add to it"),
        ("table", terms.GainAsymmetry(), "gain_asymmetry: it depends on the whole force"),
        ("table", terms.ThermalDrift(time_constant=2.0), "thermal_drift: it has no form there"),
    ],
)
def test_what_a_target_cannot_hold_is_left_out_and_named(target, term, words):
    found = export(model(terms.Coulomb() + term), target)
    assert re.search(words, "\n".join(found.left_out))
    # The reader of the file alone is told, too, and no parameter of it is left behind.
    told = " ".join(found.text.split()).replace(" * Left", " Left")
    assert target == "table" or f"Left out: {found.left_out[0].split(':')[0]}" in told
    assert all(f"{p.name} " not in found.text.split("Left out")[0] for p in term.affine)
    if target != "table":
        assert export(model(terms.Coulomb()), target).force_error == found.force_error


def test_beside_another_simulator_s_force_nothing_acts_on_a_part_of_it():
    term = terms.KnownForce() + terms.Coulomb() + terms.GainAsymmetry()
    found = export(model(term), "c")
    assert "gain_asymmetry: it depends on the whole force" in found.left_out[1]
    assert "const double f" not in found.text


@pytest.mark.parametrize(
    ("target", "options", "words"),
    [
        ("matlab", {}, "no target 'matlab'; there are c, st, modelica"),
        ("c", {"name": "2nd axis"}, "--name"),
        ("c", {"name": "double"}, "--name"),
        ("modelica", {"name": "block"}, "--name"),
        ("mujoco", {"name": '"><evil'}, "--name"),
        ("urdf", {"speed": (0.3, 0.1)}, "--speed"),
        ("urdf", {"speed": (-0.3, 0.1)}, "--speed"),
        ("urdf", {"position": (1.0, 1.0)}, "empty"),
        ("c", {"speed": (0.0, 1.0)}, "--speed"),
    ],
)
def test_bad_arguments_are_refused(target, options, words):
    with pytest.raises(ValueError, match=words):
        export(model(terms.Coulomb()), target, **options)


def test_an_unidentified_model_is_refused():
    with pytest.raises(ValueError, match="stribeck_velocity"):
        export(model(terms.Gaussian()), "urdf")


# ---- the command ----


@pytest.fixture
def saved(tmp_path, monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    path = tmp_path / "model.json"
    path.write_text(json.dumps(stribeck().to_dict()), "utf-8")
    return str(path)


@pytest.mark.parametrize("target", TARGETS)
def test_the_command_writes_a_file_and_says_the_cost(saved, target, tmp_path, capsys):
    out = tmp_path / "out.txt"
    assert main(["export", saved, "--to", target, "-o", str(out)]) == 0
    printed = capsys.readouterr()
    assert out.read_bytes() == export(stribeck(), target).content
    assert str(out) in printed.out and "force error" in printed.out and printed.err == ""


def test_without_a_file_the_text_goes_out_alone(saved, capsys):
    assert main(["export", saved, "--to", "urdf", "--speed", "0:0.4", "--name", "stage"]) == 0
    printed = capsys.readouterr()
    assert ET.fromstring(printed.out).attrib["name"] == "stage"
    assert "force error" in printed.err and "0 to 0.4 m/s" in printed.err


def test_bad_input_writes_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    path, out = tmp_path / "model.json", tmp_path / "axis.c"
    path.write_text(json.dumps(model(terms.Coulomb() + terms.Spring(0.1)).to_dict()), "utf-8")
    assert main(["export", str(path), "--to", "table", "-o", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1 and "model.json" in printed.err
    assert "--position" in printed.err and not out.exists()


def test_friction_that_drives_is_remarked_on():
    parameters = {"inertia": -0.7, "coulomb+": -20.0, "viscous+": 3.0, "coulomb-": -18.0}
    odd = models.from_parameters(models.coulomb_viscous(), parameters | {"viscous-": 2.0})
    for target in ("c", "table"):
        remarks = " ".join(export(odd, target).remarks)
        assert "inertia is negative, -0.7" in remarks and "drives the axis" in remarks
    load = {"inertia": 2.0, "coulomb+": 50.0, "viscous+": 3.0, "coulomb-": -10.0, "viscous-": 3.0}
    assert not export(models.from_parameters(models.coulomb_viscous(), load), "c").remarks


def test_what_exports_will_lack_is_said_at_saving(tmp_path, capsys):
    saving.saved("better.json", model(terms.Coulomb() + terms.GainAsymmetry()))
    assert capsys.readouterr() == ("", "")
    saving.saved("better.json", model(terms.Coulomb() + terms.TransportDelay()))
    told = " ".join(capsys.readouterr().err.split())
    assert told.startswith(
        "better.json: C, Structured Text and FMU leave out transport_delay: hand"
    )
    saving.saved("better.json", model(terms.Coulomb()).with_bristles(1e5))
    assert "leave out the bristles" in capsys.readouterr().err
    unseen = models.Model(terms.Coulomb(), jnp.asarray([jnp.nan]))
    saving.saved("better.json", unseen)
    assert "better.json: no target takes this model. There is no value for coulomb" in " ".join(
        capsys.readouterr().err.split()
    )
