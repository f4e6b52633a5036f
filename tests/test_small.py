"""Small systems against numpy, and no LAPACK call in the compiled identification."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric.identification import small, solving


@pytest.mark.parametrize("count", [1, 2, 5, 9])
def test_solve_positive(count):
    rng = np.random.default_rng(count)
    factor = rng.normal(size=(count, count + 2)) * 10.0 ** rng.uniform(-4, 4, (count, 1))
    matrix, right = factor @ factor.T, rng.normal(size=count)
    got, pivot = small.solve_positive(jnp.asarray(matrix), jnp.asarray(right))
    scale = np.sqrt(np.diagonal(matrix))
    np.testing.assert_allclose(
        got * scale, np.linalg.solve(matrix, right) * scale, rtol=1e-9, atol=1e-12
    )
    assert float(pivot) > 0


def test_an_indefinite_matrix_is_told_by_its_pivot():
    _, pivot = small.solve_positive(jnp.asarray([[1.0, 2.0], [2.0, 1.0]]), jnp.ones(2))
    assert float(pivot) < 0


@pytest.mark.parametrize("count", [1, 3, 8])
def test_invert_upper(count):
    rng = np.random.default_rng(count)
    matrix = np.triu(rng.normal(size=(count, count))) + 3 * np.eye(count)
    np.testing.assert_allclose(
        small.invert_upper(jnp.asarray(matrix)), np.linalg.inv(matrix), rtol=1e-10, atol=1e-12
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "projection", [jf.ClosedWindows(), jf.WeakForm(16)], ids=["closed", "weak"]
)
def test_identification_calls_no_lapack(projection):
    """Two LAPACK batches at once can wait for each other for ever: see jaxfric.small."""
    t = jnp.linspace(0.0, 4.0, 400)
    log = jf.Recording(time=t, force=jnp.sin(t), velocity=jnp.cos(3 * t))
    term = jf.models.generalised()

    def solve(log):
        found, _ = solving.solve_one(term, log, projection, 16, (), 8)
        return found.model.alpha, found.covariance

    text = jax.jit(solve).lower(log).as_text()
    assert "lapack" not in text.lower()
    assert "stablehlo.while" in text  # the search is in there
