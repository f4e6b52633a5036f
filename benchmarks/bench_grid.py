"""Marks 1 and 2: the grid beside its floor, and beside the form one writes first."""

import time

import jax
import jax.numpy as jnp
import numpy as np
import peers
import pytest

N, G = (4000, 200) if peers.SHORT else (20_000, 1000)


@pytest.fixture(scope="module")
def side():
    _, ready, rows, _ = peers.problem(2 * N)
    speed, force, root = next(peers.directions(ready, rows))
    return tuple(map(jnp.asarray, (speed, force, root)))


BETAS = jnp.geomspace(2e-3, 0.05, G)


def compiled(function, *arguments):
    program = jax.jit(function).lower(*arguments).compile()
    return program, lambda: jax.block_until_ready(program(*arguments))


def test_floor_of_exponentials(benchmark, side):
    benchmark.group = f"grid of {G} points"
    benchmark(compiled(peers.floor, side[0], BETAS)[1])


def test_moments(benchmark, side):
    benchmark.group = f"grid of {G} points"
    program, call = compiled(peers.moment_costs, *side, BETAS)
    memory = program.memory_analysis().temp_size_in_bytes
    costs, naive = call(), jax.jit(peers.naive_costs)(*side, BETAS[::50])
    error = float(jnp.max(jnp.abs(costs[::50] / naive - 1)))
    # Processor seconds beside those of the floor, taken alternately, so that neighbours on the
    # machine disturb both alike.
    other, seconds = compiled(peers.floor, side[0], BETAS)[1], np.zeros((2, 7))
    for i in range(seconds.shape[1]):
        for j, run in enumerate((other, call)):
            start = time.process_time()
            run()
            seconds[j, i] = time.process_time() - start
    ratio = float(np.median(seconds[1]) / np.median(seconds[0]))
    benchmark.extra_info |= {
        "temporaries_MB": memory / 1e6,
        "L_against_naive": error,
        "cpu_over_floor": ratio,
    }
    benchmark(call)
    assert memory < 10e6


def test_naive(benchmark, side):
    benchmark.group = f"grid of {G} points"
    program, call = compiled(peers.naive_costs, *side, BETAS)
    benchmark.extra_info["temporaries_MB"] = program.memory_analysis().temp_size_in_bytes / 1e6
    benchmark.pedantic(call, rounds=3, warmup_rounds=1)


@pytest.mark.parametrize("points", [15, 64], ids=["225 points, direct", "4096 points, nodes"])
def test_generalised(benchmark, points):
    """The two-dimensional grid and its refinement; below 256 points it runs on the samples."""
    benchmark.group = "generalised model"
    term, ready, rows, box = peers.problem(10_000 if peers.SHORT else 100_000, "generalised")
    fit = jax.jit(lambda *a: peers.jaxfric_fit(term, *a, grid=points))
    cost, beta, _ = fit(ready, rows, box)
    benchmark.extra_info |= {"cost": float(cost), "beta": [float(b) for b in beta]}
    benchmark.pedantic(
        lambda: jax.block_until_ready(fit(ready, rows, box)), rounds=3, warmup_rounds=1
    )
