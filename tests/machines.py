"""Axes drawn at random, in closed loop with everything that a real log has, in many units."""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jaxfric as jf
from jaxfric import signals
from jaxfric.identification.projections import WeakForm
from jaxfric.models import weighed
from jaxfric.simulation.lateness import at_once, later
from jaxfric.simulation.prediction import with_channels

PERIOD = 4.0


class Disturbance(jf.terms.AbstractLaw):
    """A load on the axis that the log does not contain."""

    affine = (jf.terms.Parameter("disturbance"),)
    coordinates = frozenset({"disturbance"})

    def law(self, sample):
        return (sample.channels["disturbance"],)


class Fleet(NamedTuple):
    """Recordings as one batch `(B, N)`, and the true parameters by name, each `(B,)`."""

    recordings: jf.Recording
    truth: dict[str, np.ndarray]


def _draw(rng, count, model):
    """Parameters in N, m, s; every ratio that matters spans about a decade."""
    truth = {"inertia": 10 ** rng.uniform(0, 1, count)}
    for sign in "+-":
        truth[f"coulomb{sign}"] = 10 ** rng.uniform(0.7, 1.5, count)
        truth[f"viscous{sign}"] = 10 ** rng.uniform(1.2, 2.0, count)
        if model != "coulomb-viscous":
            share = rng.uniform(0.2, 0.6, count)
            truth[f"stribeck_force{sign}"] = share * truth[f"coulomb{sign}"]
            truth[f"stribeck_velocity{sign}"] = 10 ** rng.uniform(-2.0, -1.4, count)
    return truth


def _motion(rng, count, time):
    """Multisines with a whole number of periods and a root-mean-square speed of about 0.1 m/s."""
    rate = 2 * np.pi / PERIOD
    position = velocity = 0.0
    for harmonic in (1, 2, 5):
        phase = rng.uniform(0, 2 * np.pi, (count, 1))
        speed = rng.uniform(0.04, 0.12, (count, 1))
        position = position + speed / (harmonic * rate) * np.sin(harmonic * rate * time + phase)
        velocity = velocity + speed * np.cos(harmonic * rate * time + phase)
    return position, velocity


def _coloured(rng, count, size, correlation):
    """Unit-variance first-order autoregression with that correlation time in samples, (B, N)."""
    keep = np.exp(-1 / correlation)
    white = rng.normal(size=(size, count)) * np.sqrt(1 - keep**2)
    state, rows = rng.normal(size=count), []
    for row in white:
        state = keep * state + row
        rows.append(state)
    return np.stack(rows, axis=1)


@eqx.filter_jit
def _run(structure, names, values, reference, resolution):
    def one(values, reference, resolution):
        model = jf.models.from_parameters(structure, dict(zip(names, values, strict=True)))
        mass = values[0]
        loop = jf.PD(kp=mass * 60.0**2, kd=mass * 120.0)
        encoder = None if resolution is None else jf.Encoder(resolution)
        return jf.simulate(model, reference, loop, encoder=encoder, substeps=2)

    return jax.vmap(one)(values, reference, resolution)


def fleet(
    count,
    seed,
    model="coulomb-viscous",
    rate=1000.0,
    counts=1e5,
    load=0.02,
    noise=0.02,
    centred=True,
):
    """Machines with an encoder of `counts` over the travel (`None`: ideal), a slow load and white
    force noise (shares of the Coulomb friction), in units from µN, µm and ms to kN, km and ks.
    """  # fmt: skip
    rng = np.random.default_rng(seed)
    size = round(PERIOD * rate)
    time = np.arange(2 * size + 1) / rate
    truth = _draw(rng, count, model)
    position, velocity = _motion(rng, count, time)
    coulomb = 0.5 * (truth["coulomb+"] + truth["coulomb-"])
    push = load * coulomb[:, None] * _coloured(rng, count, time.size, 0.05 * rate)
    structure = jf.models.named(model) + Disturbance()
    names = [p.name for p in (*structure.affine, *structure.nonlinear)]
    values = np.stack([{"disturbance": np.ones(count), **truth}[n] for n in names], 1)
    channels = {"reference": position, "reference_velocity": velocity, "disturbance": push}
    whole = jax.vmap(lambda t, x, c: jf.Recording(t, jnp.zeros_like(t), x, channels=c))(
        *jax.tree.map(jnp.asarray, (np.tile(time, (count, 1)), position, channels))
    )
    resolution = None if counts is None else jnp.asarray(np.ptp(position, axis=1) / counts)
    log = _run(structure, tuple(names), jnp.asarray(values), whole, resolution)
    force = np.asarray(log.force)
    # The force is held from its sample to the next: the mean of both neighbours is centred.
    force = 0.5 * (force[:, size:] + force[:, size - 1 : -1]) if centred else force[:, size:]
    force = force + noise * coulomb[:, None] * rng.normal(size=force.shape)
    last = jax.tree.map(lambda x: x[:, size:], log)
    last = dataclasses.replace(last, force=jnp.asarray(force), channels={})
    return _in_other_units(rng, count, Fleet(last, truth))


def _in_other_units(rng, count, machines):
    log, truth = machines
    f, x = 10 ** rng.uniform(-6, 3, count), 10 ** rng.uniform(-6, 3, count)
    t = 10 ** rng.uniform(-3, 3, count)
    factors = {"coulomb": f, "stribeck_force": f, "viscous": f * t / x}
    factors |= {"stribeck_velocity": x / t, "inertia": f * t**2 / x}
    scaled = dataclasses.replace(
        log,
        time=log.time * t[:, None],
        force=log.force * f[:, None],
        position=log.position * x[:, None],
        velocity=None if log.velocity is None else log.velocity * (x / t)[:, None],
    )
    return Fleet(scaled, {k: v * factors[k.rstrip("+-")] for k, v in truth.items()})


def relative_error(
    model: jf.Model, recording: jf.Recording, half_width: int | None = None
) -> jax.Array:
    """norm(u − û)/norm(u) of a model on a recording, both passed through the same kernel.

    The measure of the EMPS benchmark (Janot, Gautier & Brunot 2019), over everything but rest.
    `half_width` of the kernel in samples; by default that of [`signals.kernel_half_width`][].
    """
    model, delay = at_once(model)
    if model.force_limit is not None:
        recording = dataclasses.replace(recording, force=model.arriving(recording.force))
    prepared = with_channels(model, signals.prepare(recording))
    if delay is not None:
        prepared = dataclasses.replace(prepared, force=later(prepared, prepared.force, -delay))
    width = half_width or signals.kernel_half_width(prepared)
    return _relative_error(model, prepared, width)


@eqx.filter_jit
def _relative_error(model, recording, width):
    rows = WeakForm(width).rows(recording, signals.scales(recording))
    left = rows.target - weighed(rows.columns(model.term, recording), model.alpha)
    return rows.relative(left - rows.offset(model.term, recording))
