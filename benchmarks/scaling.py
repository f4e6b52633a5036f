"""How the time of a fit grows with samples N, grid points G and axes B, beside its floors.

python benchmarks/scaling.py

draws benchmarks/pictures/scaling.png. The floors are measured in the same run: as many
exponentials as a grid on the samples would take, and one pass over the recording's three signals.
"""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import peers
from marks import alternately, compiled

from jaxfric.identification import compress

PICTURE = Path(__file__).parent / "pictures" / "scaling.png"
SAMPLES = (500, 2000, 8000, 32_000, 128_000)
POINTS = (32, 64, 128, 512, 2048)
AXES = (1, 4, 16, 64, 256)


def fit_calls(samples, points=None):
    """The fit, the exponentials of its grid, and a pass over its signals."""
    term, ready, rows, box = peers.problem(samples)
    ours = compiled(lambda *a: peers.jaxfric_fit(term, *a, grid=points)[:2], ready, rows, box)[1]
    betas = jnp.geomspace(2e-3, 0.05, points or 128)
    floor = compiled(peers.floor, jnp.abs(ready.velocity), betas)[1]
    signals = jnp.stack([ready.velocity, rows.target, rows.positive])
    reading = compiled(lambda x: jnp.sum(x, axis=1), signals)[1]
    return ours, floor, reading


def seconds(calls, rounds=5):
    return alternately(calls, rounds)[0]


def by_samples():
    rows = []
    for count in SAMPLES:
        ours, floor, reading = fit_calls(count)
        sides = list(peers.directions(*peers.problem(count)[1:3]))
        rows.append(seconds([ours, floor, reading, lambda s=sides: peers.scipy_one_start(s)]))
    return np.array(rows).T


def by_points():
    rows = []
    for points in POINTS:
        ours, floor, _ = fit_calls(20_000, points)
        rows.append(seconds([ours, floor]))
    return np.array(rows).T


def by_axes(samples=2000):
    first = peers.problem(samples)
    problems = [first[1:], *(peers.again(samples, seed) for seed in range(1, max(AXES)))]
    sides = list(peers.directions(*first[1:3]))
    rows = []
    for count in AXES:
        stacked = jax.tree.map(lambda *x: jnp.stack(x), *problems[:count])

        def fits(*row, count=count):
            one = lambda r: peers.jaxfric_fit(first[0], *r)[:2]  # noqa: E731
            return jax.lax.map(one, row, batch_size=min(16, count))

        ours = compiled(fits, *stacked)[1]
        found = seconds([ours, lambda: peers.scipy_one_start(sides)], 3)
        rows.append((found[0], count * found[1]))
    return np.array(rows).T


def draw(panels):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained", sharey=True)
    for axis, (label, x, lines) in zip(axes, panels, strict=True):
        for name, y in lines.items():
            floor = "floor" in name
            axis.loglog(x, 1e3 * np.asarray(y), "--" if floor else "o-", label=name, lw=1.3, ms=4)
        axis.set_xlabel(label)
        axis.grid(alpha=0.3, which="both", lw=0.4)
        axis.legend(fontsize=7, frameon=False)
    axes[0].set_ylabel("processor time, ms")
    figure.savefig(PICTURE, dpi=110)


def main():
    samples, points, axes = by_samples(), by_points(), by_axes()
    names = (
        "jaxfric",
        "exponential floor of G = 128",
        "bandwidth floor",
        "scipy LM, one good start",
    )
    draw(
        [
            ("samples N (G = 128)", SAMPLES, dict(zip(names, samples, strict=True))),
            (
                f"grid points G (N = 20 000); on nodes from {compress.LEAST_POINTS}",
                POINTS,
                dict(zip(("jaxfric", "exponential floor"), points, strict=True)),
            ),
            (
                "axes B (N = 2000, G = 128)",
                AXES,
                dict(zip(("jaxfric", "scipy LM, one good start"), axes, strict=True)),
            ),
        ]
    )
    for title, table in (("N", samples), ("G", points), ("B", axes)):
        print(title, np.array2string(1e3 * table, precision=2, suppress_small=True))


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
