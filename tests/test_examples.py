"""The worked examples do what they say."""

import importlib.util
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

FOLDER = Path(__file__).parents[1] / "benchmarks" / "examples"


def load(name):
    spec = importlib.util.spec_from_file_location(f"example_{name}", FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run(name):
    """An example as a user has it: without the strict settings of the tests."""
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        return load(name).main()


def test_every_example_is_tested():
    text = Path(__file__).read_text("utf-8")
    for path in FOLDER.glob("*.py"):
        assert f'run("{path.stem}")' in text, path


def test_excitation_keeps_its_limits_whatever_the_amplitudes():
    example = load("excitation")
    rng = np.random.default_rng(0)
    for size in (1e-3, 1.0, 50.0):
        found = example.motion(jnp.asarray(size * rng.normal(size=(2, example.HARMONICS))))
        _, x, v, a = map(np.asarray, found)
        peaks = [np.abs(x).max() / example.TRAVEL, np.abs(v).max() / example.FASTEST]
        peaks.append(np.abs(a).max() / example.HARDEST)
        assert max(peaks) == pytest.approx(1.0)
        # The derivatives are those of the motion.
        for signal, rate in ((x, v), (v, a)):
            slope = np.gradient(signal, 1 / example.RATE)[1:-1]
            np.testing.assert_allclose(slope, rate[1:-1], atol=2e-3 * np.abs(rate).max())


@pytest.mark.slow
def test_a_designed_motion_identifies_better(capsys):
    found = run("excitation")
    expected, seen = found["expected"], found["seen"]
    assert np.all(expected[1] < 0.8 * expected[0])
    # Over 24 records a root mean square is known to 15 %; the formula leaves out the reversals.
    np.testing.assert_allclose(seen, expected, rtol=0.5)
    assert np.mean(np.log(seen[1] / seen[0])) < np.log(0.75)
    assert "stribeck_velocity" in capsys.readouterr().out


@pytest.mark.slow
def test_a_filter_is_learned_through_identification():
    found = run("learned_filter")
    assert found["after"] < 0.4 * found["before"]
    assert abs(found["delay"] - 3.4e-3) < 1e-3  # it started 3.6 ms away
    assert 4.5e-3 < found["width"] < 9e-3  # a scan has its least error between 7 and 8 ms


@pytest.mark.slow
def test_a_load_is_trained_around_the_friction():
    found = run("load_model")
    assert found["before"] > 0.08 and found["after"] < 0.02
    assert found["load"] < 0.05
