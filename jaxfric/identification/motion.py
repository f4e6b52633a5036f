"""Motions within limits: multisines that repeat, and how the axis comes into them from rest."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data.recording import Recording

HARMONICS = 8
# Descents, one from near the plain sine.
STARTS = 4


class Limits(NamedTuple):
    """The most that a drive may do, to each side: position m, velocity m/s, acceleration m/s²,
    jerk m/s³; the motion's duration and sampling interval, s; and the middle of the stroke, m.
    """

    position: float
    velocity: float
    acceleration: float
    jerk: float
    duration: float = 10.0
    interval: float = 0.002
    centre: float = 0.0


class Motion(NamedTuple):
    """Time s, position m and its three derivatives, each `(N,)`; N from the limits."""

    time: Float[Array, " N"]
    position: Float[Array, " N"]
    velocity: Float[Array, " N"]
    acceleration: Float[Array, " N"]
    jerk: Float[Array, " N"]

    def recording(self) -> Recording:
        """The motion as a recording without force."""
        return Recording(self.time, jnp.zeros_like(self.time), self.position, self.velocity)


def multisine(coefficients: Float[Array, "2 H"], limits: Limits) -> Motion:
    """A sum of cosines and sines, scaled so that it just keeps within all its limits.

    The paper's (28) is the case of one or two sines. Whole periods: v(ti) = v(tf), eq. (14). The
    scale is fixed by the largest of the samples.
    """
    count = round(limits.duration / limits.interval)
    time = limits.interval * jnp.arange(count + 1, dtype=coefficients.dtype)
    order = jnp.arange(1, coefficients.shape[1] + 1, dtype=time.dtype)[:, None]
    rate = 2 * jnp.pi / limits.duration * order
    cosine, sine = jnp.cos(rate * time[None]), jnp.sin(rate * time[None])
    a, b = coefficients
    parts = []
    for derivative in range(4):
        # Derivatives turn cosine into −sine and sine into cosine.
        one = ((cosine, sine), (-sine, cosine), (-cosine, -sine), (sine, -cosine))[derivative]
        power = rate[:, 0] ** derivative
        parts.append((a * power) @ one[0] + (b * power) @ one[1])
    most = (limits.position, limits.velocity, limits.acceleration, limits.jerk)
    used = jnp.stack([jnp.max(jnp.abs(p)) / m for p, m in zip(parts, most, strict=True)])
    scaled = [p / jnp.max(used) for p in parts]
    return Motion(time, limits.centre + scaled[0], *scaled[1:])


def from_rest(coefficients: Float[Array, "2 H"]) -> Float[Array, "2 H"]:
    """The same motion, begun at its turning point of least acceleration."""
    a, b = np.asarray(coefficients, float)
    order = np.arange(1, a.size + 1)
    phase = np.linspace(0, 2 * np.pi, 512 * a.size + 1)
    turned = np.outer(phase, order)
    speed = np.cos(turned) @ (b * order) - np.sin(turned) @ (a * order)
    slope = np.cos(turned) @ (a * order**2) + np.sin(turned) @ (b * order**2)
    ends = np.flatnonzero(np.sign(speed[1:]) != np.sign(speed[:-1]))
    first = ends[np.argmin(np.abs(slope[ends]))]
    step = speed[first] / (speed[first] - speed[first + 1])
    shift = order * (phase[first] + step * (phase[1] - phase[0]))
    cosine, sine = np.cos(shift), np.sin(shift)
    turned = np.stack([a * cosine + b * sine, b * cosine - a * sine])
    return jnp.asarray(turned, coefficients.dtype)


def led(motion: Motion, limits: Limits) -> Motion:
    """A motion between turning points with a run-in from rest before it and a run-out behind.

    The acceleration runs from zero to that of the turning point as 3s² − 2s, s from 0 to 1: it
    leaves no velocity, and keeps within the limits if it takes 4 a/j.
    """
    step = limits.interval
    top = float(motion.acceleration[0])
    count = max(int(np.ceil(4 * abs(top) / limits.jerk / step)), 1)
    length, s = count * step, np.arange(count) / count
    parts = (
        float(motion.position[0]) + top * length**2 * (s**4 / 4 - s**3 / 3 + 1 / 12),
        top * length * (s**3 - s**2),
        top * (3 * s**2 - 2 * s),
        top * (6 * s - 2) / length,
    )
    whole = [
        np.concatenate([run, np.asarray(part), sign * run[::-1] + 0.0])
        for run, part, sign in zip(parts, motion[1:], (1, -1, 1, -1), strict=True)
    ]
    time = step * np.arange(whole[0].size)
    return Motion(*(jnp.asarray(x, motion.time.dtype) for x in (time, *whole)))


def sine(limits: Limits, dtype=float) -> Float[Array, "2 H"]:
    """The coefficients of the plain sine at the fastest harmonic that uses the whole stroke."""
    best, most = 1, 0.0
    for k in range(1, HARMONICS + 1):
        rate = 2 * jnp.pi * k / limits.duration
        reach = min(limits.position, limits.velocity / rate, limits.acceleration / rate**2)
        speed = float(min(reach, limits.jerk / rate**3) * rate)
        best, most = (k, speed) if speed > 1.001 * most else (best, most)
    return jnp.zeros((2, HARMONICS), dtype).at[1, best - 1].set(1.0)


def descend(cost, start: Float[Array, "2 H"], steps: int, rate: float = 0.05):
    """Coefficients of the least cost on the way of gradient descent (Adam; Kingma & Ba 2015).

    The gradients are those of coefficients of norm one, as the motion does not depend on the norm.
    """
    value = jax.value_and_grad(cost)

    def step(state, i):
        at, first, second, best, least = state
        now, slope = value(at)
        slope = jnp.where(jnp.isfinite(slope), slope, 0.0)
        best, least = jnp.where(now < least, at, best), jnp.minimum(now, least)
        first, second = 0.9 * first + 0.1 * slope, 0.999 * second + 0.001 * slope**2
        count = i.astype(at.dtype) + 1
        share = first / (1 - 0.9**count)
        size = jnp.sqrt(second / (1 - 0.999**count)) + 1e-12
        fade = 0.5 * (1 + jnp.cos(jnp.pi * count / steps))
        at = at - rate * fade * share / size
        return (at / jnp.linalg.norm(at), first, second, best, least), None

    zero = jnp.zeros_like(start)
    begun = (start, zero, zero, start, jnp.full((), jnp.inf, start.dtype))
    found, _ = jax.lax.scan(step, begun, jnp.arange(steps))
    return found[3], found[4]


def search(cost, limits: Limits, steps: int, values=None) -> Float[Array, "2 H"]:
    """The best of descents from near the plain sine and from drawn multisines, and of that sine.

    **Arguments:** `cost` of coefficients, and of `values` where there are any.
    """
    plain = sine(limits)
    drawn = jax.random.normal(jax.random.key(0), (STARTS, 2, HARMONICS))
    drawn = drawn / jnp.arange(1, HARMONICS + 1, dtype=drawn.dtype)[None, None]
    starts = jnp.concatenate([(plain + 0.02 * drawn[0])[None], drawn[1:].astype(plain.dtype)])

    @eqx.filter_jit
    def all_of(starts, plain, values):
        def of(coefficients):
            return cost(coefficients) if values is None else cost(coefficients, values)

        found, least = jax.lax.map(lambda start: descend(of, start, steps), starts)
        return jnp.append(found, plain[None], axis=0), jnp.append(least, of(plain))

    found, least = all_of(starts, plain, values)
    return found[int(jnp.nanargmin(least))]
