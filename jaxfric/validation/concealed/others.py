"""Effects of the simulator's own, each once more by another definition of the same physics."""

from collections.abc import Callable

import numpy as np

from . import curves, memories
from .machines import log_uniform
from .nominal import TURN, Columns, Kind, Truth, no_physics, scaled, solved
from .variants import CLIP, LUGRE, MAXWELL, TANH


def with_form(kind: Kind, name: str, value: str, attempts: int = 200) -> Kind:
    """A kind whose draw has forms to choose from: one of them."""

    def draw(rng, n, size):
        found = (kind.draw(rng, n, size) for _ in range(attempts))
        return next(truth for truth in found if truth[name] == value)

    return kind._replace(draw=draw)


def with_physics(kind: Kind, more: Callable[[Truth], dict[str, float]]) -> Kind:
    """A kind whose simulator has further parameters."""
    return kind._replace(physics=lambda truth, base: kind.physics(truth, base) | more(truth))


def with_draw(kind: Kind, draw: Callable[[np.random.Generator], Truth]) -> Kind:
    """A kind that is solved for its tuned parameter, with other values of the rest."""
    return kind._replace(
        draw=lambda rng, n, size: solved(kind, kind.draw(rng, n, size) | draw(rng), n, size)
    )


# Actuator: a hard limit cuts off a part of the peak force, a soft one has the peak at a part of it.


def _peak(n):
    return float(np.max(np.abs(n.u)))


def _clipped(truth, n):
    knee = _peak(n) * (1 - truth["cut"])
    return np.sign(n.u) * np.maximum(np.abs(n.u) - knee, 0.0)


def _bent(truth, n):
    knee = _peak(n) / truth["use"]
    return knee * np.arctanh(n.u / knee) - n.u


def _limit(shape: float, tuned: str, force, name: str, knee, bounds) -> Kind:
    kind = memories.SATURATION._replace(
        force=force,
        physics=lambda truth, base: {"knee": truth[name], "saturation_shape": shape},
        where=lambda truth: f"force beyond {truth[name]:.3g}",
        tuned=tuned,
        bounds=lambda n: bounds,
        complete=lambda truth, n: truth | {name: knee(truth[tuned], _peak(n))},
    )
    return kind._replace(draw=lambda rng, n, size: solved(kind, {}, n, size))


CLIPPED = _limit(CLIP, "cut", _clipped, "knee", lambda cut, peak: peak * (1 - cut), (0.01, 0.6))
# The level that a tanh never reaches is no knee.
BENT = _limit(TANH, "use", _bent, "level", lambda use, peak: peak / use, (0.05, 0.98))
SMOOTH_GAP = with_physics(memories.DEADBAND, lambda truth: {"deadband_shape": TANH})
TWO_STAGES = memories.LAG._replace(
    physics=lambda truth, base: {"lag": 0.5 * truth["lag"], "lag_stages": 2.0}
)

# Outside the loop: the logger's position is old, or filtered, and the axis feels nothing of it.


def _old(truth, clock, signal):
    return np.interp(clock - truth["delay"], clock, signal)


def low_pass(signal: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """A first-order filter that takes up such a share of the difference at each sample."""
    found, last = np.empty_like(signal), float(signal[0])
    for i, (value, share) in enumerate(zip(signal.tolist(), shares.tolist(), strict=True)):
        last += share * (value - last)
        found[i] = last
    return found


def _filtered(truth, clock, signal):
    steps = np.diff(clock, prepend=clock[0] - (clock[1] - clock[0]))
    return low_pass(signal, 1 - np.exp(-steps / truth["lag"]))


TIMESTAMP = memories.DELAY._replace(physics=no_physics, logged=_old)
LOGGED_LAG = memories.LAG._replace(physics=no_physics, logged=_filtered)


def _recorded(late: Kind, after) -> Kind:
    """Of a force that acts late: the logger's force is that late instead."""
    return late._replace(
        force=lambda truth, n: -late.force(truth, n), physics=no_physics, recorded=after
    )


KINDS = {
    "clock": _recorded(memories.DELAY, _old),
    "sensor_filter": _recorded(memories.LAG, _filtered),
}

# Friction

_LUGRE = with_physics(
    memories.PRESLIDING,
    lambda t: {"presliding_shape": LUGRE, "bristle_damping": t["bristle_damping"]},
)
BRISTLES = with_draw(_LUGRE, lambda rng: {"bristle_damping": float(rng.uniform(0.3, 1.0))})
SLIPS = with_physics(memories.PRESLIDING, lambda truth: {"presliding_shape": MAXWELL})


def _reaction(truth, n):
    return truth["reaction_friction"] * n.mass * np.abs(n.a) * n.way


REACTION: Kind = curves.LOADED._replace(
    draw=lambda rng, n, size: scaled(REACTION, "reaction_friction", {}, n, size, 0.5),
    force=_reaction,
    physics=lambda truth, base: {"reaction_friction": truth["reaction_friction"]},
    where=lambda truth: "force of inertia by direction",
)


def _draw_normal(rng, n, size):
    length = float(n.time[-1] - n.time[0])
    truth = {"mean": 10 * n.coulomb, "period": length / rng.uniform(1.5, 6)}
    truth["phase"] = float(rng.uniform(0, TURN))
    return scaled(NORMAL, "load_friction", truth, n, size, 0.3)


def _normal(truth, time):
    """The load on the guide, N: never less than a tenth of its mean."""
    return truth["mean"] * (1 + 0.9 * np.sin(TURN * time / truth["period"] + truth["phase"]))


NORMAL: Kind = Kind(
    _draw_normal,
    lambda truth, n: truth["load_friction"] * _normal(truth, n.time) * n.way,
    no_physics,
    lambda truth: "the recorded load by direction",
    over=lambda truth, n, run: Columns(coulomb=truth["load_friction"] * _normal(truth, n.time)),
    channels=lambda truth, plan, run, clock: {"load": _normal(truth, clock)},
)
STRETCHED: Kind = curves.STRIBECK._replace(
    draw=lambda rng, n, size: scaled(
        STRETCHED, "stribeck_force",
        {"shape": "stretched", "stribeck_velocity": log_uniform(rng, 0.03, 0.15) * n.top},
        n, size, 0.8 * n.coulomb,
    ),
    force=lambda truth, n: (
        truth["stribeck_force"] * n.way * np.exp(-np.sqrt(np.abs(n.v) / truth["stribeck_velocity"]))
    ),
    physics=lambda truth, base: (
        curves.STRIBECK.physics(truth | {"shape": "gaussian"}, base) | {"bump_shape": 3.0}
    ),
)  # fmt: skip

# Two bodies

DRY_GAP = with_draw(
    memories.BACKLASH, lambda rng: {"load_friction_share": float(rng.uniform(0.85, 0.97))}
)
FREE_GAP = with_draw(
    memories.BACKLASH, lambda rng: {"load_friction_share": float(rng.uniform(0.03, 0.15))}
)
PLAY = memories.BACKLASH._replace(
    physics=lambda truth, base: {
        "play": truth["half_gap"],
        "play_share": truth["load_share"],
        "play_friction_share": truth["load_friction_share"],
    }
)
DRY_SPRING = with_draw(
    memories.COMPLIANCE, lambda rng: {"load_friction_share": float(rng.uniform(0.7, 0.95))}
)
RUBBER = with_draw(
    memories.COMPLIANCE, lambda rng: {"joint_damping_ratio": float(rng.uniform(0.4, 0.8))}
)
