"""The next experiment: limits kept, predicted errors true, rivals told apart."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric.cli import main
from jaxfric.identification.design import columns, design, errors
from jaxfric.identification.motion import Limits, from_rest, led, multisine, sine
from jaxfric.identification.separation import separate

LIMITS = Limits(0.05, 0.2, 2.0, 60.0, 4.0, 0.004)
VALUES = {
    "inertia": 5.0, "coulomb": 12.0, "viscous": 45.0, "stribeck_force": 5.0,
    "stribeck_velocity": 0.012, "offset": 0.5,
}  # fmt: skip


@pytest.fixture(scope="module")
def axis():
    return jf.models.from_parameters(jf.models.named("symmetric-gaussian"), VALUES)


@pytest.fixture(scope="module")
def found(axis):
    return design(axis, LIMITS, noise=0.5)


@pytest.mark.slow
def test_the_limits_are_kept_and_one_is_reached(found):
    used = [
        float(jnp.max(jnp.abs(getattr(found.motion, name)))) / getattr(LIMITS, name)
        for name in ("position", "velocity", "acceleration", "jerk")
    ]
    assert max(used) == pytest.approx(1.0)
    motion, step = found.motion, LIMITS.interval
    for one, other in (("position", "velocity"), ("velocity", "acceleration")):
        slope = np.gradient(np.asarray(getattr(motion, one)), step)[5:-5]
        wanted = np.asarray(getattr(motion, other))[5:-5]
        np.testing.assert_allclose(slope, wanted, atol=2e-3 * np.max(np.abs(wanted)))
    assert float(motion.velocity[0]) == pytest.approx(float(motion.velocity[-1]), abs=1e-9)


def test_the_axis_comes_into_it_from_rest_within_the_limits():
    """The motion itself is another beginning of the same period."""
    limits = LIMITS._replace(centre=0.3, interval=5e-4)
    drawn = jnp.asarray(np.random.default_rng(4).normal(size=(2, 8)) / np.arange(1, 9))
    turned = multisine(from_rest(drawn), limits)
    assert float(turned.velocity[0]) == pytest.approx(0, abs=1e-6)
    plain = multisine(drawn, limits)
    np.testing.assert_allclose(
        np.sort(turned.position), np.sort(plain.position), atol=limits.velocity * limits.interval
    )
    motion = led(turned, limits)
    assert abs(float(motion.position.max() + motion.position.min()) - 0.6) < 0.1
    for name, middle in (("position", 0.3), ("velocity", 0), ("acceleration", 0), ("jerk", 0)):
        most = np.max(np.abs(np.asarray(getattr(motion, name)) - middle))
        assert most <= 1.001 * getattr(limits, name), name
    assert motion.velocity[0] == motion.velocity[-1] == motion.acceleration[0] == 0
    for one, other in (("position", "velocity"), ("velocity", "acceleration")):
        values, wanted = (np.asarray(getattr(motion, name)) for name in (one, other))
        slope = np.gradient(values, limits.interval)[2:-2]
        np.testing.assert_allclose(slope, wanted[2:-2], atol=0.02 * np.max(np.abs(wanted)))


@pytest.mark.slow
def test_no_motion_of_the_plain_sine_is_better(axis, found):
    before, after = (np.array([getattr(g, n) for g in found.gains.values()])
                     for n in ("before", "after"))  # fmt: skip
    size = np.abs([VALUES[name] for name in found.gains])
    assert np.sum((after / size) ** 2) < 0.6 * np.sum((before / size) ** 2)


@pytest.mark.slow
def test_the_predicted_errors_are_those_that_come_out(axis, found):
    """Over noisy recordings of the designed motion, the scatter of each parameter."""
    motion = found.motion
    force = columns(axis.term, motion) @ axis.alpha
    noise = 0.5 * jax.random.normal(jax.random.key(3), (32, force.size))
    logs = jf.stack(
        [jf.Recording(motion.time, force + e, motion.position, motion.velocity) for e in noise]
    )
    got = jf.identify(axis, logs, projection=jf.ClosedWindows()).parameters
    for name in ("coulomb", "viscous", "stribeck_force", "stribeck_velocity"):
        seen = float(np.std(np.asarray(got[name].value)))
        assert 0.6 < seen / found.gains[name].after < 1.7, name


def test_columns_of_inertia_are_the_acceleration():
    motion = multisine(sine(LIMITS), LIMITS)
    np.testing.assert_allclose(
        columns(jf.terms.Inertia(), motion)[:, 0], motion.acceleration, rtol=1e-9
    )


def test_what_a_motion_does_not_show_has_a_huge_error(axis):
    """A constant position: of inertia and friction nothing."""
    motion = multisine(sine(LIMITS), LIMITS)
    still = motion._replace(velocity=0 * motion.velocity, acceleration=0 * motion.acceleration)
    assert np.all(np.asarray(errors(axis, still, 1.0))[1:3] > 1e3)


def cogging():
    """An axis with a wave in position that one speed cannot tell from a tone."""
    values = {"inertia": 5.0} | {f"{n}{s}": v for s in "+-" for n, v in
                                 (("coulomb", 10.0), ("viscous", 40.0))}  # fmt: skip
    model = jf.models.coulomb_viscous() + jf.terms.Cogging()
    names = [p.name for p in (*model.affine, *model.nonlinear)]
    wave = {n: 0.5 for n in names if n not in values} | {model.nonlinear[-1].name: 0.01}
    return jf.models.from_parameters(model, values | wave)


def sprung():
    """An axis with a spring, which part of a stroke does not tell from a stop or an unbalance."""
    values = {"inertia": 5.0, "stiffness": 60.0}
    values |= {f"{n}{s}": v for s in "+-" for n, v in (("coulomb", 10.0), ("viscous", 40.0))}
    return jf.models.from_parameters(jf.models.coulomb_viscous() + jf.terms.Spring(), values)


@pytest.fixture(scope="module")
def separated():
    """Without a stop's reach a term's columns are zero, where a norm has no derivative."""
    return separate(sprung(), {"spring": ["end_stop", "hardening_spring"]}, LIMITS, steps=40)


@pytest.mark.slow
def test_rivals_are_told_apart_better(separated):
    """Along a sine a spring is a mass; a third harmonic is all by which the cubes differ."""
    apart = {(each.true, each.other): each for each in separated.apart}
    assert len(apart) == 4
    assert apart["spring", "hardening_spring"].before < 1e-6 < separated.enough
    for each in apart.values():
        assert each.after > max(1.2 * each.before, separated.enough), each


@pytest.mark.slow
def test_what_is_apart_is_what_the_best_imitation_leaves(separated):
    """Beside least squares by numpy, over the samples that are no kernel from a reversal."""
    motion = separated.motion
    x, v, a = (np.asarray(part) for part in motion[1:4])
    slow = (16 * LIMITS.interval * a) ** 2 + (0.006 * np.max(np.abs(v))) ** 2
    weight = np.sqrt(v**2 / (v**2 + slow))
    sides = [np.where(np.sign(v) == sign, 1.0, 0.0) for sign in (1, -1)]
    base = [a, *sides, *(side * v for side in sides)]
    left = []
    for centre in np.linspace(-0.05, 0.05, 24):
        matrix = weight[:, None] * np.stack([*base, (x - centre) ** 3], axis=1)
        fitted = np.linalg.lstsq(matrix, weight * 60.0 * x, rcond=None)[0]
        left.append(np.sqrt(np.mean((weight * 60.0 * x - matrix @ fitted) ** 2)))
    told = next(each for each in separated.apart if each.other == "hardening_spring")
    assert told.after == pytest.approx(min(left), rel=1e-3)


@pytest.mark.slow
def test_what_no_motion_shows_is_left_out():
    found = separate(sprung(), {"spring": ["hardening_spring", "cross_axis"]}, LIMITS, steps=1)
    assert found.left_out == ("cross_axis",) and len(found.apart) == 2
    with pytest.raises(ValueError, match="Hold the other axis still"):
        separate(sprung(), {"spring": ["cross_axis"]}, LIMITS)
    with pytest.raises(ValueError, match="no term of the effect"):
        separate(cogging(), {"spring": ["cogging"]}, LIMITS)


def test_misuse_is_said(axis):
    with pytest.raises(ValueError, match="jerk"):
        design(axis, LIMITS._replace(jerk=0.0))
    with pytest.raises(ValueError, match="centre"):
        design(axis, LIMITS._replace(centre=float("nan")))
    with pytest.raises(ValueError, match="stribeck_velocity"):
        design(axis.with_parameters({"stribeck_velocity": float("nan")}), LIMITS)


ARGUMENTS = ("--position=0.05", "--velocity=0.2", "--acceleration=2", "--jerk=60",
             "--duration=4", "--interval=0.004")  # fmt: skip


@pytest.mark.slow
def test_the_command(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    model = cogging()
    path, out = tmp_path / "model.json", tmp_path / "reference.csv"
    path.write_text(json.dumps(model.to_dict()))
    assert main(["design", str(path), *ARGUMENTS, "-o", str(out), "--json", "-"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["standard_errors"]["coulomb+"]["after"] > 0 and told["apart"] == []
    table = np.genfromtxt(out, delimiter=",", names=True)
    assert np.max(np.abs(table["reference"])) <= 0.05 * 1.001
    findings = [{"effect": "cogging", "confusable_with": ["gravity_unbalance"]}]
    path.write_text(json.dumps({"findings": findings, "model": model.to_dict()}))
    assert main(["design", str(path), *ARGUMENTS, "-o", str(out)]) == 0
    assert "if it is           and not" in capsys.readouterr().out
    assert main(["design", str(path), *ARGUMENTS, "-o", str(out), "--interval", "1"]) == 2
    assert "sample faster" in capsys.readouterr().err
