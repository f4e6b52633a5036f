"""Machines that the library's own simulator runs, in units from µN and µm to kN and km."""

import numpy as np
from numpy.random import Generator

from jaxfric import models
from jaxfric.data.recording import Recording
from jaxfric.simulation import control
from jaxfric.simulation.simulating import simulate

from . import motions
from .logs import PLAIN, TRUE_VELOCITY, Log, Pair, log_uniform

# One length and a fixed number of steps a sample: one compiled program a model.
SAMPLES = 4000
SUBSTEPS = 4


def draw(rng: Generator) -> Pair:
    """A machine with multisines of a whole number of periods and two runs of it."""
    cycle = log_uniform(rng, 80, 250)
    rate = 1000.0
    time = np.arange(SAMPLES) / rate
    x = [motions.multisine(rng, time, rate / cycle) for _ in range(2)]
    goals = [0.1 * (each - each.min()) / np.ptp(each) for each in x]
    speed = float(np.quantile(np.abs(np.gradient(goals[0], time)), 0.98))
    hard = float(np.quantile(np.abs(np.gradient(np.gradient(goals[0], time), time)), 0.98))
    truth = _truth(rng, speed, hard)
    name = "gaussian" if "stribeck_force+" in truth else "coulomb-viscous"
    model = models.from_parameters(models.named(name), truth)
    # Twice the bandwidth times the step stays below 0.8: a loop that is well damped.
    omega = 2 * np.pi * rate / cycle * rng.uniform(3, 5)
    loop = control.PD(kp=truth["inertia"] * omega**2, kd=2 * truth["inertia"] * omega)
    names = dict(PLAIN[rng.integers(len(PLAIN))], reference="reference")
    columns = [_run(rng, model, goal, time, loop, speed) for goal in goals]
    about = truth, speed, hard, cycle, name, f"library: {cycle:.3g} samples a cycle"
    units = [10 ** rng.uniform(-6, 3), 10 ** rng.uniform(-6, 3), 10 ** rng.uniform(-1, 1)]
    return Pair(*(Log(each, names, *about).scaled(*units) for each in columns))


def _truth(rng: Generator, speed: float, hard: float) -> dict[str, float]:
    coulomb = 10.0
    truth = {"inertia": coulomb / hard * log_uniform(rng, 0.3, 3.0)}
    bump = rng.random() < 0.5
    for sign in "+-":
        truth[f"coulomb{sign}"] = coulomb * rng.uniform(0.8, 1.25)
        truth[f"viscous{sign}"] = coulomb / speed * rng.uniform(0.2, 1.0)
        if bump:
            truth[f"stribeck_force{sign}"] = coulomb * rng.uniform(0.2, 0.5)
            truth[f"stribeck_velocity{sign}"] = speed * rng.uniform(0.05, 0.12)
    return truth


def _run(rng, model, goal, time, loop, speed) -> dict[str, np.ndarray]:
    wanted = np.gradient(goal, time)
    channels = {"reference": goal, "reference_velocity": wanted}
    set_point = Recording(time, np.zeros_like(time), goal, channels=channels)
    run = simulate(model, set_point, loop, substeps=SUBSTEPS)
    force = np.asarray(run.force)
    # The force is held from its sample to the next: the mean of both neighbours is centred.
    force = 0.5 * (force + np.append(force[0], force[:-1]))
    count = np.ptp(goal) / log_uniform(rng, 1e4, 1e6)
    velocity = np.asarray(run.velocity) + 1e-3 * speed * rng.normal(size=time.size)
    return {
        "time": time, "position": count * np.round(np.asarray(run.position) / count),
        "velocity": velocity, "force": force + 0.1 * rng.normal(size=time.size),
        "reference": goal, TRUE_VELOCITY: np.asarray(run.velocity),
    }  # fmt: skip
