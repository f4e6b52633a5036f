"""Marks 1 to 3 on whatever device jax has, in float64 and float32, as JSON lines.

python benchmarks/gpu.py [grids] [general] [batches] [whole] [float64] [float32]
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
from jaxfric.identification.setup import set_up
from jaxfric.identification.solving import solve_rows

GRIDS = ((20_000, 1000), (200_000, 4000))
AXES = (256, 4096)
WHOLE = (256, 4096)
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
    """Mark 3: fits of a whole batch, so many rows at once."""
    with jax.default_device(jax.devices("cpu")[0]):  # one by one, each operation by itself
        first = peers.problem(SAMPLES)
        problems = [first[1:], *(peers.again(SAMPLES, seed) for seed in range(1, AXES[0]))]
        stacked = jax.tree.map(lambda *x: np.stack(x), *problems)
    sides = [list(peers.directions(*each[:2])) for each in problems[:32]]
    for count in AXES:
        rows = jax.tree.map(lambda x, n=count: jnp.concatenate([x] * (n // AXES[0])), stacked)
        for together in (8, 256, 4096):
            if together > count or (together > 8 and jax.default_backend() == "cpu"):
                continue

            def fits(*rows, together=together):
                one = lambda row: peers.jaxfric_fit(first[0], *row)[:2]  # noqa: E731
                return jax.lax.map(one, rows, batch_size=together)

            # As `jaxfric.programs.compiled` does: a GPU multiplies float32 with ten bits else.
            with jax.default_matmul_precision("highest"):
                compiling, seconds, (_, betas) = timed(fits, *rows, rounds=3)
            exact = [peers.root_of_derivative(s, np.asarray(b, float))
                     for s, b in zip(sides, betas[:32], strict=True)]  # fmt: skip
            worst = np.max(np.abs(np.log(np.asarray(betas[:32], float) / np.array(exact))))
            say(mark=3, axes=count, together=together, compiling=compiling,
                axes_a_second=count / seconds, error_of_log_beta=float(worst))  # fmt: skip


def whole():
    """`identify` as called, of a batch: mass, intervals, diagnosis and the checks on the host."""
    logs = [peers.axis(SAMPLES, seed) for seed in range(AXES[0])]
    for count in WHOLE:
        batch = stack(logs * (count // AXES[0]))
        call = lambda b=batch: jax.block_until_ready(  # noqa: E731
            identify("gaussian", b, projection=ClosedWindows())
        )
        first, found = seconds_of(call)
        again = min(seconds_of(call)[0] for _ in range(2))
        setup = set_up("gaussian", batch, ClosedWindows())
        solve = lambda s=setup: jax.block_until_ready(solve_rows(*s))  # noqa: E731
        solving = min(seconds_of(solve)[0] for _ in range(2))
        sure = float(np.mean(np.asarray(found.result._value) == 0))
        say(what="identify", axes=count, first_call=first, axes_a_second=count / again,
            without_host=count / solving, successful=sure)  # fmt: skip


def seconds_of(call):
    start = time.perf_counter()
    out = call()
    return time.perf_counter() - start, out


if __name__ == "__main__":
    given = set(sys.argv[1:])
    for wide in (True, False):
        if given & {"float64", "float32"} and ("float64" if wide else "float32") not in given:
            continue
        jax.config.update("jax_enable_x64", wide)
        for part in (grids, general, batches, whole):
            if not given - {"float64", "float32"} or part.__name__ in given:
                try:
                    part()
                except Exception as error:
                    say(failed=part.__name__, why=f"{type(error).__name__}: {error}"[:300])
