"""An FMU: accepted, compiled and simulated by fmpy, and the same force as the library's."""

import io
import zipfile

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import models
from jaxfric.cli import main
from jaxfric.export import export

from .test_export import everything, force_of, motion, needs_cc, saved, stribeck

fmpy = pytest.importorskip("fmpy", reason="reads, compiles and simulates FMUs")
build = pytest.importorskip("fmpy.build")
assert saved is not None  # a fixture
COUNT = 24


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """The FMU of all laws together, in a unit that XML has to escape, compiled."""
    folder = tmp_path_factory.mktemp("fmu")
    (folder / "build").mkdir()
    path = folder / "axis.fmu"
    whole = everything()
    whole = models.Model(whole.term, whole.alpha, (("force", 'N<"&'), ("position", "m")))
    path.write_bytes(export(whole, "fmu").content)
    unpacked = fmpy.extract(str(path), str(folder / "unpacked"))
    build.build_platform_binary(unpacked, folder / "build", all_warnings=True)
    return unpacked, whole


@jax.jit
def wanted(whole, x, v, a, t):
    """Friction and force by the library, one program for all tests here."""
    return whole.friction(v), force_of(whole, x, v, a, t)


def close(found, right):
    right = np.asarray(right)
    np.testing.assert_allclose(found, right, rtol=1e-9, atol=1e-12 * np.abs(right).max())


def simulated(unpacked, signals, kind, start=None):
    """Friction and force at the moments of the signals, by fmpy."""
    x, v, a, t = map(np.asarray, signals)
    names = ["time", "position", "velocity", "acceleration"]
    given = np.array(list(zip(t, x, v, a, strict=True)), [(name, float) for name in names])
    found = fmpy.simulate_fmu(
        unpacked, fmi_type=kind, start_time=t[0], stop_time=t[-1], input=given,
        output=["friction", "force"], output_interval=t[1] - t[0], start_values=start or {},
    )  # fmt: skip
    np.testing.assert_allclose(found["time"], t, atol=1e-9)
    return found["friction"], found["force"]


@pytest.mark.slow
@needs_cc
def test_the_compiled_functions_compute_the_library_s_force(compiled):
    """At unrelated moments, called one by one: whatever a law takes for another shows."""
    from fmpy.fmi2 import FMU2Slave

    unpacked, whole = compiled
    x, v, a, t = motion(COUNT)
    described = fmpy.read_model_description(unpacked)
    unit = FMU2Slave(
        guid=described.guid, unzipDirectory=unpacked,
        modelIdentifier=described.coSimulation.modelIdentifier,
    )  # fmt: skip
    unit.instantiate()
    unit.setupExperiment()
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    found = []
    for row in np.array([x, v, a, t]).T:
        unit.setReal([0, 1, 2], row[:3])
        unit.doStep(row[3], 0.0)
        found.append(unit.getReal([3, 4]))
    state = unit.getFMUState()
    unit.setReal([1], [9.0])
    unit.setFMUState(state)
    assert unit.getReal([3, 4]) == found[-1]
    unit.freeFMUState(state)
    unit.freeInstance()
    friction, force = np.array(found).T
    right = wanted(whole, x, v, a, t)
    close(friction, right[0])
    close(force, right[1])


@pytest.mark.slow
@needs_cc
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_a_simulator_runs_it_and_sets_its_parameters(compiled, kind):
    unpacked, whole = compiled
    t = np.arange(COUNT) * 0.0625
    x, v, a = 0.1 * np.sin(t), 0.1 * np.cos(t), -0.1 * np.sin(t)
    friction, force = simulated(unpacked, (x, v, a, t), kind)
    # A co-simulation holds an input from the beginning of a step to its end.
    held = [np.append(row[:1], row[:-1]) if kind == "CoSimulation" else row for row in (x, v, a)]
    right = wanted(whole, *map(jnp.asarray, (*held, t)))
    close(friction[1:], right[0][1:])
    close(force[1:], right[1][1:])
    was = float(whole.parameters["coulomb"])
    more, _ = simulated(unpacked, (x, v, a, t), kind, {"coulomb": was + 2})
    np.testing.assert_allclose((more - friction)[1:-1], 2 * np.sign(held[1])[1:-1], rtol=1e-9)


@pytest.mark.slow
@needs_cc
def test_its_description_is_valid_and_names_units_and_parameters(compiled):
    unpacked, whole = compiled
    described = fmpy.read_model_description(unpacked, validate=True)
    values = {v.name: v for v in described.modelVariables}
    assert values["force"].unit == 'N<"&' and values["velocity"].unit == "m/s"
    assert float(values["coulomb"].start) == float(whole.parameters["coulomb"])
    assert values["coulomb"].causality == "parameter"


def test_the_same_model_gives_the_same_bytes():
    first, again = export(stribeck(), "fmu"), export(stribeck(), "fmu")
    assert first.content == again.content
    assert export(stribeck(), "fmu", name="stage").content != first.content
    with zipfile.ZipFile(io.BytesIO(first.content)) as archive:
        assert archive.namelist() == ["modelDescription.xml", "sources/fmu.c"]
        assert archive.read("sources/fmu.c").decode() == first.text


def test_odd_names_are_refused():
    with pytest.raises(ValueError, match="cannot begin a name in C"):
        export(stribeck(), "fmu", name="9x")
    held = export(stribeck().with_breakaway(-27.0, 25.0), "fmu")
    assert "Not written: the break-away levels, breakaway- -27 N" in " ".join(held.remarks)


def test_an_archive_needs_a_file(saved, capsys):
    assert main(["export", saved, "--to", "fmu"]) == 2
    assert "-o axis.fmu" in capsys.readouterr().err
