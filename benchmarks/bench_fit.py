"""Marks 4 and 5: one fit beside what users would run instead, at the same minimum."""

import jax
import numpy as np
import peers
import pytest

SIZES = [2000] if peers.SHORT else [2000, 100_000]
RIVALS = [
    peers.scipy_one_start,
    peers.numpy_variable_projection,
    peers.lmfit_five_starts,
    peers.scipy_five_starts,
]


def account(benchmark, sides, cost, beta):
    exact = peers.root_of_derivative(sides, np.asarray(beta))
    error = float(np.max(np.abs(np.log(np.asarray(beta) / exact))))
    benchmark.extra_info |= {"cost": float(cost), "log_beta_error": error}
    return error


@pytest.mark.parametrize("samples", SIZES)
def test_jaxfric(benchmark, samples):
    benchmark.group = f"one fit, {samples} samples"
    term, ready, rows, box = peers.problem(samples)
    fit = jax.jit(lambda *a: peers.jaxfric_fit(term, *a))
    cost, beta, _ = fit(ready, rows, box)
    sides = list(peers.directions(ready, rows))
    assert account(benchmark, sides, cost, beta) <= 1e-10
    assert np.all((beta >= box[0]) & (beta <= box[1]))
    benchmark.pedantic(
        lambda: jax.block_until_ready(fit(ready, rows, box)), rounds=7, warmup_rounds=1
    )


@pytest.mark.parametrize("samples", SIZES)
@pytest.mark.parametrize("rival", RIVALS, ids=lambda rival: rival.__name__)
def test_rival(benchmark, rival, samples):
    benchmark.group = f"one fit, {samples} samples"
    _, ready, rows, _ = peers.problem(samples)
    sides = list(peers.directions(ready, rows))
    account(benchmark, sides, *rival(sides))
    benchmark.pedantic(lambda: rival(sides), rounds=2 if samples > 5000 else 5)
