"""Cogging, and effects that come with time, by further definitions of the same physics."""

from collections.abc import Callable

import numpy as np

from . import places, schedule
from .nominal import TURN, Columns, Kind, Truth, rms, scaled

# Cogging


def _triangular(truth, n):
    return truth["peak"] * 2 / np.pi * np.arcsin(
        np.sin(TURN * n.x / truth["pitch"] + truth["phases"][0])
    )  # fmt: skip


def _two(truth, n):
    angle = TURN * n.x / truth["pitch2"] + truth["phase2"]
    return places.COGGING.force(truth, n) + truth["second"] * np.sin(angle)


def _rippling(truth, n):
    return truth["ripple"] * np.sin(TURN * n.x / truth["pitch"] + truth["phases"][0]) * n.u


def _redrawn(kind: Kind, name: str, more) -> Kind:
    """Cogging at the usual pitch, of another shape, in proportion to the parameter named."""

    def draw(rng, n, size):
        usual = places.COGGING.draw(rng, n, size)
        kept = {"pitch": usual["pitch"], "phases": usual["phases"][:1]}
        return scaled(kind, name, kept | more(rng, kept), n, size)

    return kind._replace(draw=draw)


TRIANGLE = _redrawn(
    places.COGGING._replace(
        force=_triangular,
        physics=lambda truth, base: {
            "pitch": truth["pitch"], "triangle": truth["peak"],
            "cogging_phase1": truth["phases"][0],
        },
    ),
    "peak",
    lambda rng, kept: {},
)  # fmt: skip
RIPPLE = _redrawn(
    places.COGGING._replace(
        force=_rippling,
        physics=lambda truth, base: {
            "ripple": truth["ripple"], "pitch2": truth["pitch"],
            "cogging2_phase": truth["phases"][0],
        },
        follows=False,
        planted=False,
    ),
    "ripple",
    lambda rng, kept: {},
)  # fmt: skip


def _draw_two(rng, n, size):
    """The commutation's pitch is no multiple or part of that of the slots."""
    truth = places.COGGING.draw(rng, n, size)
    truth |= {"pitch2": truth["pitch"] * rng.uniform(1.2, 1.8), "phase2": rng.uniform(0, TURN)}
    truth["second"] = rng.uniform(0.5, 1.0) * truth["amplitude"]
    shrink = size * n.coulomb / rms(_two(truth, n))
    truth["amplitudes"] = [shrink * each for each in truth["amplitudes"]]
    return truth | {name: shrink * truth[name] for name in ("amplitude", "second")}


TWO_PITCHES = places.COGGING._replace(
    draw=_draw_two,
    force=_two,
    physics=lambda truth, base: places.COGGING.physics(truth, base) | {
        "second": truth["second"], "pitch2": truth["pitch2"], "cogging2_phase": truth["phase2"],
    },
)  # fmt: skip

# Of time


def _thermal(factor: Callable[[Truth, np.ndarray], np.ndarray], draw) -> Kind:
    kind = schedule.THERMAL._replace(
        force=lambda truth, n: (
            factor(truth, n.time) * (n.v if truth["law"] == "viscous" else n.way)
        ),
        over=lambda truth, n, run: Columns(**{truth["law"]: factor(truth, n.time)}),
    )

    def drawn(rng, n, size):
        truth = {"law": ("viscous", "coulomb")[rng.integers(2)], **draw(rng, n)}
        return scaled(kind, "amount", truth, n, size)

    return kind._replace(draw=drawn)


def _spent(rng, n):
    """The part of the work that friction has taken up at 33 moments of the run."""
    friction = np.abs(n.u - n.mass * n.a) * np.abs(n.v)
    work = np.cumsum(friction) / np.sum(friction)
    at = np.linspace(n.time[0], n.time[-1], 33)
    return {"times": at.tolist(), "work": np.interp(at, n.time, work).tolist()}


def _draw_constants(rng, n):
    length = float(n.time[-1] - n.time[0])
    fast, slow = rng.uniform(0.05, 0.15) * length, rng.uniform(0.4, 1.0) * length
    return {"time_constant": fast, "second_constant": slow, "share": rng.uniform(0.3, 0.7)}


WORK = _thermal(
    lambda truth, time: truth["amount"] * (1 - np.interp(time, truth["times"], truth["work"])),
    _spent,
)._replace(where=lambda truth: f"{truth['law']} friction over the work done")
TWO_CONSTANTS = _thermal(
    lambda truth, time: truth["amount"] * (
        truth["share"] * np.exp(-time / truth["time_constant"])
        + (1 - truth["share"]) * np.exp(-time / truth["second_constant"])
    ),
    _draw_constants,
)  # fmt: skip


def _ramp(truth, time):
    return np.clip((time - truth["step_time"]) / truth["step_ramp"] + 0.5, 0.0, 1.0)


def _draw_ramp(rng, n, size):
    truth = schedule.STEP.draw(rng, n, size)
    return truth | {"step_ramp": float(rng.uniform(0.02, 0.08) * (n.time[-1] - n.time[0]))}


RAMP = schedule.STEP._replace(
    draw=_draw_ramp,
    force=lambda truth, n: truth["step_coulomb"] * n.way * _ramp(truth, n.time),
    over=lambda truth, n, run: Columns(coulomb=truth["step_coulomb"] * _ramp(truth, n.time)),
)


def _square(truth, n):
    wave = np.sin(TURN * truth["frequency"] * n.time + truth["phase"])
    return truth["amplitude"] * np.tanh(8 * wave)


SQUARE: Kind = schedule.TONE._replace(
    draw=lambda rng, n, size: scaled(
        SQUARE, "amplitude", schedule.TONE.draw(rng, n, size), n, size
    ),
    force=_square,
    over=lambda truth, n, run: Columns(_square(truth, n)),
)


def _blows(truth, n, times="times"):
    total = np.zeros_like(n.time)
    for at, share in zip(truth[times], truth["shares"], strict=True):
        since = np.maximum(n.time - at, 0.0) / (0.5 * truth["width"])
        total += truth["amplitude"] * share * np.e * since * np.exp(-since)
    return total


BLOWS: Kind = schedule.PULSES._replace(
    draw=lambda rng, n, size: scaled(
        BLOWS, "amplitude", schedule.PULSES.draw(rng, n, size), n, size, 3 * n.coulomb
    ),
    force=_blows,
    over=lambda truth, n, run: Columns(_blows(truth, n, ("times", "times_holdout")[run])),
)
