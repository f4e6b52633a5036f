"""Concealed forces that are functions of position, velocity, or both."""

import numpy as np

from .machines import SHAPES, log_uniform
from .nominal import Kind, Truth, rms, scaled

TURN = 2 * np.pi


def _named(**names):
    """Physics from truth by a table of names, the simulator's on the left."""
    return lambda truth, base: {left: float(truth[right]) for left, right in names.items()}


def _at(n, share):
    """The place below which the motion spends that share of the time, m."""
    return float(np.quantile(n.x, share))


# Friction of velocity


def _draw_asymmetry(rng, n, size):
    truth = {"coulomb_asymmetry": rng.uniform(-1, 1) * size * n.coulomb}
    truth = scaled(ASYMMETRY, "viscous_asymmetry", truth, n, size)
    return {**truth, "viscous_asymmetry": rng.choice([-1, 1]) * truth["viscous_asymmetry"]}


def _asymmetric(truth, base):
    # The slower of the two directions keeps a third of the mean viscous friction.
    viscous = max(base["viscous+"], 1.5 * abs(truth["viscous_asymmetry"]))
    return {
        "coulomb+": base["coulomb+"] + truth["coulomb_asymmetry"],
        "coulomb-": base["coulomb-"] - truth["coulomb_asymmetry"],
        "viscous+": viscous + truth["viscous_asymmetry"],
        "viscous-": viscous - truth["viscous_asymmetry"],
    }


ASYMMETRY = Kind(
    _draw_asymmetry,
    # Coulomb asymmetry is a constant in slip, but for dwells: the size is that of the viscous part.
    lambda truth, n: truth["viscous_asymmetry"] * np.abs(n.v),
    _asymmetric,
    lambda truth: "viscous friction differs between the directions",
    centred=True,
)


def _shape(name, ratio):
    return {"gaussian": np.exp(-(ratio**2)), "lorentzian": 1 / (1 + ratio**2)}.get(
        name, np.exp(-ratio)
    )


def _draw_stribeck(rng, n, size):
    width = log_uniform(rng, 0.03, 0.15) * n.top
    truth = {"shape": SHAPES[rng.integers(3)], "stribeck_velocity": width}
    return scaled(STRIBECK, "stribeck_force", truth, n, size, 0.8 * n.coulomb)


def _stribeck(truth, base):
    both = {f"bump{s}": truth["stribeck_force"] for s in "+-"}
    both |= {f"bump_speed{s}": truth["stribeck_velocity"] for s in "+-"}
    return both | {"bump_shape": float(SHAPES.index(truth["shape"]))}


STRIBECK = Kind(
    _draw_stribeck,
    lambda truth, n: (
        truth["stribeck_force"]
        * n.way
        * _shape(truth["shape"], np.abs(n.v) / truth["stribeck_velocity"])
    ),
    _stribeck,
    lambda truth: f"speeds below {3 * truth['stribeck_velocity']:.3g}",
)


def _draw_viscous(rng, n, size):
    form = ("quadratic", "shear_thinning", "power")[rng.integers(3)]
    truth: Truth = {"form": form}
    if form == "quadratic":
        return scaled(VISCOUS, "quadratic_drag", truth, n, size)
    if form == "shear_thinning":
        truth["thinning_velocity"] = log_uniform(rng, 0.1, 0.5) * n.top
        return scaled(VISCOUS, "thinning_viscous", truth, n, size)
    truth |= {"unit_speed": n.top, "exponent": float(rng.choice([0.5, 2.0, 2.5, 3.0]))}
    return scaled(VISCOUS, "power_force", truth, n, size)


def _viscous_force(truth, n):
    speed = np.abs(n.v)
    if truth["form"] == "quadratic":
        return truth["quadratic_drag"] * n.v * speed
    if truth["form"] == "shear_thinning":
        return truth["thinning_viscous"] * n.v / (1 + speed / truth["thinning_velocity"])
    return truth["power_force"] * n.way * (speed / truth["unit_speed"]) ** truth["exponent"]


_FORMS = {
    "quadratic": _named(drag="quadratic_drag"),
    "shear_thinning": _named(thinning="thinning_viscous", thinning_speed="thinning_velocity"),
    "power": _named(power="power_force", power_speed="unit_speed", exponent="exponent"),
}
VISCOUS = Kind(
    _draw_viscous,
    _viscous_force,
    lambda truth, base: _FORMS[truth["form"]](truth, base),
    lambda truth: "curvature of friction over speed",
)


# Functions of position


def _phase(rng):
    return float(rng.uniform(0, TURN))


def _draw_unbalance(rng, n, size):
    truth = {"unbalance_period": rng.uniform(1.0, 2.5) * n.plan.stroke, "phase": _phase(rng)}
    return scaled(UNBALANCE, "amplitude", truth, n, size)


def _wave(period):
    return lambda truth, n: truth["amplitude"] * np.sin(TURN * n.x / truth[period] + truth["phase"])


UNBALANCE = Kind(
    _draw_unbalance,
    _wave("unbalance_period"),
    _named(unbalance="amplitude", unbalance_period="unbalance_period", unbalance_phase="phase"),
    lambda truth: f"position, one turn in {truth['unbalance_period']:.4g}",
    centred=True,
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


COGGING = Kind(
    _draw_cogging, _cogging_force, _cogging, lambda t: f"position, pitch {t['pitch']:.4g}"
)


def _draw_spring(rng, n, size):
    truth = {"rest": _at(n, rng.uniform(0.3, 0.7))}
    return scaled(SPRING, "stiffness", truth, n, size)


SPRING = Kind(
    _draw_spring,
    lambda truth, n: truth["stiffness"] * (n.x - truth["rest"]),
    _named(spring="stiffness", spring_rest="rest"),
    lambda truth: "position, over the whole stroke",
    centred=True,
)


def _draw_hardening(rng, n, size):
    truth = {"spring_centre": n.plan.low + rng.uniform(0.35, 0.65) * n.plan.stroke}
    return scaled(HARDENING, "cubic_stiffness", truth, n, size)


HARDENING = Kind(
    _draw_hardening,
    lambda truth, n: truth["cubic_stiffness"] * (n.x - truth["spring_centre"]) ** 3,
    _named(cubic="cubic_stiffness", cubic_centre="spring_centre"),
    lambda truth: "position, near both ends of the stroke",
    centred=True,
)


def _draw_stop(rng, n, size):
    upper, share = bool(rng.random() < 0.5), rng.uniform(0.04, 0.12)
    truth = {"side": "upper" if upper else "lower"}
    truth["stop_position" if upper else "lower_stop_position"] = _at(
        n, 1 - share if upper else share
    )
    stiffness = "stop_stiffness" if upper else "lower_stop_stiffness"
    truth = scaled(STOP, stiffness, truth, n, size)
    # The stop pushes the axis back by k/(k + kp) of the way that the set-point goes into it.
    asked, loop = truth[stiffness], n.physics["kp"]
    truth[stiffness] = asked * loop / max(loop - asked, 0.3 * loop)
    return truth


def _stop_force(truth, n):
    if truth["side"] == "upper":
        return truth["stop_stiffness"] * np.maximum(n.x - truth["stop_position"], 0.0)
    return truth["lower_stop_stiffness"] * np.minimum(n.x - truth["lower_stop_position"], 0.0)


def _stop(truth, base):
    if truth["side"] == "upper":
        return {"upper_stop": truth["stop_stiffness"], "upper_stop_at": truth["stop_position"]}
    where = truth["lower_stop_position"]
    return {"lower_stop": truth["lower_stop_stiffness"], "lower_stop_at": where}


STOP = Kind(_draw_stop, _stop_force, _stop, lambda truth: f"the {truth['side']} end of the stroke")


# Friction of position


def _draw_wavy(rng, n, size):
    truth = {"friction_period": n.plan.stroke / log_uniform(rng, 0.5, 15), "phase": _phase(rng)}
    return scaled(WAVY, "amplitude", truth, n, size, 0.7 * n.coulomb)


WAVY = Kind(
    _draw_wavy,
    lambda truth, n: n.way * _wave("friction_period")(truth, n),
    _named(
        wavy_friction="amplitude",
        wavy_friction_period="friction_period",
        wavy_friction_phase="phase",
    ),
    lambda truth: f"position by direction, period {truth['friction_period']:.4g}",
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


SPOT = Kind(
    _draw_spot,
    lambda truth, n: (
        truth["spot_force"]
        * n.way
        * np.exp(-0.5 * ((n.x - truth["spot_position"]) / truth["spot_width"]) ** 2)
    ),
    _named(spot="spot_force", spot_at="spot_position", spot_width="spot_width"),
    lambda truth: f"position by direction, at {truth['spot_position']:.4g}",
)


# Inertia of position, friction of load and of acceleration


def _draw_inertia(rng, n, size):
    truth = {"inertia_period": n.plan.stroke / log_uniform(rng, 0.5, 4), "phase": _phase(rng)}
    return scaled(INERTIA, "amplitude", truth, n, size, 0.6 * n.mass)


def _inertia_force(truth, n):
    rate = TURN / truth["inertia_period"]
    angle = rate * n.x + truth["phase"]
    return truth["amplitude"] * (n.a * np.sin(angle) + 0.5 * rate * n.v**2 * np.cos(angle))


INERTIA = Kind(
    _draw_inertia,
    _inertia_force,
    _named(wavy_mass="amplitude", wavy_mass_period="inertia_period", wavy_mass_phase="phase"),
    lambda truth: f"position by acceleration, period {truth['inertia_period']:.4g}",
)


LOADED = Kind(
    lambda rng, n, size: scaled(LOADED, "load_friction", {}, n, size, 0.5),
    lambda truth, n: truth["load_friction"] * np.abs(n.u) * n.way,
    _named(load_friction="load_friction"),
    lambda truth: "force by direction",
)


def _draw_rated(rng, n, size):
    truth = {"acceleration_scale": rng.uniform(0.2, 0.6) * float(np.quantile(np.abs(n.a), 0.98))}
    return scaled(RATED, "level", truth, n, size, 1.0 * n.coulomb)


RATED = Kind(
    _draw_rated,
    lambda truth, n: (
        truth["level"] * n.way * np.abs(n.a) / (np.abs(n.a) + truth["acceleration_scale"])
    ),
    _named(acceleration_friction="level", acceleration_scale="acceleration_scale"),
    lambda truth: "friction that grows with acceleration of either sign",
)


KINDS = {
    "asymmetric_friction": ASYMMETRY,
    "stribeck": STRIBECK,
    "viscous_nonlinearity": VISCOUS,
    "gravity_unbalance": UNBALANCE,
    "cogging": COGGING,
    "spring": SPRING,
    "hardening_spring": HARDENING,
    "end_stop": STOP,
    "position_dependent_friction": WAVY,
    "sticky_spot": SPOT,
    "position_dependent_inertia": INERTIA,
    "load_dependent_friction": LOADED,
    "acceleration_dependent_friction": RATED,
}
