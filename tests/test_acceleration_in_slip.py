"""The acceleration that closed windows take off the force, where an axis breaks loose."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric import signals
from jaxfric.identification import assessment

STRETCHES, LENGTH, STEP = 24, 60, 0.004


def strokes(quick: float, noise: float = 0.0):
    """Strokes to and fro that begin as a controller answers, by `quick` samples; their velocity,
    and the exact acceleration.
    """
    since = (np.arange(LENGTH) + 0.2) / quick
    speed = 1 - np.exp(-since) + 0.01 * np.arange(LENGTH)
    rate = (np.exp(-since) / quick + 0.01) / STEP
    way = np.where(np.arange(STRETCHES) % 2, -1.0, 1.0)
    velocity, exact = ((way[:, None] * each).ravel() for each in (speed, rate))
    velocity += np.random.default_rng(5).normal(0, noise, velocity.size)
    time = np.arange(velocity.size) * STEP
    return jf.Recording(time=time, force=np.zeros_like(time), velocity=velocity), exact


def found(log):
    slope, unsure = assessment._slope_in_slip(log, signals.scales(log))
    return np.asarray(slope).reshape(STRETCHES, -1), np.asarray(unsure).reshape(STRETCHES, -1)


@pytest.mark.slow
def test_an_answer_of_few_samples_is_followed_and_what_is_left_is_unsure():
    log, exact = strokes(2.0)
    slope, unsure = found(log)
    off = np.abs(slope - exact.reshape(STRETCHES, -1))[:, 1:6]
    parabolas = np.gradient(np.asarray(log.velocity).reshape(STRETCHES, -1), STEP, axis=1)
    was = np.abs(parabolas - exact.reshape(STRETCHES, -1))[:, 1:6]
    assert np.sum(off) < 0.4 * np.sum(was)
    assert np.all(off <= np.abs(unsure[:, 1:6]) + 1e-9)


@pytest.mark.slow
def test_noise_bends_nothing():
    log, _ = strokes(30.0, noise=0.05)
    slope, _ = found(log)
    parabolas = np.gradient(np.asarray(log.velocity).reshape(STRETCHES, -1), STEP, axis=1)
    inner = slice(1, -1)
    changed = np.abs(slope - parabolas)[:, inner] > 1e-9
    assert np.mean(changed) < 0.05


def test_few_strokes_are_no_mean():
    log, _ = strokes(2.0)
    few = jnp.arange(log.num_samples) < 4 * LENGTH
    slope, _ = found(log)
    short = jf.Recording(time=log.time, force=log.force, velocity=log.velocity, mask=few)
    alone = found(short)[0][:4]
    assert np.max(np.abs(alone[:, 1] - slope[:4, 1])) > 1.0  # by parabolas alone
