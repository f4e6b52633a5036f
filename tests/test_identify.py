"""Identification on known machines, in batches, through jit and grad, and on real recordings."""

import dataclasses
import re
import types

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import jaxfric as jf
from jaxfric.identification import assessment, identifying
from jaxfric.identification.identified import result_names
from jaxfric.simulation.errors import force_error
from jaxfric.terms.sample import Parameter
from tests.machines import relative_error

RATE = 1000.0


def motion(seconds=8.0, rate=RATE):
    """A multisine that starts and ends at rest, with its exact derivatives."""
    t = np.arange(int(seconds * rate) + 1) / rate
    base = 2 * np.pi / seconds
    parts = ((2, 0.06, 0.3), (5, 0.03, 1.1), (9, 0.012, 2.0))
    x = sum(a * np.sin(n * base * t + p) for n, a, p in parts)
    v = sum(a * n * base * np.cos(n * base * t + p) for n, a, p in parts)
    a = sum(-b * (n * base) ** 2 * np.sin(n * base * t + p) for n, b, p in parts)
    return t, x, v, a


TRUE = {"coulomb+": 12.0, "viscous+": 30.0, "stribeck_force+": 4.0, "stribeck_velocity+": 0.02}
TRUE |= {"coulomb-": 11.0, "viscous-": 36.0, "stribeck_force-": 5.0, "stribeck_velocity-": 0.03}


def machine(name="gaussian", mass=3.0):
    term = jf.models.named(name)
    known = {"inertia": mass} | TRUE
    wanted = [p.name for p in (*term.affine, *term.nonlinear)]
    return jf.models.from_parameters(term, {n: known[n] for n in wanted})


def recording(model, noise=0.0, seed=0, **arguments):
    t, x, v, a = motion(**arguments)
    bare = jf.Recording(time=t, force=0 * t, position=x, velocity=v)
    force = np.asarray(model.force(bare)) + float(model.parameters["inertia"]) * a
    force = force + noise * np.random.default_rng(seed).normal(size=t.size)
    return dataclasses.replace(bare, force=force)


OTHERS = ("coulomb-viscous", "exponential", "lorentzian")


@pytest.mark.parametrize(
    "name",
    [
        "gaussian",
        *(pytest.param(name, marks=pytest.mark.slow) for name in OTHERS),
    ],
)
@pytest.mark.parametrize("projection", [jf.ClosedWindows(), jf.WeakForm(16)])
def test_recovers_a_known_machine(name, projection):
    model = machine(name)
    found = jf.identify(name, recording(model), projection=projection)
    assert result_names()[int(found.result._value)] == "successful"
    for key, value in model.parameters.items():
        # The kernel averages over 32 ms, in which the bump's curve is not a straight line, and the
        # window's cut is good to the square of the sampling interval.
        np.testing.assert_allclose(found.parameters[key].value, value, rtol=0.03, err_msg=key)


def test_inertia_is_left_out_whatever_it_is():
    light, heavy = (jf.identify("gaussian", recording(machine(mass=m))) for m in (0.0, 300.0))
    for key in TRUE:
        np.testing.assert_allclose(
            light.parameters[key].value, heavy.parameters[key].value, rtol=2e-2, err_msg=key
        )
    assert abs(heavy.parameters["inertia"].value - 300) < 0.3


@pytest.mark.slow
def test_a_batch_keeps_failures_in_their_row():
    # Without a position that the changed velocities would contradict.
    good = dataclasses.replace(recording(machine(), noise=0.1), position=None)
    nan = dataclasses.replace(good, force=good.force.at[100].set(jnp.nan))
    still = dataclasses.replace(good, velocity=jnp.full_like(good.velocity, 0.1))
    ramp = dataclasses.replace(good, velocity=0.05 + 0.01 * good.time)
    rest = dataclasses.replace(good, velocity=jnp.zeros_like(good.velocity))
    batch = jf.stack([good, nan, still, ramp, rest, good])
    found = jf.identify("gaussian", batch, projection=jf.ClosedWindows())
    names = [result_names()[int(i)] for i in found.result._value]
    assert names[:2] == ["successful", "not_finite"]
    assert names[2] in ("not_excited", "on_border")
    assert names[3] == "open_windows"
    assert names[4] == "no_slip"
    alone = jf.identify("gaussian", good, projection=jf.ClosedWindows())
    for key, estimate in alone.parameters.items():
        both = found.parameters[key]
        # The mass is found with a kernel whose width the rows of a batch share.
        tolerance = 1e-3 if key == "inertia" else 1e-6
        pair = both.value[jnp.array([0, 5])]
        np.testing.assert_allclose(pair, estimate.value, rtol=tolerance, err_msg=key)
    assert bool(jnp.isnan(found.parameters["coulomb+"].value[1]))
    assert bool(jnp.isinf(found.parameters["coulomb+"].standard_error[1]))


@pytest.mark.slow
def test_a_model_that_leaves_most_of_the_force_is_said_to():
    good = recording(machine("coulomb-viscous"), noise=0.1)
    hidden = dataclasses.replace(good, force=good.force + 40 * jnp.sin(40 * good.position))
    fine, poor = (jf.identify("coulomb-viscous", log) for log in (good, hidden))
    names = [result_names()[int(f.result._value)] for f in (fine, poor)]
    assert names == ["successful", "not_described"]
    assert fine.diagnosis == "The parameters were identified." and not fine.remarks
    assert "of the force is left" in poor.diagnosis


@pytest.mark.slow
def test_throw_raises_with_the_diagnosis():
    good = recording(machine())
    rest = dataclasses.replace(good, velocity=jnp.zeros_like(good.velocity))
    with pytest.raises(ValueError, match="never slips"):
        jf.identify("coulomb-viscous", rest, throw=True)
    with pytest.raises(ValueError, match="Row 1.*never slips"):
        jf.identify("coulomb-viscous", jf.stack([good, rest]), throw=True)


@pytest.mark.slow
def test_one_direction_alone_leaves_the_other_infinitely_uncertain():
    full = recording(machine("coulomb-viscous"), noise=0.1)
    forward = dataclasses.replace(full, mask=full.velocity > 0)
    found = jf.identify("coulomb-viscous", forward, projection=jf.WeakForm(16))
    assert result_names()[int(found.result._value)] == "not_excited"
    assert bool(jnp.isinf(found.parameters["coulomb-"].standard_error))
    assert bool(jnp.isfinite(found.parameters["coulomb+"].standard_error))


class Squared(jf.terms.AbstractLaw):
    """Drag: F = c v |v|."""

    affine = (jf.terms.Parameter("drag"),)

    def law(self, sample):
        return (sample.velocity * jnp.abs(sample.velocity),)


class Spring(jf.terms.AbstractLaw):
    """Spring: F = k x."""

    affine = (jf.terms.Parameter("stiffness"),)
    coordinates = frozenset({"position"})

    def law(self, sample):
        return (sample.position,)


def test_closed_windows_are_refused_to_terms_of_position():
    term = jf.models.coulomb_viscous() + Spring()
    log = recording(machine("coulomb-viscous"))
    with pytest.raises(ValueError, match="position.*WeakForm"):
        jf.identify(term, log, projection=jf.ClosedWindows())
    log = dataclasses.replace(log, force=log.force + 40.0 * log.position)
    found = jf.identify(term, log)
    assert found.projection == "weak_form"
    np.testing.assert_allclose(found.parameters["stiffness"].value, 40.0, rtol=5e-3)
    np.testing.assert_allclose(found.parameters["inertia"].value, 3.0, rtol=5e-3)


def test_a_missing_signal_is_named():
    # Behind an interruption the integral of the velocity is not known.
    log = dataclasses.replace(recording(machine()), position=None)
    halves = (np.arange(log.num_samples) > log.num_samples // 2).astype(np.int32)
    log = dataclasses.replace(log, segment=halves, num_segments=2)
    with pytest.raises(ValueError, match="needs position"):
        jf.identify(jf.models.coulomb_viscous() + Spring(), log)


@pytest.mark.slow
def test_a_term_of_the_users_own_is_identified_in_closed_windows():
    log = recording(machine("coulomb-viscous"))
    log = dataclasses.replace(log, force=log.force + 25.0 * log.velocity * jnp.abs(log.velocity))
    found = jf.identify(jf.models.coulomb_viscous() + Squared(), log)
    assert found.projection == "closed_windows"
    np.testing.assert_allclose(found.parameters["drag"].value, 25.0, rtol=1e-2)


@pytest.mark.slow
def test_gradients_are_those_of_finite_differences():
    """Of an affine model; those of a bump are in `test_gradients.py`."""
    name = "coulomb-viscous"
    log = recording(machine(name), noise=0.2, seconds=4.0)
    direction = jnp.sin(3 * log.time) * jnp.sign(log.velocity)

    def parameters(amount):
        moved = eqx.tree_at(lambda r: r.force, log, log.force + amount * direction)
        found = jf.identify(name, moved, projection=jf.ClosedWindows())
        return jnp.concatenate([found.model.alpha[1:], found.model.term.beta()])

    forward, reverse = jax.jacfwd(parameters)(0.0), jax.jacrev(parameters)(0.0)
    step = 1e-3
    traced = jax.jit(parameters)
    difference = (traced(step) - traced(-step)) / (2 * step)
    np.testing.assert_allclose(forward, difference, rtol=2e-4, atol=1e-6)
    np.testing.assert_allclose(forward, reverse, rtol=1e-8, atol=1e-10)
    # The derivative is the fit of the direction itself (eq. 19).
    moved = dataclasses.replace(log, force=direction)
    closed = jf.identify(name, moved, projection=jf.ClosedWindows()).model.alpha[1:]
    np.testing.assert_allclose(forward, closed, rtol=1e-8, atol=1e-10)


@pytest.mark.slow
def test_vmap_and_jit_agree_with_a_plain_call():
    log = recording(machine(), noise=0.1, seconds=4.0)
    forces = jnp.stack([log.force, 1.1 * log.force])

    def cost(force):
        moved = eqx.tree_at(lambda r: r.force, log, force)
        return jf.identify("gaussian", moved, projection=jf.ClosedWindows()).model.alpha[1:]

    np.testing.assert_allclose(jax.vmap(cost)(forces)[1], 1.1 * cost(log.force), rtol=1e-6)
    np.testing.assert_allclose(jax.jit(cost)(log.force), cost(log.force), rtol=1e-9)


@pytest.mark.parametrize(
    "term, told",
    [
        (jf.terms.GainAsymmetry(), "Leave it out and identify the other terms"),
        (jf.terms.LoadDependentFriction("load"), "needs load, which the recording lacks; it has"),
    ],
)
def test_a_signal_that_a_term_needs_and_is_not_there_is_said(term, told):
    with pytest.raises(ValueError, match=told):
        jf.identify(jf.models.coulomb_viscous() + term, recording(machine(), seconds=2.0))


@pytest.mark.slow
def test_bounds_hold_and_the_border_is_reported():
    log = recording(machine(), noise=0.05)
    bounds = {"stribeck_velocity": (0.05, 0.09)}
    found = jf.identify("gaussian", log, bounds=bounds)
    assert result_names()[int(found.result._value)] == "on_border"
    assert "On its border: stribeck_velocity+, stribeck_velocity-." in found.diagnosis
    for sign in "+-":
        value = float(found.parameters[f"stribeck_velocity{sign}"].value)
        assert 0.05 * (1 - 1e-12) <= value <= 0.09 * (1 + 1e-12)


def emps(folder, name="DATA_EMPS"):
    return jf.read(
        folder / "emps" / f"{name}.mat",
        columns={"force": "vir", "position": "qm"},
        scale={"force": 35.1506},
    )


@pytest.mark.slow
def test_emps_friction_without_mass_and_acceleration(data_folder):
    """Published, with mass and acceleration: Janot, Gautier & Brunot 2019."""
    found = jf.identify("coulomb-viscous", emps(data_folder), projection=jf.ClosedWindows())
    published = {"viscous+": 166.7061, "coulomb+": 20.1440}
    published |= {"viscous-": 240.4236, "coulomb-": 20.6277}
    for key, value in published.items():
        np.testing.assert_allclose(found.parameters[key].value, value, rtol=0.01, err_msg=key)
    np.testing.assert_allclose(found.parameters["inertia"].value, 95.1089, rtol=0.005)


@pytest.mark.slow
def test_emps_weak_form_and_the_pulses(data_folder):
    identification, validation = emps(data_folder), emps(data_folder, "DATA_EMPS_PULSES")
    directional = jf.identify("coulomb-viscous", identification, projection=jf.WeakForm(16))
    np.testing.assert_allclose(directional.parameters["inertia"].value, 95.15, rtol=0.005)
    assert float(directional.filtered_force_error) <= 0.032
    symmetric = jf.identify("symmetric-coulomb-viscous", identification, projection=jf.WeakForm(16))
    assert float(symmetric.filtered_force_error) <= 0.042
    assert float(relative_error(symmetric.model, validation, half_width=16)) <= 0.061


def held(rate=250.0, key=0, law="coulomb-viscous", known=None):
    """A loop that holds its force from sample to sample: it acts half a sample after its stamp."""
    t = np.arange(int(20 * rate)) / rate
    position = 0.05 * np.sin(2 * np.pi * 0.9 * t) + 0.02 * np.sin(2 * np.pi * 1.7 * t)
    model = jf.models.from_parameters(jf.models.named(law), known or HELD)
    return jf.simulate(
        model, jf.Recording(t, 0 * t, position), jf.PD(6480.0, 252.0), force_noise=0.2,
        key=jax.random.key(key),
    )  # fmt: skip


HELD = {"inertia": 5.0, "coulomb+": 20.0, "viscous+": 60.0, "coulomb-": 21.0, "viscous-": 55.0}


def off(found, known=None):
    """By how many half-widths of its interval each parameter misses the truth."""
    names, estimates = found.parameters.keys(), found.parameters.values()
    halves = [float(e.interval()[1] - e.value) for e in estimates]
    known = known or HELD
    misses = [float(e.value) - known[n] for n, e in zip(names, estimates, strict=True)]
    return np.abs(np.array(misses) / np.array(halves))


@pytest.mark.slow
@pytest.mark.parametrize("projection", [None, jf.WeakForm(16)])
def test_a_force_that_is_held_is_aligned(projection):
    def error(found):
        return float(found.parameters["inertia"].standard_error)

    run = held()
    plain = jf.identify("coulomb-viscous", run, projection=projection)
    # Where it acts is not known: the intervals hold what that makes of the parameters.
    assert off(plain).max() < 1 and plain.model.force_delay is None
    found = jf.identify("coulomb-viscous", run, projection=projection, align=True)
    assert not found.remarks and off(found).max() < 1
    assert 10 * error(found) < error(plain)
    assert float(found.model.force_delay) == pytest.approx(0.5 / 250, rel=0.05)
    # Then the noise of 0.2 N is all that is left.
    noise = 0.2 / np.sqrt(np.mean(np.asarray(run.force) ** 2))
    # Without, the late force makes as much of an error.
    assert force_error(plain.model, run) ** 2 > 2 * noise**2
    assert force_error(found.model, run) == pytest.approx(noise, rel=0.1)


@pytest.mark.slow
def test_what_is_off_by_a_twentieth_for_a_held_force_is_told():
    run = held(100.0)
    (remark,) = jf.identify("coulomb-viscous", run).remarks
    assert remark.name == "force_stamped" and not remark.severe
    assert "The force acts 0.005" in remark.text and "--align" in remark.text
    found = jf.identify("coulomb-viscous", run, align=True)
    assert not found.remarks and off(found).max() < 1


@pytest.mark.slow
def test_rows_of_a_batch_are_aligned_each_by_itself():
    logs = [held(key=1), held(key=2)]
    t = logs[1].time
    # The second log's force is averaged over its sample already: at its stamp it acts.
    mean = jnp.interp(t - 0.5 / 250, t, logs[1].force)
    logs[1] = dataclasses.replace(logs[1], force=mean)
    found = jf.identify("coulomb-viscous", jf.stack(logs), projection=jf.WeakForm(16), align=True)
    first, second = np.asarray(found.model.force_delay) * 250
    assert first == pytest.approx(0.5, abs=0.05) and abs(second) < 0.05
    alone = jf.identify("coulomb-viscous", logs[0], projection=jf.WeakForm(16), align=True)
    np.testing.assert_allclose(found.model.alpha[0], alone.model.alpha, rtol=1e-6)


@pytest.mark.slow
def test_the_interval_of_a_bump_holds_what_a_held_force_makes_of_it():
    """Closed windows know it by slow samples beside the jumps, where half a sample counts."""
    known = HELD | {"stribeck_force+": 8.0, "stribeck_force-": 6.0}
    known |= {"stribeck_velocity+": 0.04, "stribeck_velocity-": 0.05}
    run = held(500.0, 0, "gaussian", known)
    found, aligned = (jf.identify("gaussian", run, align=align) for align in (False, True))
    assert found.projection == "closed_windows"
    assert off(found, known).max() < 1 and off(aligned, known).max() < 1
    for name in ("stribeck_force+", "stribeck_force-"):  # and not by noise
        wide, narrow = (fit.parameters[name].standard_error for fit in (found, aligned))
        assert wide > 3 * narrow


def stamped(late=0):
    """The same motion with the force at its time stamp, or so many samples late."""
    run = held()
    model = jf.models.from_parameters(jf.models.coulomb_viscous(), HELD)
    noise = 0.2 * np.random.default_rng(0).normal(size=run.num_samples)
    force = np.roll(np.asarray(jf.predict(model, run)), late) + noise
    return jax.tree.map(lambda x: x[20:-20], dataclasses.replace(run, force=force))


@pytest.mark.slow
@pytest.mark.parametrize("align", [False, True])
@pytest.mark.parametrize("late", [-3, 2, 4])
def test_a_force_that_is_late_by_cycles_is_told(late, align):
    """Beside friction and slow motion it is a small part of the force, and yet all that is left."""
    found = jf.identify("coulomb-viscous", stamped(late), align=align)
    (remark,) = found.remarks
    assert remark.name == "force_late"
    assert f" s {'later' if late < 0 else 'earlier'}," in remark.text
    assert float(remark.text.split()[1]) == pytest.approx(abs(late) / 250, rel=0.4)
    assert off(found).max() < 1.2  # to first order
    assert ("more than --align (align=True) corrects" in " ".join(repr(found).split())) == align


@pytest.mark.slow
def test_a_force_at_its_stamp_stays_there():
    run = stamped()
    found = jf.identify("coulomb-viscous", run, align=True)
    assert float(found.model.force_delay) == 0.0
    assert "The force acts at its time stamp, as far as the log shows." in repr(found)


def test_what_is_traced_is_not_aligned():
    with pytest.raises(ValueError, match=r"not known inside jax\.jit"):
        jax.jit(lambda log: jf.identify("coulomb-viscous", log, align=True).model.alpha)(held())


@pytest.mark.parametrize("weight, told", [(0.0, False), (1.0, False), (5.0, True), (-40.0, True)])
def test_a_constant_load_in_directional_friction_is_told(weight, told):
    run = recording(machine("coulomb-viscous"), noise=0.1)
    run = dataclasses.replace(run, force=run.force + weight)
    found = jf.identify("coulomb-viscous", run)
    remarks = {remark.name: remark for remark in found.remarks}
    assert set(remarks) == ({"constant_load"} if told else set())
    assert "as in no passive axis" not in repr(found)
    if told:
        said = remarks["constant_load"].text
        load = float(re.search(r"a weight \((-?[\d.]+) N beside a friction of 11.5", said)[1])
        # Half of what the directions' own friction differs by is in it.
        assert load == pytest.approx(weight + 0.5, abs=0.1)
        assert "--model symmetric-coulomb-viscous has the load as offset." in said


def test_a_force_of_the_wrong_sign_is_no_load():
    run = recording(machine("coulomb-viscous"), noise=0.1)
    found = jf.identify("coulomb-viscous", dataclasses.replace(run, force=-run.force))
    assert [remark.name for remark in found.remarks] == ["negative_parameter"]


def _passing(width):
    """An axis that passes zero quickly, with bumps of 4 N and that width, m/s, beside it."""
    draw, time = np.random.default_rng(0), np.arange(0, 20, 0.002)
    rate = 2 * np.pi * 0.3
    speed = np.sign(np.sin(rate * time)) * (0.3 + 3 * np.sin(rate * time) ** 2)
    speed = np.convolve(speed, np.ones(40) / 40, "same")
    force = 0.5 * np.gradient(speed, time) + 2 * speed + 0.3 * draw.normal(size=time.shape)
    force += np.sign(speed) * (10 + 4 * np.exp(-((speed / width) ** 2)))
    return jf.Recording(time, force, np.cumsum(speed) * 0.002, speed)


@pytest.mark.parametrize(("width", "told"), [(0.05, False), (0.02, True)])
def test_a_size_whose_width_may_be_anything_is_told(width, told):
    """0.22 ± 0.11 N of a bump of 4 N, as its width is 0.11 ± 0.12 m/s instead of 0.02."""
    found = jf.identify("gaussian", _passing(width))
    assert ("shape_unknown" in {remark.name for remark in found.remarks}) == told
    off = abs(float(found.parameters["stribeck_force-"].value) - 4.0)
    assert told or off < found.parameters["stribeck_force-"].half_width()


def test_each_row_of_a_batch_is_told_of_its_own_widths():
    fits = jf.identify("gaussian", jf.stack([_passing(0.05), _passing(0.02), _passing(0.04)]))
    told = ["shape_unknown" in {remark.name for remark in fits[i].remarks} for i in range(3)]
    assert told == [False, True, False]


@pytest.mark.slow
def test_a_direction_that_never_moved_is_named():
    run = recording(machine(), noise=0.05)
    kept = np.asarray(run.velocity) > 0
    forward = dataclasses.replace(run, mask=kept, segment=np.cumsum(np.diff(kept, prepend=0) != 0))
    found = jf.identify("gaussian", dataclasses.replace(forward, num_segments=None))
    assert found.result_name == "not_excited"
    names = "coulomb-, viscous-, stribeck_force-, stribeck_velocity-"
    assert found.diagnosis.startswith("This recording does not determine all parameters")
    assert f"Not determined: {names}." in found.diagnosis


@pytest.mark.slow
def test_an_offset_beside_friction_of_each_direction_is_told():
    run = recording(machine("coulomb-viscous"), noise=0.1)
    found = jf.identify(jf.models.coulomb_viscous() + jf.terms.Offset(), run)
    assert "No motion tells offset from coulomb+ and coulomb-" in found.diagnosis
    assert "Move in both directions" not in found.diagnosis


def unusable():
    """Logs that nothing can be told from, each in its way."""
    run = recording(machine("coulomb-viscous"), seconds=2.0)
    t = np.asarray(run.time)
    return {
        "velocity is infinite": dataclasses.replace(run, velocity=run.velocity.at[5].set(jnp.inf)),
        "force is infinite": dataclasses.replace(run, force=run.force.at[5].set(-jnp.inf)),
        "clock runs backward": dataclasses.replace(run, time=t[::-1].copy()),
        "clock stands": dataclasses.replace(run, time=0 * t),
    }


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [True, False])
def test_what_is_unusable_stays_in_its_row_without_a_word_of_numpy(velocity):
    logs = [recording(machine("coulomb-viscous"), seconds=2.0, noise=0.1), *unusable().values()]
    if not velocity:
        logs = [dataclasses.replace(log, velocity=None) for log in logs]
    found = jf.identify("coulomb-viscous", jf.stack(logs))  # a warning is an error here
    assert found[0].result_name == "successful"
    assert "successful" not in [row.result_name for row in found[2 if not velocity else 1 :]]


@pytest.mark.slow
def test_a_row_of_a_batch_says_what_it_says_alone():
    """Each its own kernel, and weak form where its windows stay open; whatever the others are."""
    good = recording(machine(), noise=0.1)
    noisy = recording(machine(), noise=0.1, seconds=3.0)
    rough = noisy.velocity + 2e-3 * jax.random.normal(jax.random.key(3), noisy.velocity.shape)
    noisy = dataclasses.replace(noisy, velocity=rough, position=None)
    # Ever faster: few samples lie between two moments of one velocity.
    t, good = good.time, dataclasses.replace(good, position=None)
    v, a = 0.05 + 0.02 * t + 0.01 * jnp.sin(5 * t), 0.02 + 0.05 * jnp.cos(5 * t)
    rising = dataclasses.replace(
        good, velocity=v, force=20 + 30 * v + 4 * a + 0.1 * jnp.sin(99 * t)
    )
    logs = [good, noisy, rising]
    batch = jf.identify("coulomb-viscous", jf.stack(logs))
    for log, row in zip(logs, batch, strict=True):
        alone = jf.identify("coulomb-viscous", log)
        assert (row.result_name, row.projection) == (alone.result_name, alone.projection)
        for name, one in alone.parameters.items():
            both = row.parameters[name]
            np.testing.assert_allclose(both.value, one.value, rtol=1e-7, err_msg=name)
            np.testing.assert_allclose(both.standard_error, one.standard_error, rtol=5e-3)
    assert batch.projection == "mixed"


@pytest.mark.slow
@given(padding=st.integers(0, 5000))
@settings(max_examples=4, deadline=None)
def test_what_a_recording_is_padded_with_moves_no_interval(padding):
    """By more than what a block of twice the rows makes of it."""
    log = recording(machine("coulomb-viscous"), seconds=3.0, noise=0.1)
    alone = jf.identify("coulomb-viscous", log)
    padded = jf.identify("coulomb-viscous", jf.pad(log, log.num_samples + padding))
    for name, one in alone.parameters.items():
        both = padded.parameters[name]
        np.testing.assert_allclose(both.value, one.value, rtol=1e-7, err_msg=name)
        np.testing.assert_allclose(both.standard_error, one.standard_error, rtol=1e-2)


SHARP = {
    "inertia": 0.8, "coulomb+": 6.0, "viscous+": 4.0, "coulomb-": 5.4, "viscous-": 4.4,
    "stribeck_force+": 2.5, "stribeck_velocity+": 0.05,
    "stribeck_force-": 2.75, "stribeck_velocity-": 0.0525,
}  # fmt: skip


def brisk(rate, resolution=None):
    """An axis that crosses its Stribeck velocity within some milliseconds."""
    t = np.arange(int(20 * rate)) / rate
    waves = ((0.5, 0.3, 0.0), (0.15, 1.1, 1.0), (0.03, 3.0, 0.0))
    position = sum(a * np.sin(2 * np.pi * f * t + phase) for a, f, phase in waves)
    model = jf.models.from_parameters(jf.models.gaussian(), SHARP)
    encoder = None if resolution is None else jf.Encoder(resolution=resolution)
    return jf.simulate(
        model, jf.Recording(t, 0 * t, position), jf.PD(4000.0, 110.0), force_noise=0.05,
        key=jax.random.key(0), encoder=encoder, substeps=16,
    )  # fmt: skip


@pytest.mark.slow
def test_a_bump_that_few_samples_cross_holds_no_mass():
    """The sum over samples of a mass times acceleration is no integral: Lemma 1 is for these."""
    run = brisk(500.0)
    found = jf.identify("gaussian", run)
    assert found.projection == "closed_windows" and off(found, SHARP).max() < 1.5
    aligned = jf.identify("gaussian", run, align=True)
    for sign in "+-":
        height = float(aligned.parameters[f"stribeck_force{sign}"].value)
        assert height == pytest.approx(SHARP[f"stribeck_force{sign}"], rel=0.1)


@pytest.mark.slow
def test_a_velocity_from_the_position_takes_nothing_off_a_bump_in_silence(monkeypatch):
    run = dataclasses.replace(brisk(1000.0, 1e-5), velocity=None)
    found = jf.identify("gaussian", run)
    assert off(found, SHARP).max() < 1.5
    batch = jf.identify("gaussian", jf.stack([run, run]))[1]
    for name, own in batch.parameters.items():
        assert float(own.value) == pytest.approx(float(found.parameters[name].value), rel=1e-6)
        error = float(found.parameters[name].standard_error)
        assert float(own.standard_error) == pytest.approx(error, rel=1e-3)

    def as_chosen(solve, setup, rows, prepared, found, design):
        return setup, found, design, np.zeros(1)

    monkeypatch.setattr(identifying, "narrowed", as_chosen)
    assert off(jf.identify("gaussian", run), SHARP).max() > 2


@pytest.mark.slow
def test_single_precision_converges_as_far_as_its_cost_can_tell():
    with jax.enable_x64(False):
        found = jf.identify(
            "lorentzian", jf.scenario.record(jf.scenario.machine(), sample_rate=RATE)
        )
        assert found.model.alpha.dtype == jnp.float32 and found.result_name == "successful"
        stopped = dataclasses.replace(found, result=jf.Result.not_converged)
    assert 'jax.config.update("jax_enable_x64", True)' in stopped.diagnosis


def stopping(fast_stops: bool) -> jf.Recording:
    """Slow moves to and fro and a fast one in each direction; the record ends in the last of them.

    `fast_stops`: or after it.
    """
    time = np.arange(0.0, 12.0, 1e-3)
    speed = 0.04 * np.sin(2 * np.pi * time / 2)
    speed += np.where((time > 8) & (time < 9), 0.6 * np.sin(np.pi * (time - 8)) ** 2, 0.0)
    speed -= np.where((time > 10) & (time < 11), 0.6 * np.sin(np.pi * (time - 10)) ** 2, 0.0)
    force = 3.0 * np.gradient(speed, time) + 10.0 * np.sign(speed) + 40.0 * speed
    force += 0.1 * np.random.default_rng(4).normal(size=len(time))
    last = len(time) if fast_stops else 10_500
    return jf.Recording(time[:last], force[:last], velocity=speed[:last])


@pytest.mark.slow
def test_windows_without_the_only_fast_move_of_a_direction_give_way_to_the_weak_form():
    whole = jf.identify(jf.models.coulomb_viscous(), stopping(True))
    assert not whole.weak and float(whole.covered) > 0.9
    cut = jf.identify(jf.models.coulomb_viscous(), stopping(False))
    assert cut.weak and cut.result == jf.Result.successful
    for name, true in (("viscous-", 40.0), ("coulomb-", 10.0), ("inertia", 3.0)):
        low, high = cut.parameters[name].interval()
        assert low < true < high
    narrow = jf.identify(
        jf.models.coulomb_viscous(), stopping(False), projection=jf.ClosedWindows()
    )
    assert float(narrow.covered) < 0.3


@pytest.mark.slow
def test_friction_that_still_falls_at_the_fastest_speed_singles_no_bump_out():
    """The Stribeck velocity lies beyond the bounds, where another shape takes its place."""
    time = np.arange(0.0, 12.0, 1e-3)
    speed = 0.05 * np.sin(2 * np.pi * time / 3)

    def machine(width):
        friction = np.sign(speed) * (4 + 6 / (1 + (speed / width) ** 2)) + 8.0 * speed
        force = 3.0 * np.gradient(speed, time) + friction
        force += 0.02 * np.random.default_rng(4).normal(size=len(time))
        return jf.identify(jf.models.gaussian(), jf.Recording(time, force, velocity=speed))

    wide = machine(0.06)
    assert wide.result == jf.Result.ambiguous
    assert "negative_parameter" in [each.name for each in wide.remarks]
    assert "still falls" in str(wide)


@pytest.mark.parametrize("width", [0.02, 0, True, None, "16"])
def test_a_half_width_counts_samples(width):
    with pytest.raises(
        ValueError, match="half_width is .*, and counts samples: give a whole number"
    ):
        jf.WeakForm(width)
    assert jf.WeakForm(np.int64(16)) == jf.WeakForm(16)


def test_a_term_of_the_others_force_is_refused_by_its_name():
    terms = jf.terms
    model = jf.models.coulomb_viscous() + terms.ForceRipple() + terms.ActuatorLag()
    with pytest.raises(
        ValueError, match="^ForceRipple and ActuatorLag act on the force that the"
    ) as e:
        jf.identify(model, recording(machine()))
    assert "jaxfric.explain(recording, fit) finds them" in str(e.value)


@pytest.mark.slow
@pytest.mark.parametrize("recorded", [True, False])
def test_a_given_width_gives_inside_jit_what_a_call_gives(recorded):
    log = recording(machine(), noise=0.3)
    log = log if recorded else dataclasses.replace(log, velocity=None)
    ready = jf.signals.prepare(log)
    model = jf.models.named("symmetric-coulomb-viscous") + jf.terms.Spring()
    width = jf.signals.kernel_half_width(ready)

    def fit(log, projection=None):
        return jnp.stack(
            list(jf.identify(model, log, projection=projection).model.parameters.values())
        )

    called = fit(ready, jf.WeakForm(width))
    traced = jax.jit(lambda log: fit(log, jf.WeakForm(width)))(ready)
    np.testing.assert_allclose(traced, called, rtol=1e-10)
    np.testing.assert_allclose(called, fit(log), rtol=1e-10)


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (("viscous", "stribeck_velocity"), True),
        (("viscous+", "stribeck_velocity+"), True),
        (("viscous+", "stribeck_velocity"), True),
        (("viscous", "stribeck_velocity-"), True),
        (("viscous+", "stribeck_velocity-"), False),
        (("viscous_asymmetry", "stribeck_velocity"), False),
        (("coulomb", "stribeck_velocity"), False),
        (("viscous", "pitch"), False),
    ],
)
def test_only_viscous_friction_of_a_bumps_direction_says_that_it_still_falls(names, told):
    slope, bump = map(Parameter, names)
    term = types.SimpleNamespace(affine=(slope,), nonlinear=(bump,))
    found = assessment.still_falling(term, jnp.array([-1.0]), jnp.diag(jnp.array([0.01, 1.0])))
    assert bool(found) == told
