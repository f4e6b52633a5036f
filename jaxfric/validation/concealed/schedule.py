"""Concealed effects that come with time: drift, a step, tones, pushes and another axis.

Held-out runs keep their own clock: what is tied to it (a drift, a step, a tone) comes again at
the same time after the start; pushes do not.
"""

import numpy as np
from numpy.polynomial import legendre

from . import motions
from .nominal import TURN, Columns, Kind, no_physics, rms, scaled


def _length(n):
    return float(n.time[-1] - n.time[0])


def _thermal_factor(truth, time):
    return truth["amount"] * np.exp(-time / truth["time_constant"])


def _thermal_force(truth, n):
    law = n.v if truth["law"] == "viscous" else n.way
    return _thermal_factor(truth, n.time) * law


def _draw_thermal(rng, n, size):
    truth = {"law": ("viscous", "coulomb")[rng.integers(2)]}
    truth["time_constant"] = rng.uniform(0.15, 0.8) * _length(n)
    truth = scaled(THERMAL, "amount", truth, n, size)
    return truth | {f"thermal_{truth['law']}": truth["amount"]}


THERMAL: Kind = Kind(
    _draw_thermal,
    _thermal_force,
    no_physics,
    lambda truth: f"{truth['law']} friction over time, constant {truth['time_constant']:.3g} s",
    planted=True,
    over=lambda truth, n, run: Columns(**{truth["law"]: _thermal_factor(truth, n.time)}),
)


def _draw_step(rng, n, size):
    truth = {"step_time": rng.uniform(0.25, 0.75) * _length(n)}
    truth = scaled(STEP, "step_coulomb", truth, n, size)
    # Less friction can be no less than a third of what there was.
    sign = -1 if rng.random() < 0.4 and truth["step_coulomb"] < 0.6 * n.coulomb else 1
    return {**truth, "step_coulomb": sign * truth["step_coulomb"]}


STEP: Kind = Kind(
    _draw_step,
    lambda truth, n: truth["step_coulomb"] * n.way * (n.time > truth["step_time"]),
    no_physics,
    lambda truth: f"friction from {truth['step_time']:.4g} s on",
    planted=True,
    over=lambda truth, n, run: Columns(
        coulomb=truth["step_coulomb"] * (n.time > truth["step_time"])
    ),
)


def _draw_drift(rng, n, size):
    degree = int(rng.integers(1, 4))
    raw = rng.normal(size=degree)
    truth = {"duration": _length(n), "polynomials": raw.tolist()}
    scale = size * n.coulomb / rms(_drift(truth, n))
    truth["polynomials"] = (scale * raw).tolist()
    return truth | {f"load_drift_{i + 1}": float(scale * r) for i, r in enumerate(raw)}


def _drift(truth, n):
    tau = np.clip(2 * n.time / truth["duration"] - 1, -1, 1)
    return legendre.legval(tau, [0.0, *truth["polynomials"]])


DRIFT: Kind = Kind(
    _draw_drift,
    _drift,
    no_physics,
    lambda truth: "time, slowly",
    planted=True,
    over=lambda truth, n, run: Columns(_drift(truth, n)),
)


def _draw_tone(rng, n, size):
    low = max(0.4 / n.plan.period, 3 / _length(n))
    high = max(min(15 / n.plan.period, 0.02 * n.plan.sample_rate), 2 * low)
    truth = {"frequency": float(np.exp(rng.uniform(np.log(low), np.log(high))))}
    truth["phase"] = float(rng.uniform(0, TURN))
    return scaled(TONE, "amplitude", truth, n, size)


def _tone(truth, n):
    return truth["amplitude"] * np.sin(TURN * truth["frequency"] * n.time + truth["phase"])


TONE: Kind = Kind(
    _draw_tone,
    _tone,
    no_physics,
    lambda truth: f"time, {truth['frequency']:.4g} Hz",
    planted=True,
    over=lambda truth, n, run: Columns(_tone(truth, n)),
)


def _draw_pulses(rng, n, size):
    count = int(rng.integers(3, 9))
    width = max(rng.uniform(0.05, 0.25) * n.plan.period, 8 / n.plan.sample_rate)
    truth = {
        "width": width,
        "shares": (rng.choice([-1, 1], count) * rng.uniform(0.6, 1, count)).tolist(),
    }
    for run in ("times", "times_holdout"):
        places = (np.arange(count) + rng.uniform(0.15, 0.85, count)) / count
        truth[run] = (places * _length(n)).tolist()
    truth = scaled(PULSES, "amplitude", truth, n, size, 3 * n.coulomb)
    return truth | {"amplitudes": [truth["amplitude"] * s for s in truth["shares"]]}


def _pulses(truth, n, times="times"):
    total = np.zeros_like(n.time)
    for at, share in zip(truth[times], truth["shares"], strict=True):
        place = np.clip((n.time - at) / truth["width"], -1, 1)
        total += truth["amplitude"] * share * np.cos(0.5 * np.pi * place) ** 2
    return total


PULSES: Kind = Kind(
    _draw_pulses,
    _pulses,
    no_physics,
    lambda truth: f"time, {len(truth['times'])} isolated pushes",
    planted=True,
    over=lambda truth, n, run: Columns(_pulses(truth, n, ("times", "times_holdout")[run])),
    unrepeated=True,
)


def neighbour(truth, plan, run, time):
    """Velocity and acceleration of the other axis in a run, m/s and m/s², `(N,)`."""
    interval = 1 / plan.sample_rate
    seed = (truth["seed"], 4, run)
    _, v = motions.motion(truth["kind"], seed, interval, plan.samples, 1.3 * plan.period)
    even = np.arange(plan.samples) * interval
    v = np.interp(time, even, plan.stroke * v)
    return v, np.gradient(v, time)


def _draw_cross(rng, n, size):
    truth = {"seed": int(rng.integers(2**31)), "kind": ("multisine", "chirp")[rng.integers(2)]}
    v, a = neighbour(truth, n.plan, 0, n.time)
    lean = rng.uniform(0, np.pi / 2)
    inertia, viscous = np.cos(lean) / rms(a), np.sin(lean) / rms(v)
    scale = size * n.coulomb / rms(inertia * a + viscous * v)
    return truth | {"coupling_inertia": scale * inertia, "coupling_viscous": scale * viscous}


def _cross(truth, n, run=0):
    v, a = neighbour(truth, n.plan, run, n.time)
    return truth["coupling_inertia"] * a + truth["coupling_viscous"] * v


def _recorded(truth, plan, run, clock):
    return {"neighbour_velocity": neighbour(truth, plan, run, clock)[0]}


CROSS: Kind = Kind(
    _draw_cross,
    _cross,
    no_physics,
    lambda truth: "the other axis' motion",
    over=lambda truth, n, run: Columns(_cross(truth, n, run)),
    channels=_recorded,
)


KINDS = {
    "thermal_drift": THERMAL,
    "friction_step": STEP,
    "load_drift": DRIFT,
    "periodic_disturbance": TONE,
    "disturbance_pulses": PULSES,
    "cross_axis": CROSS,
}
