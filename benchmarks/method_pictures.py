"""The pictures of jaxfric/explanation/METHOD.md: `python benchmarks/method_pictures.py`."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from pathlib import Path

import jax
import matplotlib.pyplot as plt
import numpy as np

from jaxfric.cli.demo import EFFECT, SEED, SIZE
from jaxfric.explanation import evidence, regression, reversals, significance
from jaxfric.explanation.motion import motion_of
from jaxfric.explanation.predictions import with_predictions
from jaxfric.explanation.problem import problem_of
from jaxfric.models import named
from jaxfric.validation import concealed

FOLDER = Path(__file__).parents[1] / "jaxfric" / "explanation" / "pictures"


def save(figure, name):
    """Write a picture, the same for the same numbers."""
    FOLDER.mkdir(exist_ok=True)
    figure.savefig(FOLDER / f"{name}.svg", metadata={"Date": None}, bbox_inches="tight")


def rows(problem, machine):
    """What the base leaves, against position, and the force that was concealed."""
    seen, truth = problem.evidence, machine.truth[EFFECT]
    x = np.asarray(seen.motion.position)[seen.centre]
    kept = np.abs(x - np.median(x)) < 1.5 * truth["pitch"]
    figure, axis = plt.subplots(figsize=(6.4, 2.6))
    some = np.flatnonzero(kept)[::2]
    axis.plot(1e3 * x[some], problem.base.residual[some], ".", ms=2, label="rows in slip")
    axis.set(xlabel="position, mm", ylabel="residual of the base, N")
    axis.legend(frameon=False, loc="upper right")
    save(figure, "rows")


def draws(problem):
    """The best of all candidates by chance, and the gain of the winner."""
    seen = with_predictions(problem.evidence, problem.base)
    field = problem.candidate_set
    bootstrap = significance.BlockBootstrap(
        problem.base, significance.blocks(seen.elapsed[seen.centre], seen.reach)
    )
    scans = [
        bootstrap(columns, candidate.effect.positive)
        for group in field.groups
        for candidate, columns in zip(group, field.columns(group, seen), strict=True)
    ]
    names = [candidate.effect.name for candidate in field.candidates]
    winner = int(np.argmax([scan.gain[scan.best] for scan in scans]))
    figure, axis = plt.subplots(figsize=(6.4, 2.6))
    edges = np.geomspace(1e-4, 1, 60)
    axis.hist(scans[winner].drawn, edges, label=f"{names[winner]}, signs of blocks flipped")
    axis.axvline(scans[winner].gain[scans[winner].best], color="C3", label="as recorded")
    axis.set(xscale="log", xlabel="part of the residual explained", ylabel="draws")
    axis.legend(frameon=False)
    save(figure, "significance")


def turns():
    """Position by friction force in each reversal, where the axis yields and where it sticks."""
    figure, axes = plt.subplots(1, 2, figsize=(6.4, 2.6), sharey=True)
    for axis, effects, title in zip(
        axes, (("presliding",), ()), ("yields: presliding", "sticks"), strict=True
    ):
        machine = concealed.draw(122, effects, 0.15)
        motion = motion_of(concealed.record(machine).recording)
        seen = evidence.gather(motion)
        base = regression.fit([named(machine.baseline)], seen)
        for at, level in reversals.passages(motion, seen, base):
            way = np.asarray(motion.recording.position)[at]
            axis.plot(level, 1e6 * (way - way.mean()), lw=0.7)
        axis.set(title=title, xlabel="force, parts of the friction level", xticks=(-0.5, 0, 0.5))
    axes[0].set_ylabel("position, µm")
    save(figure, "reversals")


def main():
    """All pictures."""
    plt.switch_backend("svg")
    plt.rcParams |= {"svg.fonttype": "none", "font.size": 9, "svg.hashsalt": "jaxfric"}
    machine = concealed.draw(SEED, (EFFECT,), SIZE)
    problem = problem_of(concealed.record(machine).recording, named(machine.baseline))
    rows(problem, machine)
    draws(problem)
    turns()


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
