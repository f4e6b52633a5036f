"""Findings in plain words."""

import math

from ..identification.uncertainty import Estimate


def quantity(estimate: Estimate, scale: float = 1.0) -> str:
    """A value with its unit and half its 95 % interval: "1.90 N ± 0.20 N"."""
    value, error = float(estimate.value) * scale, float(estimate.standard_error) * scale
    unit = f" {estimate.unit}" if estimate.unit not in ("", "1") else ""
    if math.isinf(error):  # the data cannot see it, and its value is any
        return "an amount that this recording cannot tell"
    if not error > 0:
        return f"{value:.3g}{unit}"
    half = 2 * error
    digits = max(0, 1 - math.floor(math.log10(half)))
    if abs(value) >= 1e5 or 0 < abs(value) < 1e-3:
        return f"{value:.3g}{unit} ± {half:.1g}{unit}"
    return f"{value:.{digits}f}{unit} ± {half:.{digits}f}{unit}"


# What each effect is, with the parameters of its term in braces.
_TEXTS = {
    "asymmetric_friction": (
        "Friction differs with the direction: half the difference is {viscous_asymmetry} with "
        "speed and, at any speed, {coulomb_asymmetry}"
    ),
    "stribeck": "Friction falls with speed at low velocity: a Stribeck bump of {stribeck_force+} "
    "forward and {stribeck_force-} backward, over {stribeck_velocity+} and {stribeck_velocity-}",
    "viscous_nonlinearity": "Friction is curved in speed, beyond a Coulomb and a viscous part",
    "gravity_unbalance": "A force that follows position with a period of {unbalance_period}, "
    "amplitude {amplitude}: gravity on an eccentric mass",
    "cogging": "A force periodic in position, period {pitch}, amplitude {amplitude}: cogging or "
    "screw-lead error; an unbalance would repeat once per revolution",
    "spring": "A force proportional to position, {stiffness}: a spring",
    "hardening_spring": "A force that grows with the cube of position, {cubic_stiffness} about "
    "{spring_centre}: a hardening spring",
    "end_stop": "From {stop_position} to the end of the stroke a force grows by {stop_stiffness}: "
    "an elastic end stop",
    "position_dependent_friction": "Friction varies along the stroke by {amplitude}, with a period "
    "of {friction_period}",
    "sticky_spot": "Extra friction of {spot_force} around {spot_position}, half-width "
    "{spot_width}: a sticky spot",
    "position_dependent_inertia": "Inertia varies along the stroke by {amplitude}, with a period "
    "of {inertia_period}",
    "load_dependent_friction": "Friction grows with the load by {load_friction} of it",
    "presliding": "After a reversal friction builds up over {presliding_distance} instead of at "
    "once, {presliding_force} of it: presliding",
    "frictional_lag": "Friction follows velocity {frictional_lag} late",
    "backlash": "After a reversal {backlash_force} of friction is absent while a gap of twice "
    "{half_gap} is crossed: backlash",
    "compliance": "The load swings on the drive, at {load_resonance} against a held motor, with a "
    "damping ratio of {damping_ratio}: compliance",
    "transport_delay": "The force acts {delay} late: a dead time between command and motion",
    "actuator_lag": "The force lags its command by a time constant of {lag}",
    "actuator_deadband": "{deadband} of command is lost around zero force: a dead-band",
    "actuator_saturation": "Above {knee} the actuator gives less than commanded: saturation, "
    "{saturation} of the excess",
    "gain_asymmetry": "Positive force has a gain that differs by {gain_asymmetry}",
    "thermal_drift": "Friction changes exponentially over the record, time constant "
    "{time_constant}: warming",
    "friction_step": "At t = {step_time} Coulomb friction changes by {step_coulomb}",
    "load_drift": "A constant force wanders slowly over the record",
    "periodic_disturbance": "A force periodic in time, {frequency}, amplitude {amplitude}",
    "disturbance_pulses": "Isolated pushes at single times",
    "cross_axis": "The other axis pulls along: {coupling_inertia} times its acceleration and "
    "{coupling_viscous} times its velocity",
}


def sentence(effect: str, parameters: dict[str, Estimate], share: float, rivals) -> str:
    """One finding as a sentence, with its share and what it could be instead."""
    # The stop at the lower end is told as the one at the upper end.
    words = {n.removeprefix("lower_"): _words(n, estimate) for n, estimate in parameters.items()}
    text = _TEXTS.get(effect, effect.replace("_", " ")).format_map(_Gaps(words))
    text += f"; {share:.0%} of the unexplained force"
    if rivals:
        text += ". This recording cannot tell it from " + " or ".join(
            name.replace("_", " ") for name in rivals
        )
    return text + "."


# Sizes without a sign: where other terms of the model could stand in for all of it, only the most
# that it may be is known.
_SIZES = ("stribeck_force", "amplitude", "presliding_force", "backlash_force", "deadband")


def _words(name: str, estimate: Estimate) -> str:
    """A value in words; of a size that may be nil the most that it may be."""
    most = float(estimate.value) + 2 * float(estimate.standard_error)
    nil = abs(float(estimate.value)) <= 2 * float(estimate.standard_error) < math.inf
    if name.startswith(_SIZES) and nil:
        return f"at most {quantity(Estimate(max(most, 0.0), 0.0, estimate.unit))}"
    return quantity(estimate)


def mismatch_sentence(moved, share: float) -> str:
    """Wrong values of the baseline as a sentence."""
    parts = []
    for name, m in moved.items():
        if m.before:
            value = quantity(Estimate(m.value, m.standard_error, m.unit))
            parts.append(f"{_spoken(name)} is {value}, not {m.before:.4g}")
        else:
            value = quantity(Estimate(abs(m.value), m.standard_error, m.unit))
            parts.append(f"{_spoken(name)} is {value} {'more' if m.value > 0 else 'less'}")
    return f"Wrong values: {'; '.join(parts)}; {share:.0%} of the unexplained force."


def _spoken(name: str) -> str:
    """A parameter's name, of a wave as the part of it that it is."""
    for end, part in (("_sin", "sine"), ("_cos", "cosine")):
        if name.endswith(end):
            return f"the {part} part of {name.removesuffix(end)}"
    return name


class _Gaps(dict):
    def __missing__(self, key):
        return "an unknown amount"
