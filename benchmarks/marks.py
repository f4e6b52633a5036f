"""The marks for speed, each as a ratio to its peer, taken alternately in one process.

python benchmarks/marks.py [1] [2] [3] [5]

Processor seconds are minima over the rounds, so that neighbours on the machine, who only ever add,
disturb both sides alike. Accuracy stands beside the times.
"""

import resource
import sys
import time

import jax
import jax.numpy as jnp
import numpy as np
import peers

from jaxfric import identify
from jaxfric.data.recording import stack
from jaxfric.identification import compress
from jaxfric.identification.projections import ClosedWindows


def compiled(function, *arguments):
    program = jax.jit(function).lower(*arguments).compile()
    return program, lambda: jax.block_until_ready(program(*arguments))


def alternately(calls, rounds):
    """Least processor seconds and wall seconds of each call."""
    seconds = np.full((2, len(calls)), np.inf)
    for call in calls:
        call()
    for _ in range(rounds):
        for i, call in enumerate(calls):
            start = time.process_time(), time.perf_counter()
            call()
            spent = time.process_time() - start[0], time.perf_counter() - start[1]
            seconds[:, i] = np.minimum(seconds[:, i], spent)
    return seconds


def error(sides, beta):
    exact = peers.root_of_derivative(sides, np.asarray(beta))
    return float(np.max(np.abs(np.log(np.asarray(beta) / exact))))


def grid():
    """Mark 1."""
    samples, points = 20_000, 1000
    _, ready, rows, _ = peers.problem(2 * samples)
    side = tuple(map(jnp.asarray, next(peers.directions(ready, rows))))
    betas = jnp.geomspace(2e-3, 0.05, points)
    bare, ours = compiled(peers.floor, side[0], betas), compiled(peers.moment_costs, *side, betas)
    few = compiled(peers.naive_costs, *side, betas[::10])
    seconds = alternately([bare[1], ours[1], few[1]], 7)[0]
    print(f"1  grid of {points} over {samples}: {seconds[1] / seconds[0]:.2f} times the floor of "
          f"{seconds[0] / samples / points * 1e9:.2f} ns an exponential; naive (a tenth of the "
          f"grid, times ten) {10 * seconds[2] / seconds[1]:.1f} times slower; temporaries "
          f"{ours[0].memory_analysis().temp_size_in_bytes / 1e6:.1f} MB")  # fmt: skip


def generalised():
    """Mark 2: a grid of 100 x 100, refined, on nodes; and the same grid on the samples."""
    term, ready, rows, box = peers.problem(100_000, "generalised")

    def fit(ready, rows, box):
        return peers.jaxfric_fit(term, ready, rows, box, grid=100)

    nodes = compiled(lambda *a: fit(*a), ready, rows, box)
    least, compress.LEAST_POINTS = compress.LEAST_POINTS, 10**9
    try:
        direct = compiled(lambda *a: fit(*a), ready, rows, box)  # traced anew
    finally:
        compress.LEAST_POINTS = least
    (ours,), (theirs,) = (alternately([c[1]], r)[0] for c, r in ((nodes, 5), (direct, 1)))
    ours_wall, theirs_wall = (alternately([c[1]], 1)[1][0] for c in (nodes, direct))
    gap = np.max(np.abs(np.log(nodes[1]()[1] / direct[1]()[1])))
    print(f"2  grid of 100 x 100 over 100000, refined: nodes {ours * 1e3:.0f} ms, samples "
          f"{theirs:.1f} s: {theirs / ours:.0f} times (wall {theirs_wall / ours_wall:.0f}); "
          f"log beta differs by {gap:.0e}")  # fmt: skip


def batch():
    """Mark 3."""
    count, samples = 256, 2000
    problems = [peers.problem(samples)] + [
        (None, *each) for each in (peers.again(samples, seed) for seed in range(1, count))
    ]
    term = problems[0][0]
    stacked = [jax.tree.map(lambda *x: jnp.stack(x), *(p[i] for p in problems)) for i in (1, 2, 3)]

    def fits(*rows):
        return jax.lax.map(lambda row: peers.jaxfric_fit(term, *row)[:2], rows, batch_size=8)

    program, ours = compiled(fits, *stacked)
    sides = [list(peers.directions(*p[1:3])) for p in problems]
    few = sides[:16]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    ours()
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e3
    cpu, wall = alternately(
        [ours, lambda: [peers.scipy_one_start(s) for s in sides],
         lambda: [peers.scipy_five_starts(s) for s in few]], 4
    )  # fmt: skip
    rate = np.array([count, count, len(few)]) / cpu
    worst = max(error(s, b) for s, b in zip(sides[:32], ours()[1][:32], strict=True))
    print(f"3  {count} axes of {samples} samples: {rate[0]:.0f} axes per core-second (wall "
          f"{count / wall[0]:.0f} a second), scipy from one good start {rate[1]:.0f}, from five "
          f"{rate[2]:.0f}: {rate[0] / rate[1]:.1f} and {rate[0] / rate[2]:.0f} times; temporaries "
          f"{program.memory_analysis().temp_size_in_bytes / 1e6:.0f} MB, resident growth "
          f"{grown:.0f} MB; error of log beta {worst:.0e}")  # fmt: skip
    logs = stack([peers.axis(samples, seed) for seed in range(64)])
    whole = lambda: jax.block_until_ready(  # noqa: E731
        identify("gaussian", logs, projection=ClosedWindows()).model.alpha
    )
    cpu, wall = alternately([whole], 3)
    print(f"   jaxfric.identify of 64 of them (mass, intervals, diagnosis too): {64 / cpu[0]:.0f} "
          f"axes per core-second, {64 / wall[0]:.0f} a second")  # fmt: skip


def one():
    """Mark 5, and the whole of `identify` beside it."""
    for samples, rounds in ((2000, 30), (100_000, 7)):
        term, ready, rows, box = peers.problem(samples)
        _, ours = compiled(lambda *a, term=term: peers.jaxfric_fit(term, *a), ready, rows, box)
        sides = list(peers.directions(ready, rows))
        log = peers.axis(samples)
        whole = lambda log=log: jax.block_until_ready(  # noqa: E731
            identify("gaussian", log, projection=ClosedWindows()).model.alpha
        )
        rivals = (peers.scipy_one_start, peers.numpy_variable_projection, peers.scipy_five_starts)
        calls = [ours, *(lambda f=f, s=sides: f(s) for f in rivals), whole]
        cpu, wall = alternately(calls, rounds if samples < 5000 else 4)
        names = ("fit", "scipy LM, one start", "numpy projection", "scipy TRF, five", "identify")
        cells = [
            f"{n} {1e3 * c:.1f} ({1e3 * w:.1f})" for n, c, w in zip(names, cpu, wall, strict=True)
        ]
        print(f"5  one axis of {samples}, ms of processor (wall): {'; '.join(cells)}; error of log "
              f"beta {error(sides, ours()[1]):.0e}")  # fmt: skip


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    marks = {"1": grid, "2": generalised, "3": batch, "5": one}
    for chosen in sys.argv[1:] or marks:
        marks[chosen]()
