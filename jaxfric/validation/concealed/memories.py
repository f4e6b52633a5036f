"""Concealed effects with a state of their own: friction's memory, the actuator, a second body."""

import numpy as np

from .machines import log_uniform
from .nominal import TURN, Kind, bump, rms, scaled, solved, travelled


def _mean_coulomb(n):
    return 0.5 * (n.physics["coulomb+"] + n.physics["coulomb-"])


def _bristle_bounds(n):
    # The bristle's own vibration must be slow beside the substep.
    stable = 1.6 * _mean_coulomb(n) / n.mass * (n.substep / 0.3) ** 2
    shortest = max(1e-6 * n.plan.stroke, stable)
    return shortest, max(0.03 * n.plan.stroke, 2 * shortest)


def _draw_presliding(rng, n, size):
    return solved(PRESLIDING, {"presliding_force": _mean_coulomb(n)}, n, size)


def _bristle(truth, n):
    """What a bristle lacks after a reversal, mean over each sample, of Coulomb and of the bump."""
    since, length = travelled(n), truth["presliding_distance"]
    until = since + np.abs(n.v) / n.plan.sample_rate
    left = np.exp(-since / length) - np.exp(-until / length)
    mean = left * length / np.maximum(until - since, 1e-9 * length)
    level = truth["presliding_force"] + bump(n.physics, np.abs(n.v), n.way)
    return -2 * level * n.way * np.minimum(mean, 1.0)


PRESLIDING: Kind = Kind(
    _draw_presliding,
    _bristle,
    lambda truth, base: {
        "presliding": 1.0, "presliding_distance": truth["presliding_distance"]
    },
    lambda truth: f"within {3 * truth['presliding_distance']:.3g} after a reversal",
    tuned="presliding_distance",
    bounds=_bristle_bounds,
    follows=False,
)  # fmt: skip


def _lagging(truth, n):
    late = np.interp(n.time - truth["frictional_lag"], n.time, np.abs(n.v))
    return n.way * (bump(n.physics, late, n.way) - bump(n.physics, np.abs(n.v), n.way))


FRICTION_LAG: Kind = Kind(
    lambda rng, n, size: solved(FRICTION_LAG, {}, n, size),
    _lagging,
    lambda truth, base: {"friction_lag": truth["frictional_lag"]},
    lambda truth: "loops of friction over velocity at low speed",
    tuned="frictional_lag",
    bounds=lambda n: (n.substep, 0.03 * n.plan.period),
    bump=True,
    follows=False,
)


def _draw_spread(rng, n, size):
    truth = {"rest": n.plan.low + rng.uniform(0.3, 0.7) * n.plan.stroke}
    truth["distance"] = rng.uniform(0.08, 0.2) * n.plan.stroke
    return scaled(HYSTERETIC, "stiffness", truth, n, size)


def _hysteretic(truth, n):
    deflection = n.way * (1 - 2 * np.exp(-travelled(n) / truth["distance"]))
    return truth["stiffness"] * np.abs(n.x - truth["rest"]) * deflection


HYSTERETIC: Kind = Kind(
    _draw_spread,
    _hysteretic,
    lambda truth, base: {
        "hysteresis": truth["stiffness"],
        "hysteresis_centre": truth["rest"],
        "hysteresis_distance": truth["distance"],
    },
    lambda truth: "a spring that gives back less than it took",
    follows=False,
)


# Actuator


def _rate(n):
    """Rate of the force in slip, N/s; zero within a hundredth of a period of a reversal."""
    rate = np.gradient(n.u, n.time)
    turns = np.flatnonzero(np.diff(n.way) != 0)
    reach = max(int(0.01 * n.plan.period * n.plan.sample_rate), 2)
    for turn in turns:
        rate[max(turn - reach, 0) : turn + reach + 1] = 0.0
    return rate


def _slowest(n):
    """The lag that takes a quarter of a radian of the loop's phase at its bandwidth, s."""
    return 0.25 / n.bandwidth


DELAY: Kind = Kind(
    lambda rng, n, size: scaled(DELAY, "delay", {}, n, size, _slowest(n)),
    lambda truth, n: truth["delay"] * _rate(n),
    lambda truth, base: {"delay": truth["delay"]},
    lambda truth: "force rate",
    loud=True,
    slow=True,
    follows=False,
)
LAG: Kind = Kind(
    lambda rng, n, size: scaled(LAG, "lag", {}, n, size, _slowest(n)),
    lambda truth, n: truth["lag"] * _rate(n),
    lambda truth, base: {"lag": truth["lag"]},
    lambda truth: "force rate",
    loud=True,
    slow=True,
    follows=False,
)


def _draw_swing(rng, n, size):
    truth = {"period": n.plan.stroke / log_uniform(rng, 1, 4)}
    return scaled(SWING, "delay", truth, n, size, 0.5 * _slowest(n))


SWING: Kind = Kind(
    _draw_swing,
    lambda truth, n: truth["delay"] * (1 + np.sin(TURN * n.x / truth["period"])) * _rate(n),
    lambda truth, base: {"delay_swing": truth["delay"], "delay_period": truth["period"]},
    lambda truth: "force rate by position",
    loud=True,
    slow=True,
    follows=False,
)

DEADBAND: Kind = Kind(
    lambda rng, n, size: scaled(DEADBAND, "deadband", {}, n, size),
    lambda truth, n: truth["deadband"] * np.sign(n.u),
    lambda truth, base: {"deadband": truth["deadband"]},
    lambda truth: "sign of the force",
    loud=True,
    follows=False,
)


def _draw_saturation(rng, n, size):
    return scaled(
        SATURATION, "saturation", {"knee": rng.uniform(0.6, 1.3) * rms(n.u)}, n, size, 2.0
    )


SATURATION: Kind = Kind(
    _draw_saturation,
    lambda truth, n: (
        truth["saturation"] * np.sign(n.u) * np.maximum(np.abs(n.u) - truth["knee"], 0.0)
    ),
    lambda truth, base: {"saturation": truth["saturation"], "knee": truth["knee"]},
    lambda truth: f"force beyond {truth['knee']:.3g}",
    loud=True,
    follows=False,
)
GAIN: Kind = Kind(
    lambda rng, n, size: scaled(GAIN, "gain_asymmetry", {}, n, size, 1.0),
    lambda truth, n: truth["gain_asymmetry"] * np.maximum(n.u, 0.0),
    lambda truth, base: {"gain": truth["gain_asymmetry"]},
    lambda truth: "positive force",
    loud=True,
    follows=False,
)


# A second body


_LOAD_SHARE, _LOAD_FRICTION_SHARE = (0.3, 0.6), (0.3, 0.8)


def _draw_gap(rng, n, size):
    truth = {
        "load_share": rng.uniform(*_LOAD_SHARE),
        "load_friction_share": rng.uniform(*_LOAD_FRICTION_SHARE),
    }
    truth["contact_rate"] = rng.uniform(6, 12) * n.bandwidth
    truth["backlash_force"] = truth["load_friction_share"] * n.coulomb
    return solved(BACKLASH, truth, n, size)


# Of the highest rate at which flanks may swing, per substep.
_RESOLVED = 0.25


def _gap_bounds(n):
    """Gaps whose flanks a substep resolves though they give way by half the half-gap only.

    Where they give way by more than the gap, a compliance is what shows.
    """
    share = _LOAD_SHARE[0] * (1 - _LOAD_SHARE[0])
    stiffest = share * n.mass * (_RESOLVED / n.substep) ** 2
    narrowest = max(2 * _LOAD_FRICTION_SHARE[1] * n.coulomb / stiffest, 1e-5 * n.plan.stroke)
    return narrowest, max(0.02 * n.plan.stroke, 2 * narrowest)


def _flanks(truth, n):
    """Flanks that give way by half the half-gap at most."""
    reduced = _reduced(truth, n.mass)
    stiff = np.sqrt(2 * truth["backlash_force"] / (truth["half_gap"] * reduced))
    rate = min(max(truth["contact_rate"], stiff), _RESOLVED / n.substep)
    # A definition may have drawn another share of the friction.
    force = truth["load_friction_share"] * n.coulomb
    windup = force / (reduced * rate**2)
    follow = {"backlash_force": force, "contact_rate": rate, "windup": windup}
    return truth | {name: float(value) for name, value in follow.items()}


def _reduced(truth, mass):
    """Of both bodies swinging against each other, kg."""
    return mass * truth["load_share"] * (1 - truth["load_share"])


def _gap(truth, n):
    crossing = (travelled(n) < 2 * truth["half_gap"]) & (n.way != 0)
    inside = np.where(crossing, -1.0, 0.0)
    rigid = truth["load_share"] * n.mass * n.a
    return inside * (rigid + truth["load_friction_share"] * (n.u - n.mass * n.a))


def _coupled(truth, base, rate, damping):
    """Spring and damper between the bodies, by the frequency with which they swing together."""
    reduced = _reduced(truth, base["mass"])
    return {
        "load_share": truth["load_share"],
        "load_friction_share": truth["load_friction_share"],
        "stiffness": reduced * rate**2,
        "damping": 2 * damping * reduced * rate,
    }


BACKLASH: Kind = Kind(
    _draw_gap,
    _gap,
    lambda truth, base: (
        _coupled(truth, base, truth["contact_rate"], 0.3) | {"half_gap": truth["half_gap"]}
    ),
    lambda truth: f"within {2 * truth['half_gap']:.3g} after a reversal",
    tuned="half_gap",
    bounds=_gap_bounds,
    complete=_flanks,
    impacts=True,
    follows=False,
)


def _draw_compliance(rng, n, size):
    # Sampling and the velocity filter turn the loop's damping into its opposite at ten times the
    # bandwidth; a joint with less damping of its own than a tenth would ring for ever there.
    truth = {"load_share": rng.uniform(0.3, 0.5), "load_friction_share": rng.uniform(0.0, 0.5)}
    truth["joint_damping_ratio"] = rng.uniform(0.1, 0.2)
    return solved(COMPLIANCE, truth, n, size)


def _stiffness(truth, n):
    load = truth["load_share"] * n.mass
    stiffness = load / truth["time_constant"] ** 2
    # Against a held motor the load's own viscous friction damps it too.
    viscous = 0.5 * (n.physics["viscous+"] + n.physics["viscous-"]) * truth["load_friction_share"]
    damping = truth["joint_damping_ratio"] + 0.5 * viscous * truth["time_constant"] / load
    return truth | {
        "stiffness": stiffness, "compliance": load**2 / stiffness, "damping_ratio": damping,
    }  # fmt: skip


def _swinging(truth, n):
    """What the load on its spring pulls beyond m a, by its frequency response to the motor."""
    # The set-point with its ends joined is a closed path, and the loop follows up to its bandwidth.
    spectrum = np.fft.rfft(n.a * np.hanning(n.a.size)) * np.sqrt(8 / 3)
    omega = TURN * np.fft.rfftfreq(n.a.size, 1 / n.plan.sample_rate)
    ratio = omega * truth["time_constant"]
    damped = 1 + 2j * truth["joint_damping_ratio"] * ratio
    response = damped / (damped - ratio**2) - 1
    followed = 1 / (1 + (omega / n.bandwidth) ** 2)
    pull = np.fft.irfft(spectrum * response * followed, n.a.size)
    return truth["load_share"] * n.mass * pull


def _compliant(truth, base):
    # Both bodies swing faster than the load against a held motor, whose damping ratio is drawn.
    faster = 1 / np.sqrt(1 - truth["load_share"])
    damping = truth["joint_damping_ratio"] * faster
    return _coupled(truth, base, faster / truth["time_constant"], damping)


COMPLIANCE: Kind = Kind(
    _draw_compliance,
    _swinging,
    _compliant,
    lambda truth: f"acceleration, ringing at {1 / (TURN * truth['time_constant']):.3g} Hz",
    tuned="time_constant",
    # From what the substep resolves to the motion's own frequency.
    bounds=lambda n: (n.substep / 0.25, 0.25 * n.plan.period / TURN),
    complete=_stiffness,
    loud=True,
    follows=False,
)

KINDS = {
    "presliding": PRESLIDING,
    "frictional_lag": FRICTION_LAG,
    "backlash": BACKLASH,
    "compliance": COMPLIANCE,
    "transport_delay": DELAY,
    "actuator_lag": LAG,
    "actuator_deadband": DEADBAND,
    "actuator_saturation": SATURATION,
    "gain_asymmetry": GAIN,
    "position_dependent_delay": SWING,
    "hysteretic_spring": HYSTERETIC,
}
