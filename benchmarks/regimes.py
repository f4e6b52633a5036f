"""When which method: bias and spread of eight ways to identify friction, and a map of regimes.

    python benchmarks/regimes.py [--draws 24] [--picture regimes.png]

One axis with Coulomb and viscous friction of each direction, which every method can express, on
the paper's motion of two sines at 1 kHz; white noise on the force, an encoder; whole periods or
not; the mass that some are told, right or 20 % high. The motion is given, so that noise does not
move the axis. The error is that of the friction curve from 0.01 to 0.18 m/s: of the mean of the
draws (bias) and about it (spread), root mean squares in parts of the mean friction. (L) is
eqs. (18), (19) here.
"""

import argparse
from pathlib import Path

import numpy as np
from regime_methods import METHODS, prepared

RATE, PERIOD, MASS = 1000.0, 2.0, 5.0
TRUTH = np.array([20.0, 60.0, 18.0, 80.0])
NOISES = (0.01, 0.05, 0.2)
RESOLUTIONS = (1e-7, 1e-6, 1e-5)
LENGTHS = (0.85, 1.0, 1.5, 5.0)
MASSES = (5.0, 6.0)
SPEEDS = np.linspace(0.01, 0.18, 100)
# Of the drawn map: what is within a fifth of the best is as good.
AS_GOOD = 1.2


def motion(time):
    """Position, velocity, acceleration of the paper's kind of set-point (28)."""
    w = 2 * np.pi / PERIOD
    x = 0.03 * np.sin(w * time) + 0.01 * np.sin(3 * w * time)
    v = 0.03 * w * (np.cos(w * time) + np.cos(3 * w * time))
    a = -0.03 * w**2 * (np.sin(w * time) + 3 * np.sin(3 * w * time))
    return x, v, a


def friction(parameters, v):
    """The curve, N, for parameters `(..., 4)` at velocities `(K,)`: `(..., K)`."""
    c, b, d, e = (parameters[..., i, None] for i in range(4))
    return np.where(v > 0, c + b * v, -d + e * v)


def recorded(noise, resolution, length, mass, draws, seed):
    """Draws of a record; each begins elsewhere in the period, and on another count."""
    rng = np.random.default_rng(seed)
    count = round(length * PERIOD * RATE) + 1
    time = np.arange(count)[:, None] / RATE + rng.uniform(0, PERIOD, draws)[None]
    x, v, a = motion(time)
    x = x + rng.uniform(0, resolution, draws)[None]
    force = MASS * a + friction(TRUTH, v)
    force = force + noise * 20.0 * rng.normal(size=force.shape)
    seen = resolution * np.round(x / resolution)
    return prepared(1 / RATE, seen, force, round(PERIOD * RATE), mass)


def errors(parameters):
    """Bias and spread of the curve, parts of the mean friction."""
    v = np.concatenate([-SPEEDS, SPEEDS])
    truth = friction(TRUTH, v)
    off = friction(parameters, v) - truth
    size = np.mean(np.abs(truth))
    bias = np.sqrt(np.mean(np.mean(off, axis=0) ** 2))
    return bias / size, np.sqrt(np.mean(np.var(off, axis=0))) / size


def sweep(draws):
    """Bias and spread of every method in every case."""
    table, seed = {}, 0
    for mass in MASSES:
        for length in LENGTHS:
            for noise in NOISES:
                for resolution in RESOLUTIONS:
                    record = recorded(noise, resolution, length, mass, draws, seed)
                    case = (noise, resolution, length, mass)
                    table[case] = {name: errors(m(record)) for name, m in METHODS.items()}
                    seed += 1
    return table


def printed(table):
    print(f"{'noise  encoder  periods  mass':32}" + "".join(f"{n[:16]:>18}" for n in METHODS))
    for (noise, resolution, length, mass), found in table.items():
        label = f"{noise:4.0%} {resolution:9.0e} {length:7.3g} {mass:7.3g}"
        cells = "".join(f"{b:>10.2%} {s:>7.2%}" for b, s in found.values())
        print(f"{label:32}{cells}")


def drawn(table, path):
    """The map: for each length and mass told, a grid of noise and encoder, and the best there."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    colours = dict(zip(METHODS, pyplot.get_cmap("tab10").colors, strict=False))
    figure, panels = pyplot.subplots(
        len(MASSES), len(LENGTHS), figsize=(15, 7.4), sharex=True, sharey=True, layout="constrained"
    )
    for i, mass in enumerate(MASSES):
        for j, length in enumerate(LENGTHS):
            axes = panels[i, j]
            for y, noise in enumerate(NOISES):
                for x, resolution in enumerate(RESOLUTIONS):
                    _cell(axes, x, y, table[noise, resolution, length, mass], colours)
            told = "right" if mass == MASS else f"{mass / MASS - 1:.0%} high"
            axes.set_title(f"{length:g} period{'s' * (length != 1)}, mass told {told}", fontsize=10)
            axes.set_xticks(range(len(RESOLUTIONS)), [f"{1e6 * r:g} µm" for r in RESOLUTIONS])
            axes.set_yticks(range(len(NOISES)), [f"{n:.0%}" for n in NOISES])
            axes.set_xlim(-0.5, len(RESOLUTIONS) - 0.5)
            axes.set_ylim(-0.5, len(NOISES) - 0.5)
    figure.supxlabel("encoder resolution")
    figure.supylabel("noise of the force, share of Coulomb friction")
    figure.suptitle(
        "Least error of the friction curve (bias and spread), and all methods within a fifth of it"
    )
    figure.savefig(path, dpi=110)


def _cell(axes, x, y, found, colours):
    from matplotlib.patches import Rectangle

    total = {name: float(np.hypot(*each)) for name, each in found.items()}
    total = {name: each for name, each in total.items() if np.isfinite(each)}
    order = sorted(total, key=total.get)
    least = total[order[0]]
    axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, color=colours[order[0]], alpha=0.25, lw=0))
    alike = [name for name in order if total[name] <= AS_GOOD * least]
    text = "\n".join([f"{least:.2%}", *alike])
    axes.text(x, y, text, ha="center", va="center", fontsize=6.5)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=24)
    picture = Path(__file__).parent / "pictures" / "regimes.png"
    parser.add_argument("--picture", type=Path, default=picture)
    arguments = parser.parse_args()
    table = sweep(arguments.draws)
    printed(table)
    drawn(table, arguments.picture)


if __name__ == "__main__":
    main()
