"""What Python's first call compiles, and what later ones do not."""

import dataclasses

import jax
import numpy as np
import pytest

import jaxfric as jf
from jaxfric import programs
from jaxfric.data.recording import uniform
from jaxfric.explanation import friction_at_rest
from jaxfric.simulation.errors import force_error

UNITS = (("m", "N"), ("rad", "N·m"), ("m", "A"), ("mm", "kN"))
LENGTHS = (2500, 2600, 2900, 3000, 3333, 3500, 3700, 3999, 4000, 4096)


def log(count: int, number: int) -> jf.Recording:
    """A machine of its own, under a name and in units of its own."""
    time = 1e-3 * np.arange(count)
    position = np.sin(9 * time + 1) + 0.4 * np.sin(23 * time)
    velocity = np.gradient(position, time)
    force = 2 * np.gradient(velocity, time) + (5 + number) * np.sign(velocity) + 3 * velocity
    force = force + 0.05 * np.random.default_rng(number).normal(size=count)
    length, unit = UNITS[number % len(UNITS)]
    units = (("position", length), ("force", unit))
    return jf.Recording(time, force, position, source=f"axis {number}.csv", units=units)


def programs_of(stage):
    """Names of the programs that come to a stage while a test runs."""
    names: list[str] = []

    def heard(event, seconds, **about):
        if stage in event:
            names.append(about.get("fun_name", event))

    jax.monitoring.register_event_duration_secs_listener(heard)
    yield names
    names = []  # the listener stays, and is heard no more


@pytest.fixture
def compiled():
    """Names of the programs that XLA compiles."""
    yield from programs_of("backend_compile")


@pytest.fixture
def lowered():
    """Names of the programs that jax lowers, which no cache of compiled ones spares a process."""
    yield from programs_of("jaxpr_to_mlir_module")


def test_ten_files_of_unequal_length_name_and_unit_are_one_program(compiled):
    found = [jf.identify("coulomb-viscous", log(LENGTHS[0], 0))]
    compiled.clear()
    found += [jf.identify("coulomb-viscous", log(n, i)) for i, n in enumerate(LENGTHS) if i]
    assert compiled == []
    for number, fit in enumerate(found):
        coulomb = fit.parameters["coulomb+"]
        assert abs(coulomb.value - (5 + number)) < 3 * coulomb.standard_error
        assert coulomb.unit == UNITS[number % len(UNITS)][1]


def examined(recording):
    """What the command looks at besides the fit."""
    found = jax.tree.map(np.asarray, jf.identify("coulomb-viscous", recording))
    jf.constant_velocity(recording, found)
    jf.breakaway(recording, found)
    return force_error(found.model, recording)


def test_what_the_command_says_beside_the_fit_is_compiled_once(compiled):
    assert examined(log(LENGTHS[0], 0)) < 0.1
    # Not operation by operation, which takes a program each.
    assert len(compiled) < 20
    compiled.clear()
    assert all(examined(log(n, i)) < 0.1 for i, n in enumerate(LENGTHS) if i)
    assert compiled == []


def test_asking_which_options_xla_knows_lowers_one_program(lowered):
    for known in (programs.quick_options, programs._known, programs._nothing):
        known.cache_clear()
    assert [programs.quick_options(level) for level in (0, 1, None)]
    assert len(lowered) == 1


def test_what_friction_is_beside_zero_velocity_is_one_program(lowered):
    programs.quick_options()
    term = jf.models.gaussian()
    form = jax.tree.structure(term), tuple(map(np.shape, jax.tree.leaves(term)))
    bumps, dry = friction_at_rest._bumps_and_dry.__wrapped__(*form)
    assert len(lowered) <= 1
    assert bumps.shape == dry.shape == (len(term.affine),)
    assert (bumps > 0).any() and (dry[bumps != 0] == 0).all() and (dry > 0).any()


def test_a_session_over_recordings_of_any_length_stays_bounded():
    lengths = {
        uniform(jf.Recording(np.arange(n), np.zeros(n), np.zeros(n))).num_samples
        for n in np.geomspace(2, 500_000, 100).astype(int)
    }
    assert len(lengths) < 20


def test_a_simulation_is_one_program_whatever_the_set_point_is_called(lowered):
    model = jf.models.from_parameters(
        jf.models.coulomb_viscous(),
        {"inertia": 2.0, "coulomb+": 5.0, "coulomb-": 5.0, "viscous+": 3.0, "viscous-": 3.0},
    )
    loop = jf.PD(kp=4000.0, kd=200.0)
    goals = [dataclasses.replace(log(2500, number), velocity=None) for number in (0, 4)]
    jf.simulate(model, goals[0], loop)
    lowered.clear()
    jf.simulate(model, dataclasses.replace(goals[1], units=goals[0].units), loop)
    assert lowered == []
