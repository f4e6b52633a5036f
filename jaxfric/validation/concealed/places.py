"""Concealed forces that depend on where the axis is."""

import numpy as np

from .machines import log_uniform
from .nominal import TURN, Kind, Truth, named, rms, scaled


def _at(n, share):
    """The place below which the motion spends that share of the time, m."""
    return float(np.quantile(n.x, share))


# Functions of position


def _phase(rng):
    return float(rng.uniform(0, TURN))


def _draw_unbalance(rng, n, size):
    truth = {"unbalance_period": rng.uniform(1.0, 2.5) * n.plan.stroke, "phase": _phase(rng)}
    return scaled(UNBALANCE, "amplitude", truth, n, size)


def _wave(period):
    return lambda truth, n: truth["amplitude"] * np.sin(TURN * n.x / truth[period] + truth["phase"])


UNBALANCE: Kind = Kind(
    _draw_unbalance,
    _wave("unbalance_period"),
    named(unbalance="amplitude", unbalance_period="unbalance_period", unbalance_phase="phase"),
    lambda truth: f"position, one turn in {truth['unbalance_period']:.4g}",
    centred=True,
    planted=True,
)


def _draw_cogging(rng, n, size):
    # At the top speed six samples a period, so that the log can hold it.
    most = max(n.plan.stroke / (6 * n.top / n.plan.sample_rate), 6.0)
    truth: Truth = {"pitch": n.plan.stroke / log_uniform(rng, 3, min(60, most))}
    relative = (1.0, rng.uniform(0.2, 0.6), rng.uniform(0.1, 0.4))[: rng.integers(1, 4)]
    truth["phases"] = [_phase(rng) for _ in relative]
    unit = rms(_cogging_force({**truth, "amplitudes": relative}, n))
    amplitudes = [size * n.coulomb / unit * share for share in relative]
    return {**truth, "amplitudes": amplitudes, "amplitude": amplitudes[0]}


def _cogging_force(truth, n):
    parts = zip(truth["amplitudes"], truth["phases"], strict=True)
    angle = TURN * n.x / truth["pitch"]
    return sum(A * np.sin((i + 1) * angle + phase) for i, (A, phase) in enumerate(parts))


def _cogging(truth, base):
    found = {"pitch": truth["pitch"]}
    for i, A in enumerate(truth["amplitudes"]):
        found |= {f"cogging{i + 1}": A, f"cogging_phase{i + 1}": truth["phases"][i]}
    return found


COGGING: Kind = Kind(
    _draw_cogging,
    _cogging_force,
    _cogging,
    lambda t: f"position, pitch {t['pitch']:.4g}",
    planted=True,
)


def _draw_spring(rng, n, size):
    truth = {"rest": _at(n, rng.uniform(0.3, 0.7))}
    return scaled(SPRING, "stiffness", truth, n, size)


SPRING: Kind = Kind(
    _draw_spring,
    lambda truth, n: truth["stiffness"] * (n.x - truth["rest"]),
    named(spring="stiffness", spring_rest="rest"),
    lambda truth: "position, over the whole stroke",
    centred=True,
    planted=True,
)


def _draw_hardening(rng, n, size):
    truth = {"spring_centre": n.plan.low + rng.uniform(0.35, 0.65) * n.plan.stroke}
    return scaled(HARDENING, "cubic_stiffness", truth, n, size)


HARDENING: Kind = Kind(
    _draw_hardening,
    lambda truth, n: truth["cubic_stiffness"] * (n.x - truth["spring_centre"]) ** 3,
    named(cubic="cubic_stiffness", cubic_centre="spring_centre"),
    lambda truth: "position, near both ends of the stroke",
    centred=True,
    planted=True,
)


def _draw_stop(rng, n, size):
    upper, share = bool(rng.random() < 0.5), rng.uniform(0.04, 0.12)
    edge, place = (n.x.max(), _at(n, 1 - share)) if upper else (n.x.min(), _at(n, share))
    truth = _placed({"side": "upper" if upper else "lower", "depth": float(abs(edge - place))}, n)
    stiffness = "stop_stiffness" if upper else "lower_stop_stiffness"
    truth = scaled(STOP, stiffness, truth, n, size)
    # The stop pushes the axis back by k/(k + kp) of the way that the set-point goes into it.
    asked, loop = truth[stiffness], n.physics["kp"]
    truth[stiffness] = asked * loop / max(loop - asked, 0.3 * loop)
    return truth


def _placed(truth, n):
    """The stop is where the set-point goes into it as deep as that."""
    if truth["side"] == "upper":
        return {**truth, "stop_position": float(n.x.max()) - truth["depth"]}
    return {**truth, "lower_stop_position": float(n.x.min()) + truth["depth"]}


def _stop_force(truth, n):
    if truth["side"] == "upper":
        return truth["stop_stiffness"] * np.maximum(n.x - truth["stop_position"], 0.0)
    return truth["lower_stop_stiffness"] * np.minimum(n.x - truth["lower_stop_position"], 0.0)


def _stop(truth, base):
    if truth["side"] == "upper":
        return {"upper_stop": truth["stop_stiffness"], "upper_stop_at": truth["stop_position"]}
    where = truth["lower_stop_position"]
    return {"lower_stop": truth["lower_stop_stiffness"], "lower_stop_at": where}


STOP: Kind = Kind(
    _draw_stop,
    _stop_force,
    _stop,
    lambda truth: f"the {truth['side']} end of the stroke",
    # An axis that stays behind its set-point may not reach the stop.
    tuned="depth",
    bounds=lambda n: (2e-3 * n.plan.stroke, 0.45 * n.plan.stroke),
    complete=_placed,
    planted=True,
)


# Friction of position


def _draw_wavy(rng, n, size):
    truth = {"friction_period": n.plan.stroke / log_uniform(rng, 0.5, 15), "phase": _phase(rng)}
    return scaled(WAVY, "amplitude", truth, n, size, 0.7 * n.coulomb)


WAVY: Kind = Kind(
    _draw_wavy,
    lambda truth, n: n.way * _wave("friction_period")(truth, n),
    named(
        wavy_friction="amplitude",
        wavy_friction_period="friction_period",
        wavy_friction_phase="phase",
    ),
    lambda truth: f"position by direction, period {truth['friction_period']:.4g}",
    planted=True,
)


def _draw_spot(rng, n, size):
    place = n.plan.low + rng.uniform(0.25, 0.75) * n.plan.stroke
    truth = {"spot_position": place, "spot_width": rng.uniform(0.01, 0.05) * n.plan.stroke}
    truth = scaled(SPOT, "spot_force", truth, n, size)
    # A strong spot is a wide one: at more than the Coulomb level the axis would rather hop.
    for _ in range(4):
        if truth["spot_force"] > n.coulomb:
            truth["spot_width"] *= 1.4
            truth = scaled(SPOT, "spot_force", truth, n, size, 1.5 * n.coulomb)
    return truth


SPOT: Kind = Kind(
    _draw_spot,
    lambda truth, n: (
        truth["spot_force"]
        * n.way
        * np.exp(-0.5 * ((n.x - truth["spot_position"]) / truth["spot_width"]) ** 2)
    ),
    named(spot="spot_force", spot_at="spot_position", spot_width="spot_width"),
    lambda truth: f"position by direction, at {truth['spot_position']:.4g}",
    planted=True,
)


# Inertia of position, friction of load and of acceleration


def _draw_inertia(rng, n, size):
    truth = {"inertia_period": n.plan.stroke / log_uniform(rng, 0.5, 4), "phase": _phase(rng)}
    return scaled(INERTIA, "amplitude", truth, n, size, 0.6 * n.mass)


def _inertia_force(truth, n):
    rate = TURN / truth["inertia_period"]
    angle = rate * n.x + truth["phase"]
    return truth["amplitude"] * (n.a * np.sin(angle) + 0.5 * rate * n.v**2 * np.cos(angle))


INERTIA: Kind = Kind(
    _draw_inertia,
    _inertia_force,
    named(wavy_mass="amplitude", wavy_mass_period="inertia_period", wavy_mass_phase="phase"),
    lambda truth: f"position by acceleration, period {truth['inertia_period']:.4g}",
    loud=True,
    planted=True,
)


# The motor's force by position


def _draw_fall(rng, n, size):
    best = n.plan.low + rng.uniform(0.1, 0.9) * n.plan.stroke
    truth = {"fall_from": best, "fall_distance": float(np.max(np.abs(n.x - best)))}
    return scaled(FALL, "fall", truth, n, size, 0.5)


FALL: Kind = Kind(
    _draw_fall,
    # To first order: the command is 1/(1 − c) of the force.
    lambda t, n: t["fall"] * ((n.x - t["fall_from"]) / t["fall_distance"]) ** 2 * n.u,
    named(fall="fall", fall_from="fall_from", fall_distance="fall_distance"),
    lambda truth: f"position by force, farthest from {truth['fall_from']:.4g}",
    loud=True,
    follows=False,
)


KINDS = {
    "gravity_unbalance": UNBALANCE,
    "cogging": COGGING,
    "spring": SPRING,
    "hardening_spring": HARDENING,
    "end_stop": STOP,
    "position_dependent_friction": WAVY,
    "sticky_spot": SPOT,
    "position_dependent_inertia": INERTIA,
    "position_dependent_force_constant": FALL,
}
