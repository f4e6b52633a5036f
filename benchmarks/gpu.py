"""Marks 1 to 3 on whatever device jax has, in float64 and float32, as JSON lines.

python benchmarks/gpu.py                                      on the accelerator
JAX_PLATFORMS=cpu taskset -c 0,1 python benchmarks/gpu.py     on two cores, to compare

Wall seconds, least of the rounds, compilation beside them: an accelerator has no processor seconds.
The error of log β is against the root of the analytic derivative in float64.
"""

import json
import sys
import time

import jax
import jax.numpy as jnp
import numpy as np
import peers

from jaxfric import identify
from jaxfric.data.recording import stack
from jaxfric.identification.projections import ClosedWindows

GRIDS = ((20_000, 1000), (200_000, 4000))
AXES = (256, 4096)
SAMPLES = 2000


def timed(function, *arguments, rounds=5):
    """Seconds to compile, seconds to run, and what came out."""
    start = time.perf_counter()
    program = jax.jit(function).lower(*arguments).compile()
    compiling = time.perf_counter() - start
    seconds, out = np.inf, None
    for _ in range(rounds):
        start = time.perf_counter()
        out = jax.block_until_ready(program(*arguments))
        seconds = min(seconds, time.perf_counter() - start)
    return compiling, seconds, out


def say(**facts):
    device = jax.devices()[0]
    told = {"device": device.device_kind, "float64": bool(jax.config.jax_enable_x64)}
    told |= {k: float(f"{v:.4g}") if isinstance(v, float) else v for k, v in facts.items()}
    print(json.dumps(told), flush=True)


def grids():
    """Mark 1: the grid over the Stribeck velocity, beside as many bare exponentials."""
    for samples, points in GRIDS:
        _, ready, rows, _ = peers.problem(2 * samples)
        side = tuple(map(jnp.asarray, next(peers.directions(ready, rows))))
        betas = jnp.geomspace(2e-3, 0.05, points)
        bare = timed(peers.floor, side[0], betas)[1]
        compiling, seconds, _ = timed(peers.moment_costs, *side, betas)
        few = timed(peers.naive_costs, *side, betas[:: points // 100], rounds=2)[1]
        say(mark=1, samples=samples, points=points, compiling=compiling, seconds=seconds,
            over_floor=seconds / bare, naive_over_it=few * points / 100 / seconds)  # fmt: skip


def general():
    """Mark 2: a grid of 100 x 100 over two nonlinear parameters, refined."""
    term, ready, rows, box = peers.problem(100_000, "generalised")
    compiling, seconds, _ = timed(
        lambda *a: peers.jaxfric_fit(term, *a, grid=100), ready, rows, box, rounds=3
    )
    say(mark=2, samples=100_000, points=10_000, compiling=compiling, seconds=seconds)


def batches():
    """Mark 3: fits of a whole batch, so many rows at once; and the whole of `identify`."""
    first = peers.problem(SAMPLES)
    problems = [first[1:], *(peers.again(SAMPLES, seed) for seed in range(1, AXES[0]))]
    stacked = jax.tree.map(lambda *x: jnp.stack(x), *problems)
    sides = [list(peers.directions(*each[:2])) for each in problems[:32]]
    logs = [peers.axis(SAMPLES, seed) for seed in range(AXES[0])]
    for count in AXES:
        rows = jax.tree.map(lambda x, n=count: jnp.concatenate([x] * (n // AXES[0])), stacked)
        for together in (8, 256, 4096):
            if together > count or (together > 8 and jax.default_backend() == "cpu"):
                continue

            def fits(*rows, together=together):
                one = lambda row: peers.jaxfric_fit(first[0], *row)[:2]  # noqa: E731
                return jax.lax.map(one, rows, batch_size=together)

            compiling, seconds, (_, betas) = timed(fits, *rows, rounds=3)
            exact = [peers.root_of_derivative(s, np.asarray(b, float))
                     for s, b in zip(sides, betas[:32], strict=True)]  # fmt: skip
            worst = np.max(np.abs(np.log(np.asarray(betas[:32], float) / np.array(exact))))
            say(mark=3, axes=count, together=together, compiling=compiling,
                axes_a_second=count / seconds, error_of_log_beta=float(worst))  # fmt: skip
        batch = jax.device_put(stack(logs * (count // AXES[0])))
        start = time.perf_counter()
        for _ in range(3):
            before = time.perf_counter()
            found = jax.block_until_ready(identify("gaussian", batch, projection=ClosedWindows()))
            last = time.perf_counter() - before
        first_call = time.perf_counter() - start - 2 * last
        sure = float(np.mean(np.asarray(found.result._value) == 0))
        say(what="identify", axes=count, first_call=first_call, axes_a_second=count / last,
            successful=sure)  # fmt: skip


if __name__ == "__main__":
    for wide in (True, False):
        jax.config.update("jax_enable_x64", wide)
        for part in (grids, general, batches):
            if not sys.argv[1:] or part.__name__ in sys.argv[1:]:
                try:
                    part()
                except Exception as error:
                    say(failed=part.__name__, why=f"{type(error).__name__}: {error}"[:300])
