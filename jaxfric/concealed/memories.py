"""Concealed effects with a state of their own: friction's memory, the actuator, a second body."""

import numpy as np

from .machines import log_uniform
from .nominal import Kind, bump, rms, scaled, solved, travelled

TURN = 2 * np.pi


def _draw_presliding(rng, n, size):
    # The bristle's own vibration must be slow beside the substep.
    force = 0.5 * (n.physics["coulomb+"] + n.physics["coulomb-"])
    stable = 1.6 * force / n.mass * (n.substep / 0.3) ** 2
    bounds = (max(1e-6 * n.plan.stroke, stable), 0.03 * n.plan.stroke)
    truth = {"presliding_force": force}
    return solved(PRESLIDING, "presliding_distance", truth, n, size, bounds)


PRESLIDING = Kind(
    _draw_presliding,
    lambda truth, n: (
        -2 * truth["presliding_force"] * n.way
        * np.exp(-travelled(n) / truth["presliding_distance"])
    ),
    lambda truth, base: {
        "presliding": 1.0, "presliding_distance": truth["presliding_distance"]
    },
    lambda truth: f"within {3 * truth['presliding_distance']:.3g} after a reversal",
)  # fmt: skip


def _lagging(truth, n):
    late = np.interp(n.time - truth["frictional_lag"], n.time, np.abs(n.v))
    return n.way * (bump(n.physics, late, n.way) - bump(n.physics, np.abs(n.v), n.way))


FRICTION_LAG = Kind(
    lambda rng, n, size: solved(
        FRICTION_LAG, "frictional_lag", {}, n, size, (n.substep, 0.03 * n.plan.period)
    ),
    _lagging,
    lambda truth, base: {"friction_lag": truth["frictional_lag"]},
    lambda truth: "loops of friction over velocity at low speed",
)


def _draw_spread(rng, n, size):
    truth = {"rest": n.plan.low + rng.uniform(0.3, 0.7) * n.plan.stroke}
    truth["distance"] = rng.uniform(0.08, 0.2) * n.plan.stroke
    return scaled(HYSTERETIC, "stiffness", truth, n, size)


def _hysteretic(truth, n):
    deflection = n.way * (1 - 2 * np.exp(-travelled(n) / truth["distance"]))
    return truth["stiffness"] * np.abs(n.x - truth["rest"]) * deflection


HYSTERETIC = Kind(
    _draw_spread,
    _hysteretic,
    lambda truth, base: {
        "hysteresis": truth["stiffness"],
        "hysteresis_centre": truth["rest"],
        "hysteresis_distance": truth["distance"],
    },
    lambda truth: "a spring that gives back less than it took",
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


DELAY = Kind(
    lambda rng, n, size: scaled(DELAY, "delay", {}, n, size, _slowest(n)),
    lambda truth, n: truth["delay"] * _rate(n),
    lambda truth, base: {"delay": truth["delay"]},
    lambda truth: "force rate",
)
LAG = Kind(
    lambda rng, n, size: scaled(LAG, "lag", {}, n, size, _slowest(n)),
    lambda truth, n: truth["lag"] * _rate(n),
    lambda truth, base: {"lag": truth["lag"]},
    lambda truth: "force rate",
)


def _draw_swing(rng, n, size):
    truth = {"period": n.plan.stroke / log_uniform(rng, 1, 4)}
    return scaled(SWING, "delay", truth, n, size, 0.5 * _slowest(n))


SWING = Kind(
    _draw_swing,
    lambda truth, n: truth["delay"] * (1 + np.sin(TURN * n.x / truth["period"])) * _rate(n),
    lambda truth, base: {"delay_swing": truth["delay"], "delay_period": truth["period"]},
    lambda truth: "force rate by position",
)

DEADBAND = Kind(
    lambda rng, n, size: scaled(DEADBAND, "deadband", {}, n, size),
    lambda truth, n: truth["deadband"] * np.sign(n.u),
    lambda truth, base: {"deadband": truth["deadband"]},
    lambda truth: "sign of the force",
)


def _draw_saturation(rng, n, size):
    return scaled(
        SATURATION, "saturation", {"knee": rng.uniform(0.6, 1.3) * rms(n.u)}, n, size, 2.0
    )


SATURATION = Kind(
    _draw_saturation,
    lambda truth, n: (
        truth["saturation"] * np.sign(n.u) * np.maximum(np.abs(n.u) - truth["knee"], 0.0)
    ),
    lambda truth, base: {"saturation": truth["saturation"], "knee": truth["knee"]},
    lambda truth: f"force beyond {truth['knee']:.3g}",
)
GAIN = Kind(
    lambda rng, n, size: scaled(GAIN, "gain_asymmetry", {}, n, size, 1.0),
    lambda truth, n: truth["gain_asymmetry"] * np.maximum(n.u, 0.0),
    lambda truth, base: {"gain": truth["gain_asymmetry"]},
    lambda truth: "positive force",
)


# A second body


def _draw_gap(rng, n, size):
    truth = {"load_share": rng.uniform(0.3, 0.6), "load_friction_share": rng.uniform(0.3, 0.8)}
    truth["contact_rate"] = min(rng.uniform(6, 12) * n.bandwidth, 0.25 / n.substep)
    bounds = (1e-5 * n.plan.stroke, 0.02 * n.plan.stroke)
    truth = solved(BACKLASH, "half_gap", truth, n, size, bounds)
    return truth | {"backlash_force": truth["load_friction_share"] * n.coulomb}


def _gap(truth, n):
    inside = np.where(travelled(n) < 2 * truth["half_gap"], -1.0, 0.0)
    rigid = truth["load_share"] * n.mass * n.a
    return inside * (rigid + truth["load_friction_share"] * (n.u - n.mass * n.a))


def _coupled(truth, base, rate, damping):
    """Spring and damper between the bodies, by the frequency with which they swing together."""
    share = truth["load_share"]
    reduced = base["mass"] * share * (1 - share)
    return {
        "load_share": share,
        "load_friction_share": truth["load_friction_share"],
        "stiffness": reduced * rate**2,
        "damping": 2 * damping * reduced * rate,
    }


BACKLASH = Kind(
    _draw_gap,
    _gap,
    lambda truth, base: (
        _coupled(truth, base, truth["contact_rate"], 0.3) | {"half_gap": truth["half_gap"]}
    ),
    lambda truth: f"within {2 * truth['half_gap']:.3g} after a reversal",
)


def _draw_compliance(rng, n, size):
    truth = {"load_share": rng.uniform(0.3, 0.7), "load_friction_share": rng.uniform(0.0, 0.5)}
    truth["damping_ratio"] = log_uniform(rng, 0.02, 0.1)
    bounds = (n.substep / 0.25, 0.25 * n.plan.period / TURN)
    truth = solved(COMPLIANCE, "time_constant", truth, n, size, bounds)
    stiffness = truth["load_share"] * n.mass / truth["time_constant"] ** 2
    first_order = (truth["load_share"] * n.mass) ** 2 / stiffness
    return truth | {"stiffness": stiffness, "compliance": first_order}


def _swinging(truth, n):
    """What the load on its spring pulls beyond m a, by its frequency response to the motor."""
    # The set-point with its ends joined is a closed path, and the loop follows up to its bandwidth.
    spectrum = np.fft.rfft(n.a * np.hanning(n.a.size)) * np.sqrt(8 / 3)
    omega = TURN * np.fft.rfftfreq(n.a.size, 1 / n.plan.sample_rate)
    ratio = omega * truth["time_constant"]
    damped = 1 + 2j * truth["damping_ratio"] * ratio
    response = damped / (damped - ratio**2) - 1
    followed = 1 / (1 + (omega / n.bandwidth) ** 2)
    pull = np.fft.irfft(spectrum * response * followed, n.a.size)
    return truth["load_share"] * n.mass * pull


def _compliant(truth, base):
    rate = 1 / (truth["time_constant"] * np.sqrt(1 - truth["load_share"]))
    return _coupled(truth, base, rate, truth["damping_ratio"])


COMPLIANCE = Kind(
    _draw_compliance,
    _swinging,
    _compliant,
    lambda truth: f"acceleration, ringing at {1 / (TURN * truth['time_constant']):.3g} Hz",
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
