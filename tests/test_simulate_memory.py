"""Forward in time with a memory: loads on a spring, gaps, friction that lags behind velocity."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxfric as jf
from jaxfric import terms
from jaxfric.simulation import prediction
from jaxfric.simulation.errors import force_error, in_motion
from jaxfric.simulation.substeps import default_substeps
from jaxfric.terms.base import Sum, summands
from jaxfric.terms.effects import EFFECTS, compliance
from jaxfric.units import FORCE, STIFFNESS

SLIP = {"inertia": 5.0, "coulomb+": 20.0, "viscous+": 60.0, "coulomb-": 18.0, "viscous-": 80.0}


def axis(term=None, **values):
    base = jf.models.coulomb_viscous()
    return jf.models.from_parameters(base if term is None else base + term, SLIP | values)


def loaded(by="inertia", **values):
    given = {"load_inertia": 2.0, "load_friction": 8.0, "load_resonance": 12.0}
    term = terms.Compliance(driven=by)
    names = {p.name for p in term.affine} | {"load_resonance", "damping_ratio"}
    given |= {"damping_ratio": 0.05} | values
    return axis(term, **{name: value for name, value in given.items() if name in names})


def dry(load_resonance=25.0, damping_ratio=0.1, load_deceleration=3.0, **uneven):
    return axis(
        terms.DryCompliance(), load_inertia=2.0, load_resonance=load_resonance,
        damping_ratio=damping_ratio, load_deceleration=load_deceleration, **uneven,
    )  # fmt: skip


def gap(force=8.0, half_gap=1e-3):
    return axis(terms.Backlash(), backlash_force=force, half_gap=half_gap)


def elastic(half_gap=1e-3, windup=2e-4, load_deceleration=4.0, **damped):
    law = terms.DampedBacklash if damped else terms.ElasticBacklash
    return axis(
        terms.OiledBacklash() if "flank_damping" in damped else law(), backlash_force=8.0,
        half_gap=half_gap, windup=windup, load_deceleration=load_deceleration, **damped,
    )  # fmt: skip


def lagging(poles, lag):
    bumps = {"stribeck_force+": 8.0, "stribeck_force-": 10.0, "stribeck_force": 8.0}
    widths = dict.fromkeys(("stribeck_velocity+", "stribeck_velocity-", "stribeck_velocity"), 0.02)
    term = jf.models.gaussian() + terms.FrictionalLag(poles=poles)
    return jf.models.from_parameters(term, SLIP | bumps | widths | {"frictional_lag": lag})


def looped(model, seconds=1.0, rate=4000.0, dtype=float, substeps=None):
    """A machine that follows the set-point of `scenario`; the force of a sample is the mean of
    those held before and after it.
    """
    time = jnp.arange(round(seconds * rate), dtype=dtype) / rate
    goal, speed = jf.scenario.reference(time)
    clock = jf.Recording(time, 0 * time, goal, channels={"reference_velocity": speed})
    run = jf.simulate(model, clock, jf.PD(kp=5 * 60.0**2, kd=600.0), substeps=substeps)
    before = jnp.pad(run.force[:-1], (1, 0), "edge")
    return jf.Recording(time, 0.5 * (run.force + before), run.position, run.velocity)


def disagreement(model, run):
    """What `predict` says less the force, rms: in parts of the force, and of what the term does.

    Without the first samples, before which there is no force to take the mean with.
    """
    left, effect = (np.asarray(jf.predict(each, run) - run.force) for each in (model, plain(model)))
    moving = in_motion(run) & (np.arange(run.num_samples) > 1)
    left, effect, force = (x[moving] for x in (left, effect, np.asarray(run.force)))
    return tuple(float(np.linalg.norm(left) / np.linalg.norm(x)) for x in (force, effect))


def plain(model):
    """A model without its memory."""
    pairs = zip(summands(model.term), model.alphas(), strict=True)
    kept = [(t, a) for t, a in pairs if not isinstance(t, terms.AbstractMemory)]
    term = Sum(tuple(t for t, _ in kept))
    return jf.models.Model(term, jnp.concatenate([a for _, a in kept]))


def with_gain(model):
    """Behind an actuator that gives less forward."""
    alpha = jnp.append(model.alpha, 0.2)
    return jf.models.Model(model.term + terms.GainAsymmetry(), alpha)


CASES = {
    "inertia": loaded(),
    "inertia, stiff": loaded(load_resonance=60.0),
    "friction": loaded("friction"),
    "both": loaded("both", load_resonance=25.0, damping_ratio=0.1),
    "both, light": loaded("both", load_resonance=40.0, damping_ratio=0.02),
    "dry": dry(),
    "dry, stiff": dry(80.0, 0.05),
    "dry, uneven": dry(load_asymmetry=-0.4),
    "gap": gap(),
    "gap, narrow": gap(15.0, 1e-4),
    "flanks": elastic(),
    "flanks, narrow": elastic(1e-4, 2e-5),
    "damped": elastic(viscous_speed=0.2),
    "damped, uneven": elastic(viscous_speed=0.2, load_asymmetry=0.4),
    "elements": axis(
        terms.MaxwellSlip(), presliding_force=8.0, presliding_distance=1e-3, presliding_spread=0.6
    ),
    "dead time": lagging(0, 3e-3),
    "long dead time": lagging(0, 2e-2),
    "lag": lagging(1, 3e-3),
    "two lags": lagging(2, 2e-2),
    "gain and load": with_gain(dry()),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_predict_gives_back_the_force_of_the_simulation(case, monkeypatch):
    """To 1 % of the force and a sixteenth of what the term does, of which predict's derivative and
    its steps of a sample are the larger part: both fall with the sample rate.
    """
    # Without noise there is no speed that is mistaken for rest.
    monkeypatch.setattr(compliance, "_REST", 1e-9)
    of_force, of_effect = disagreement(CASES[case], looped(CASES[case]))
    assert of_force < 0.01 and of_effect < 1 / 16


@pytest.mark.slow
@pytest.mark.parametrize("case", ["inertia", "flanks", "gap", "two lags"])
def test_it_does_so_in_single_precision(case):
    model = jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), CASES[case])
    run = looped(model, dtype=jnp.float32)
    assert run.position.dtype == jnp.float32
    of_force, of_effect = disagreement(model, run)
    assert of_force < 0.02 and of_effect < 1 / 8


@pytest.mark.slow
def test_a_load_that_swings_faster_than_the_acceleration_is_known_is_smoothed_with_it(monkeypatch):
    model, time = dry(110.0, 0.05, 6.0), np.arange(6000) * 1e-3
    place = 0.05 * np.sin(4.4 * time) + 0.02 * np.sin(12 * time + 1)
    wanted = jf.Recording(time, 0 * time, place)
    run = jf.simulate(model, wanted, jf.PD(18000.0, 600.0), encoder=jf.Encoder(1e-6))
    seen = dataclasses.replace(run, velocity=None)
    error = force_error(model, seen)
    monkeypatch.setattr(prediction, "_smoothing_of_loads", lambda *known: 0.0)
    assert error < 0.95 * force_error(model, seen)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["dry", "flanks"])
def test_a_prediction_with_a_load_differentiates_by_the_model(case):
    model, time = CASES[case], np.arange(1500) * 1e-3
    log = jf.Recording(time, 0 * time, 0.05 * np.sin(4.4 * time))

    def size(scale):
        return jnp.sum(jf.predict(dataclasses.replace(model, alpha=scale * model.alpha), log) ** 2)

    # The force is proportional to alpha, and its sum of squares to the square of that.
    assert float(jax.grad(size)(1.0)) == pytest.approx(2 * float(jax.jit(size)(1.0)), rel=1e-3)


STEP = 1e-3


def driven(force, seconds=0.5, step=STEP):
    time = np.arange(round(seconds / step)) * step
    return jf.Recording(time, force + 0 * time, position=0 * time)


def two_masses(model, clock, follows=False, half_gap=0.0):
    """Motor and load, each with friction that turns its sign within 10 µm/s, by another program.

    The load's friction `follows` the motor's direction, as `Compliance` has it, or its own.
    """
    p = {name: float(value) for name, value in model.parameters.items()}
    gap = "half_gap" in p
    slow = p.get("load_deceleration", 0.0)
    slope_load = p["backlash_force"] / p["viscous_speed"] if "viscous_speed" in p else 0.0
    mass = p["backlash_force"] / slow if gap else p["load_inertia"]
    dry, uneven = p.get("load_friction", mass * slow), p.get("load_asymmetry", 0.0)
    omega = np.sqrt(slow / p["windup"]) if gap else 2 * np.pi * p["load_resonance"]
    damping = p.get("flank_damping", 0.2) if gap else p["damping_ratio"]
    force = np.asarray(clock.force)

    def slope(time, state):
        x, v, x_load, v_load = state
        ahead = x - x_load
        over = np.sign(ahead) * max(abs(ahead) - p.get("half_gap", 0.0), 0.0)
        spring = mass * (omega**2 * over + 2 * damping * omega * (v - v_load))
        spring = 0.0 if gap and spring * over <= 0 else spring
        way, way_load = np.tanh(v / 1e-5), np.tanh((v if follows else v_load) / 1e-5)
        s = "+" if v > 0 else "-"
        own = (p[f"coulomb{s}"] - dry) * way - dry * uneven * abs(way)
        own += (p[f"viscous{s}"] - slope_load) * v
        held = force[min(int(time / STEP + 1e-9), force.size - 1)]
        load = spring - dry * (way_load + uneven * abs(way_load)) - slope_load * v_load
        return [v, (held - own - spring) / (p["inertia"] - mass), v_load, load / mass]

    time = np.asarray(clock.time)
    options = {"rtol": 1e-6, "atol": 1e-9, "max_step": STEP}
    return solve_ivp(slope, (0, time[-1]), np.zeros(4), "Radau", time, **options).y[:2]


# Of a flank that takes up a blow at once the force jumps, which samples show less well than this.
OILED = {"oiled": elastic(viscous_speed=0.2, load_asymmetry=0.4, flank_damping=0.8)}


@pytest.mark.slow
@pytest.mark.parametrize("case", ["inertia", "both", "dry, uneven", "flanks", "oiled"])
def test_the_motion_is_that_of_two_masses_by_another_solver(case):
    model, clock = (CASES | OILED)[case], driven(0.0)
    clock = driven(40 * np.sin(4 * np.pi * np.asarray(clock.time)))
    run = jf.simulate(model, clock, initial=(0.0, 0.0))
    x, v = two_masses(model, clock, follows=case == "both")
    assert np.sqrt(np.mean((np.asarray(run.velocity) - v) ** 2)) < 0.01 * np.std(v)
    assert np.sqrt(np.mean((np.asarray(run.position) - x) ** 2)) < 0.01 * np.std(x)


def bare(term, coulomb=20.0, **values):
    base = terms.Inertia() + terms.Coulomb() + term
    return jf.models.from_parameters(base, {"inertia": 5.0, "coulomb": coulomb} | values)


def pushed(model, force, seconds, step):
    """Time, position and velocity of an axis that a force moves from rest."""
    run = jf.simulate(model, driven(force, seconds, step), initial=(0.0, 0.0), substeps=1)
    return (np.asarray(each) for each in (run.time, run.position, run.velocity))


@pytest.mark.slow
def test_a_force_on_the_motor_makes_it_swing_against_its_load():
    """Without friction: x = u t²/(2 M) + (M_L/M) s, s = (1 − cos Ωt) u/((M − M_L) Ω²)."""
    values = {"load_inertia": 2.0, "load_resonance": 12.0, "damping_ratio": 0.0}
    t, x, _ = pushed(bare(terms.Compliance(), coulomb=0.0, **values), 30.0, 0.5, 2e-4)
    swing = 2 * np.pi * 12.0 * np.sqrt(5 / 3)
    ahead = 30.0 / 3.0 / swing**2 * (1 - np.cos(swing * t))
    right = 3.0 * t**2 + 0.4 * ahead
    assert np.max(np.abs(x - right)) < 1e-3 * np.max(0.4 * ahead)


def test_a_motor_crosses_half_a_gap_with_less_friction():
    """From rest in the middle: M v²/2 = (u − F_c) x + F_L ∫ (1 − (x/δ)⁸) dx."""
    gap = 1e-3
    model = bare(terms.Backlash(), backlash_force=8.0, half_gap=gap)
    _, x, v = pushed(model, 30.0, 0.06, 2e-4)
    inside = np.minimum(x / gap, 1.0)
    work = 10.0 * x + 8.0 * gap * (inside - inside**9 / 9)
    assert x[-1] > 3 * gap
    np.testing.assert_allclose(2.5 * v[5:] ** 2, work[5:], rtol=0.002)


def test_a_motor_alone_crosses_half_a_gap_and_then_takes_its_load_along():
    """24 N move the motor, of 3 kg and 12 N of friction, not its load, of 2 kg and 8 N: up to the
    flank at 4 m/s². Later on, when they no longer swing, both at (u − F_c)/M.
    """
    gap = 1e-2
    values = {"backlash_force": 8.0, "windup": 1e-4, "load_deceleration": 4.0}
    t, x, v = pushed(bare(terms.ElasticBacklash(), half_gap=gap, **values), 24.0, 0.8, STEP / 4)
    free = x < gap
    np.testing.assert_allclose(x[free], 2.0 * t[free] ** 2, rtol=1e-9, atol=1e-15)
    # Both are pushed by what the motor alone was pushed by until then.
    struck, late = np.sqrt(gap / 2.0), t > 0.6
    together = (12.0 * struck + 4.0 * (t - struck)) / 5.0
    np.testing.assert_allclose(v[late], together[late], rtol=0.002)


def test_a_dead_time_is_one():
    """The late speed, in the middle of a step, of a speed that rises and falls."""
    term = terms.FrictionalLag(frictional_lag=0.0123)
    span, zero = 4e-4, jnp.zeros(())
    speed = lambda t: np.abs(np.sin(9 * np.maximum(t, 0.0)))  # noqa: E731

    def step(states, time):
        now = terms.Instant(zero, jnp.abs(jnp.sin(9 * time)), zero, zero)
        states = term.settled(states, now, span)
        return states, term.ready(states, now, span).kept[0]

    times = span * jnp.arange(1.0, 800.0)
    found = jax.lax.scan(step, term.start(zero, zero), times)[1]
    np.testing.assert_allclose(found, speed(np.asarray(times) + span / 2 - 0.0123), atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("substeps", [1, 8])
def test_a_coupling_stiffer_than_the_steps_is_rigid(substeps):
    rigid = looped(axis(), 1.0, 1000.0)
    for model in (elastic(1e-9, 1e-9), dry(3000.0), loaded(load_resonance=3000.0), gap(8.0, 1e-8)):
        run = looped(model, 1.0, 1000.0, substeps=substeps)
        # Flanks that strike within a step come back within it: a hundredth of the speed.
        assert float(jnp.std(run.velocity - rigid.velocity)) < 0.01 * float(jnp.std(run.velocity))


@pytest.mark.slow
def test_a_load_on_a_spring_is_differentiable():
    time = jnp.arange(60.0) * STEP

    def end(resonance):
        model = loaded().with_parameters({"load_resonance": resonance})
        clock = jf.Recording(time, 40 + 0 * time, 0 * time)
        return jf.simulate(model, clock, initial=(0.0, 0.0), substeps=1).position[-1]

    above, below = jax.jit(jax.vmap(end))(jnp.array([12.01, 11.99]))
    slope = float(jax.jit(jax.grad(end))(12.0))
    assert slope == pytest.approx(float(above - below) / 0.02, rel=1e-3)


class Worn(terms.AbstractStates):
    """A law of one's own: friction that grows with the way, F = A s sign(v), ds/dt = |v|."""

    affine = (terms.Parameter("wear", STIFFNESS),)

    def columns(self, recording):
        way = jnp.cumsum(jnp.abs(jnp.diff(recording.position, prepend=recording.position[:1])))
        return (way * jnp.sign(recording.velocity))[:, None]

    def start(self, position, velocity):
        return terms.States(0 * velocity[None], velocity[None][:0])

    def present(self, states, now):
        return states.flow * now.side

    def rates(self, states, now):
        return (now.velocity * now.side)[None]


@pytest.mark.slow
def test_a_memory_of_ones_own_is_held():
    model = axis(Worn(), wear=100.0)
    of_force, of_effect = disagreement(model, looped(model))
    assert of_force < 0.01 and of_effect < 1 / 16


def test_no_memory_of_the_library_is_refused():
    laws = {law for effect in EFFECTS.values() for law in effect.laws}
    memories = {law for law in laws if issubclass(law, terms.AbstractMemory)}
    assert len(memories) >= 7 and all(issubclass(law, terms.AbstractStates) for law in memories)


class Forgotten(terms.AbstractMemory):
    """A user's own memory, a function of the whole recording only."""

    affine = (terms.Parameter("drift", FORCE),)

    def columns(self, recording):
        return jnp.cumsum(jnp.abs(recording.velocity))[:, None]


def test_what_cannot_be_held_is_refused():
    clock = driven(30.0, 0.01)
    with pytest.raises(ValueError, match="Forgotten gives none.*AbstractStates"):
        jf.simulate(bare(Forgotten(), drift=0.1), clock)
    with pytest.raises(ValueError, match="load of 5 leaves the motor none"):
        jf.simulate(loaded(load_inertia=5.0), clock)
    with pytest.raises(ValueError, match=r"Add jaxfric.terms.Inertia\(\)"):
        gap_alone = {"backlash_force": 8.0, "half_gap": 1e-3}
        jf.simulate(jf.models.from_parameters(terms.Backlash(), gap_alone), clock)
    with pytest.raises(ValueError, match="smooth"):
        jf.simulate(loaded(), clock, smooth=1e-3)


def test_only_a_memory_costs_states_and_steps():
    clock = driven(30.0, 0.01)
    assert default_substeps(axis(), clock) == 1
    # Both masses swing against each other at ω √(M/(M − M_L)), ten steps to a radian.
    steps = 10 * STEP * 2 * np.pi * 100.0 * np.sqrt(5 / 3)
    assert default_substeps(loaded(load_resonance=100.0), clock) == np.ceil(steps)
