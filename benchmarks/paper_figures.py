"""Figures 3, 4, 5 and 8 of Kim, Kim & Ha (2004), from their section IV on our own machine.

    python benchmarks/paper_figures.py [FOLDER]

One noise-free period of the closed loop, identified with ACVM, AGM and ALM (figs. 3 to 5); then
the constant-velocity test: the loop holds speeds both ways, with noise, and the mean forces stand
beside the curves that were identified from the period before (fig. 8).
"""

import argparse
import pathlib

import jax
import jax.numpy as jnp
import matplotlib
import numpy as np
from paper_table import MODELS

import jaxfric as jf
from jaxfric.looks import drawing
from jaxfric.simulation import scenario

COLOURS = {"ACVM": "#c4570a", "AGM": "#2a7f3f", "ALM": "#0b5fa5"}
SPEEDS = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.15)
RATE, TRAVEL, NOISE = 1000.0, 0.04, 0.3


def staircase(seed=0):
    """The axis at constant speeds both ways, each over 40 mm or 0.5 to 4 s, in closed loop."""
    pieces, ramp = [np.zeros(200)], round(0.1 * RATE)
    ease = 0.5 - 0.5 * np.cos(np.pi * np.arange(ramp) / ramp)
    for speed in SPEEDS:
        hold = np.ones(round(min(max(TRAVEL / speed, 0.5), 4.0) * RATE))
        both = [ease, hold, ease[::-1]]
        pieces += [speed * np.concatenate(both), -speed * np.concatenate(both)]
    v = np.concatenate(pieces)
    t, x = np.arange(v.size) / RATE, np.cumsum(v) / RATE
    wanted = {"reference": jnp.asarray(x), "reference_velocity": jnp.asarray(v)}
    clock = jf.Recording(t, 0 * t, position=x, channels=wanted)
    mass, rate = scenario.TRUTH["inertia"], scenario.BANDWIDTH
    loop = jf.PD(kp=mass * rate**2, kd=2 * mass * rate)
    key = jax.random.key(seed)
    return jf.simulate(scenario.machine(), clock, loop, force_noise=NOISE, key=key)


def responses(figure, recording):
    """Fig. 3: set-point and response, velocity and force."""
    panels = figure.subplots(3, 1, sharex=True)
    shown = [
        drawing.Signal("position", "m", recording.position, recording.channels["reference"]),
        drawing.Signal("velocity", "m/s", recording.velocity),
        drawing.Signal("force", "N", recording.force),
    ]
    drawing.signals(panels, np.asarray(recording.time), shown, "time [s]")


def curves(axes, fits, speed, title):
    """Figs. 4 and 5: identified curves over the truth; without a line through the jump at rest."""
    half = np.linspace(1e-5, speed, 1000)
    for sign in (-1, 1):
        v = jnp.asarray(sign * half)
        only = {"label": "true" if sign > 0 else None}
        axes.plot(v, scenario.machine().friction(v), "k", lw=5, alpha=0.25, **only)
        for name, fit in fits.items():
            style = {"color": COLOURS[name], "lw": 1.3, "label": name if sign > 0 else None}
            axes.plot(v, fit.model.friction(v), **style)
    axes.axhline(0, color="0.8", lw=0.8, zorder=0)
    axes.axvline(0, color="0.8", lw=0.8, zorder=0)
    axes.set_xlabel("velocity [m/s]")
    axes.set_ylabel("friction force [N]")
    axes.set_title(title)
    axes.legend(fontsize=8, loc="upper left")
    axes.grid(color="0.93")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    folder = pathlib.Path(__file__).parent / "pictures"
    parser.add_argument("folder", nargs="?", type=pathlib.Path, default=folder)
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    matplotlib.use("Agg")
    jax.config.update("jax_enable_x64", True)
    recording = scenario.record(scenario.machine())
    fits = {short: jf.identify(name, recording) for short, name in MODELS.items()}
    figure = drawing.figure(7, 6)
    responses(figure, recording)
    figure.savefig(folder / "paper_fig3.png", dpi=110)
    held = staircase()
    tests = {name: jf.constant_velocity(held, fit) for name, fit in fits.items()}
    figure = drawing.figure(8, 9)
    whole, slow = figure.subplots(2, 1)
    curves(whole, fits, 0.19, "Figs. 4 and 5: identified from one period")
    curves(slow, fits, 0.03, "at low velocity")
    figure.savefig(folder / "paper_fig4_5.png", dpi=110)
    figure = drawing.figure(8, 9)
    whole, slow = figure.subplots(2, 1)
    for axes, speed, title in (
        (whole, 0.19, "Fig. 8: constant-velocity test of another run"),
        (slow, 0.03, "at low velocity"),
    ):
        drawing.held(axes, tests["ALM"])
        curves(axes, fits, speed, title)
        axes.set_xlim(-speed, speed)
    figure.savefig(folder / "paper_fig8.png", dpi=110)
    for name, test in tests.items():
        off = max(abs(p.force - p.curve) for p in test.points)
        wrong = len(test.contradicted)
        print(f"{name}: {wrong} of {len(test.points)} speeds contradict; at most {off:.2f} N off")


if __name__ == "__main__":
    main()
