"""A machine with all that is drawn of it, and the drawing of what is healthy about it."""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from . import motions

# Fastest and slowest change of the world inside a run: at least so many substeps a second.
SUBSTEP_RATE = 20_000.0


class Plan(NamedTuple):
    """How a machine is recorded.

    `kinds`: of the identification's and the held-out motion; `sample_rate` Hz; `samples` of each;
    `periods` s, one way there and back of each motion; `low` and `stroke` m, what the set-point
    visits; `fewest` integration steps a sample, if more than usual.
    """

    kinds: tuple[str, str]
    sample_rate: float
    samples: int
    periods: tuple[float, float]
    low: float
    stroke: float
    fewest: int = 1

    @property
    def period(self) -> float:
        """Of the identification's motion, s."""
        return self.periods[0]

    @property
    def substeps(self) -> int:
        """Integration steps a sample."""
        return max(4, self.fewest, int(np.ceil(SUBSTEP_RATE / self.sample_rate)))


class Noise(NamedTuple):
    """What blurs a recording.

    `force` N, standard deviation of the measured force; `process` N and `correlation` s of a
    load that nobody records; `encoder` m, before it counts; `jitter` of the clock in samples.
    """

    force: float
    process: float
    correlation: float
    encoder: float
    jitter: float


@dataclasses.dataclass(frozen=True)
class Machine:
    """One axis with its loop, its run and what is concealed in it; all in SI units.

    - `seed`, `effects`: what [`draw`][jaxfric.validation.concealed.draw] was asked for.
    - `baseline`: name of the model that is right for it but for the effects.
    - `coulomb`: the Coulomb level that sizes refer to, N.
    - `physics`: the simulator's parameters, by the names of `concealed.physics.ABSENT`.
    - `plan`, `noise`: how it is recorded.
    - `truth`: for each effect its parameters, `size` (root mean square of its force over the
      set-point's motion in parts of `coulomb`), `where` it acts, a sentence, and the
      `definition` of the physics that made it.
    - `definitions`: how it sticks and is logged, where that is not the usual.
    """

    seed: int
    effects: tuple[str, ...]
    baseline: str
    coulomb: float
    physics: Mapping[str, float]
    plan: Plan
    noise: Noise
    truth: Mapping[str, Mapping[str, Any]]
    definitions: Mapping[str, str] = dataclasses.field(default_factory=dict)


SHAPES = ("gaussian", "lorentzian", "exponential")


def log_uniform(rng: Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_plan(rng: Generator, seed: int) -> Plan:
    """Sample rate 200 Hz to 10 kHz, 6 to 60 s, 20 to 100 reversals, stroke 1 mm to 30 m (rad)."""
    rate = log_uniform(rng, 200.0, 10_000.0)
    duration = min(max(log_uniform(rng, 4000, 60_000) / rate, 6.0), 60.0)
    count = int(min(max(np.ceil(duration * rate), 4000), 60_000))
    # 240 samples a period leave room between the motion and the sampling for the loop.
    period = max(2 * count / rate / log_uniform(rng, 20, 100), 240 / rate, 0.06)
    names = sorted(motions.KINDS)
    first = names[rng.integers(len(names))]
    second = names[rng.integers(len(names))] if rng.random() < 0.5 else first
    stroke = log_uniform(rng, 1e-3, 30.0)
    low = stroke * rng.uniform(-1, 0.5)
    return _alike(Plan((first, second), rate, count, (period, period), low, stroke), seed)


def _alike(plan: Plan, seed: int) -> Plan:
    """The held-out motion slower or faster, so that both accelerate about as hard."""
    first, second = (
        float(np.quantile(np.abs(np.diff(reference(plan, seed, run)[1])), 0.9)) for run in (0, 1)
    )
    # A loop that follows a motion also follows one a quarter faster.
    ratio = min(max(np.sqrt(second / first), 0.75), 1.5)
    return plan._replace(periods=(plan.period, float(ratio * plan.period)))


def reference(plan: Plan, seed: int, run: int):
    """Set-point of run 0 (identification) or 1 (held out): position m, velocity m/s, `(count,)`."""
    x, v = motions.motion(
        plan.kinds[run], (seed, 3, run), 1 / plan.sample_rate, plan.samples, plan.periods[run]
    )
    return plan.low + plan.stroke * x, plan.stroke * v


def draw_friction(rng: Generator, coulomb: float, top: float, shape: str | None):
    """Friction of both directions about a Coulomb level, N, for a top speed, m/s."""
    skew = rng.uniform(-0.25, 0.25)
    viscous = log_uniform(rng, 0.1, 1.5) * coulomb / top
    bump, width = rng.uniform(0.1, 0.6) * coulomb, log_uniform(rng, 0.01, 0.15) * top
    found = {"offset": rng.uniform(-0.3, 0.3) * coulomb if rng.random() < 0.4 else 0.0}
    for sign, way in (("+", 1), ("-", -1)):
        found |= {
            f"coulomb{sign}": coulomb * (1 + way * skew),
            f"viscous{sign}": viscous * rng.uniform(0.7, 1.4),
            f"bump{sign}": bump * rng.uniform(0.8, 1.25) if shape else 0.0,
            f"bump_speed{sign}": width * rng.uniform(0.8, 1.25),
        }
    return found | {"bump_shape": float(SHAPES.index(shape)) if shape else 0.0}


def tied(friction: Mapping[str, float]) -> dict[str, float]:
    """The same friction with both directions alike."""
    alike = dict(friction)
    for name in ("coulomb", "viscous", "bump", "bump_speed"):
        alike[f"{name}+"] = alike[f"{name}-"] = 0.5 * (friction[f"{name}+"] + friction[f"{name}-"])
    return alike


def draw_band(rng: Generator, plan: Plan, slowest: bool) -> float:
    """Bandwidth of the position loop, rad/s.

    It is 6 to 30 times the motion's frequency (8 if `slowest`) and below a fortieth of the sample
    rate, where sampling and the velocity filter leave about 45° of phase.
    """
    band = log_uniform(rng, 6.0, 8.0 if slowest else 30.0) / plan.period
    return 2 * np.pi * min(band, plan.sample_rate / 40)


def draw_loop(rng: Generator, mass: float, coulomb: float, omega: float, plan: Plan):
    """Gains, encoder and the encoder's noise.

    The encoder is as coarse as makes the command rattle by 0.1 to 3 % of Coulomb friction.
    """
    interval = 1 / plan.sample_rate
    kd = 2 * rng.uniform(0.8, 1.1) * mass * omega
    share = interval / (interval + 0.1 / omega)
    integral = rng.uniform(0.03, 0.2) * mass * omega**3 if rng.random() < 0.5 else 0.0
    rattle = log_uniform(rng, 1e-3, 3e-2) * coulomb
    # Differenced white noise through the filter: standard deviation √(2/(2 − α)) α/T.
    blur = rattle * interval / (kd * share * np.sqrt(2 / (2 - share)))
    noise = rng.uniform(0.0, 0.5)  # in counts
    count = min(max(blur / np.sqrt(1 / 12 + noise**2), 1e-7 * plan.stroke), 3e-4 * plan.stroke)
    gains = {"kp": mass * omega**2, "ki": integral, "kd": kd, "velocity_filter": share}
    return gains | {"resolution": float(count)}, float(noise * count)


def draw_noise(rng: Generator, coulomb: float, encoder: float) -> Noise:
    """Measured force 0.3–3 %, unrecorded load 0.2–0.8 % of Coulomb, clock up to 1 % of a sample."""
    jitter = log_uniform(rng, 1e-4, 1e-2) if rng.random() < 0.5 else 0.0
    return Noise(
        force=log_uniform(rng, 0.003, 0.03) * coulomb,
        process=log_uniform(rng, 0.002, 0.008) * coulomb,
        correlation=log_uniform(rng, 2e-3, 0.2),
        encoder=encoder,
        jitter=jitter,
    )
