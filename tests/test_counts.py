"""What a loop makes of its encoder's counts is noise; what moves the axis beside them is not."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import PD, Encoder, Recording, models, simulate
from jaxfric.explanation.counts import answered
from jaxfric.explanation.figures import Figures
from jaxfric.simulation.errors import in_motion, residual
from jaxfric.simulation.prediction import Prepared

VALUES = {"inertia": 5.0} | {
    f"{name}{side}": value
    for name, value in (("coulomb", 20.0), ("viscous", 30.0))
    for side in "+-"
}


def moved(resolution: float) -> Recording:
    """A slow motion in closed loop, the position in counts of so many metres."""
    time = np.arange(6000) / 1000
    place, speed = 0.02 * np.sin(2.0 * time), 0.04 * np.cos(2.0 * time)
    channels = {"reference": jnp.asarray(place), "reference_velocity": jnp.asarray(speed)}
    clock = Recording(time, np.zeros_like(time), place, speed, channels=channels)
    run = simulate(
        models.from_parameters(models.coulomb_viscous(), VALUES), clock,
        PD(kp=5.0 * 60**2, kd=2 * 5.0 * 60), encoder=Encoder(resolution=resolution),
        force_noise=0.05, key=jax.random.key(0), substeps=8,
    )  # fmt: skip
    return dataclasses.replace(run, velocity=None, channels={})


def share(run: Recording, more=0.0) -> tuple[float, float]:
    """The part that answers the counts, and the size of what is left, N."""
    motion = Prepared(run)
    model = models.from_parameters(models.coulomb_viscous(), VALUES)
    rest, moving = residual(model, run, motion) + more, in_motion(run, 0.0, motion)
    return answered(rest, moving, motion), float(np.sqrt(np.mean(rest[moving] ** 2)))


def test_the_answer_of_a_loop_to_counts_is_noise():
    part, size = share(moved(4e-5))
    assert size > 1.0 and part > 0.5


@pytest.mark.parametrize("resolution", [4e-5, 1e-7])
def test_what_has_nothing_to_do_with_counts_is_not(resolution):
    run = moved(resolution)
    own, alone = share(run)
    part, size = share(run, 30 * np.sin(2 * np.pi * 31 * np.asarray(run.time)))
    assert size > 20 and abs(part * size**2 - own * alone**2) < 0.05 * size**2


@pytest.mark.parametrize(("step", "rounded"), [(4.0, True), (40.0, False)])
def test_counts_of_the_force_are_noise_where_they_are_many(step, rounded):
    """A force of a few levels is how it is made, and no rounding."""
    run = moved(1e-7)
    run = dataclasses.replace(run, force=jnp.round(run.force / step) * step)
    model = models.from_parameters(models.coulomb_viscous(), VALUES)
    whole = float(jnp.sqrt(jnp.mean(run.force**2)))  # of the samples at rest, too
    size = Figures(run, None, True).floor(model, 0.05) * whole / (step / np.sqrt(12))
    assert (0.7 < size < 1.1) == rounded and size < 1.1


def test_without_counts_there_is_no_answer():
    run = moved(4e-5)
    smooth = dataclasses.replace(run, position=0.02 * jnp.sin(2.0 * run.time))
    assert share(smooth)[0] == 0.0
    assert share(dataclasses.replace(run, velocity=smooth.position, position=None))[0] == 0.0
