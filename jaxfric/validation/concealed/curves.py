"""Concealed friction: functions of velocity, of load and of acceleration."""

import numpy as np

from .machines import SHAPES, log_uniform
from .nominal import Kind, Truth, named, scaled


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


def _asymmetry(truth, n):
    return truth["viscous_asymmetry"] * np.abs(n.v)


def _all_asymmetry(truth, n):
    return _asymmetry(truth, n) + truth["coulomb_asymmetry"] * np.abs(n.way)


ASYMMETRY: Kind = Kind(
    _draw_asymmetry,
    # Coulomb asymmetry is a constant in slip, but for dwells: the size is that of the viscous part.
    _asymmetry,
    _asymmetric,
    lambda truth: "viscous friction differs between the directions",
    centred=True,
    tied=True,
    inside=True,
    total=_all_asymmetry,
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


STRIBECK: Kind = Kind(
    _draw_stribeck,
    lambda truth, n: (
        truth["stribeck_force"]
        * n.way
        * _shape(truth["shape"], np.abs(n.v) / truth["stribeck_velocity"])
    ),
    _stribeck,
    lambda truth: f"speeds below {3 * truth['stribeck_velocity']:.3g}",
    bump=False,
    inside=True,
    planted=True,
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
    "quadratic": named(drag="quadratic_drag"),
    "shear_thinning": named(thinning="thinning_viscous", thinning_speed="thinning_velocity"),
    "power": named(power="power_force", power_speed="unit_speed", exponent="exponent"),
}
VISCOUS: Kind = Kind(
    _draw_viscous,
    _viscous_force,
    lambda truth, base: _FORMS[truth["form"]](truth, base),
    lambda truth: "curvature of friction over speed",
    planted=True,
)


LOADED: Kind = Kind(
    lambda rng, n, size: scaled(LOADED, "load_friction", {}, n, size, 0.5),
    lambda truth, n: truth["load_friction"] * np.abs(n.u) * n.way,
    named(load_friction="load_friction"),
    lambda truth: "force by direction",
    loud=True,
    follows=False,
)


def _draw_rated(rng, n, size):
    truth = {"acceleration_scale": rng.uniform(0.2, 0.6) * float(np.quantile(np.abs(n.a), 0.98))}
    return scaled(RATED, "level", truth, n, size, 1.0 * n.coulomb)


RATED: Kind = Kind(
    _draw_rated,
    lambda truth, n: (
        truth["level"] * n.way * np.abs(n.a) / (np.abs(n.a) + truth["acceleration_scale"])
    ),
    named(acceleration_friction="level", acceleration_scale="acceleration_scale"),
    lambda truth: "friction that grows with acceleration of either sign",
    loud=True,
    follows=False,
)


KINDS = {
    "asymmetric_friction": ASYMMETRY,
    "stribeck": STRIBECK,
    "viscous_nonlinearity": VISCOUS,
    "load_dependent_friction": LOADED,
    "acceleration_dependent_friction": RATED,
}
