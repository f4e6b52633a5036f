"""Findings in plain words."""

import math

from ..identification.uncertainty import Estimate
from .quantities import nil, quantity, turns

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
    "cogging": "A force periodic in position, period {pitch}, amplitude {amplitude}: cogging of a "
    "motor, or the error of a screw or a gear; an unbalance would repeat once per revolution",
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
    "payload_change": "At t = {step_time} the load changes: its inertia by {payload_inertia}",
    "gain_step": "At t = {step_time} the force needed for the same motion changes by {step_gain} "
    "of it: a gain, a torque constant or a transmission that switched",
    "load_drift": "A constant force wanders slowly over the record",
    "periodic_disturbance": "A force periodic in time, {frequency}, amplitude {amplitude}",
    "disturbance_pulses": "Isolated pushes at single times",
    "cross_axis": "The other axis pulls along: {coupling_inertia} times its acceleration and "
    "{coupling_viscous} times its velocity",
}


def sentence(
    effect: str,
    parameters: dict[str, Estimate],
    share: float,
    rivals,
    stroke: float = math.inf,
) -> str:
    """One finding as a sentence, with its share and what it could be instead.

    **Arguments:** `stroke`, the range of the position.
    """
    # The stop at the lower end is told as the one at the upper end.
    words = {n.removeprefix("lower_"): _words(n, estimate) for n, estimate in parameters.items()}
    template = _slow(effect, parameters, stroke) or _TEXTS.get(effect, effect.replace("_", " "))
    weight = next((n for n in ("amplitude", "payload_offset") if n in words), None)
    if effect == "payload_change" and weight:
        template += f", and its weight by {{{weight}}}: something was picked up or put down"
    text = template.format_map(_Gaps(words))
    text += f"; {share:.0%} of the unexplained force"
    if rivals:
        text += ". This recording cannot tell it from " + " or ".join(
            name.replace("_", " ") for name in rivals
        )
    return text + "."


# Fewer periods in the stroke are no repetition.
REPEATED = 1.5
# A stop is met at the end: what acts over more than this part of the stroke is something else.
ABRUPT = 0.25
# Over half of that, too, where at the end it is less than this part of the usual force.
FAINT = 0.25
# With more damping a load does not swing: its second half-wave is below a tenth of the first.
SWINGING = 0.5
_SLOW = {
    "gravity_unbalance": "A force varies slowly along the stroke, by {amplitude}: it does not "
    "repeat within the stroke, so that a spring or a cable would look the same",
    "cogging": "A force varies slowly along the stroke, by {amplitude}: it does not repeat "
    "within the stroke",
    "position_dependent_friction": "Friction varies slowly along the stroke, by {amplitude}: it "
    "does not repeat within the stroke, as with a guide or a belt that is tight in one place",
    "position_dependent_inertia": "Inertia varies slowly along the stroke, by {amplitude}",
}
_SOFT = (
    "Towards the end of the stroke a force rises slowly, from {stop_position} on by "
    "{stop_stiffness}: a slow variation along the stroke, too soft for an end stop"
)
_CREEPING = (
    "A part of the mass follows the drive late, with {load_resonance} and a damping ratio of "
    "{damping_ratio}: too damped to swing, as with rubber, grease or a slipping coupling"
)


def _slow(effect: str, parameters: dict[str, Estimate], stroke: float) -> str | None:
    """Another text where the effect's name promises more than its values hold."""
    values = {name.removeprefix("lower_"): float(e.value) for name, e in parameters.items()}
    period = next((v for n, v in values.items() if n == "pitch" or n.endswith("_period")), 0.0)
    if effect in _SLOW and period * REPEATED > stroke:
        return _SLOW[effect]
    reach, part = values.get("stop_reach", 0.0), values.get("stop_part", 1.0)
    if effect == "end_stop" and reach > (ABRUPT if part > FAINT else 0.5 * ABRUPT) * stroke:
        return _SOFT
    if effect == "compliance" and values.get("damping_ratio", 0.0) >= SWINGING:
        return _CREEPING
    return None


# Sizes without a sign: where other terms of the model could stand in for all of it, only the most
# that it may be is known.
_SIZES = ("stribeck_force", "amplitude", "presliding_force", "backlash_force", "deadband")


def _words(name: str, estimate: Estimate) -> str:
    """A value in words; of a size that may be nil the most that it may be."""
    most = float(estimate.value) + 2 * float(estimate.standard_error)
    if name.startswith(_SIZES) and nil(estimate):
        return f"at most {quantity(Estimate(max(most, 0.0), 0.0, estimate.unit))}"
    if name == "pitch" or name.endswith("_period"):
        return quantity(estimate) + turns(estimate)
    return quantity(estimate)


def mismatch_sentence(moved, share: float) -> str:
    """Wrong values of the baseline as a sentence."""
    parts = []
    for name, m in moved.items():
        if name == GAIN and not m.before:
            parts.append(_times(1 + float(m.value), float(m.standard_error)))
        elif m.before:
            value = quantity(Estimate(m.value, m.standard_error, m.unit))
            parts.append(f"{_spoken(name)} is {value}, not {m.before:.4g}")
        else:
            value = quantity(Estimate(abs(m.value), m.standard_error, m.unit))
            parts.append(f"{_spoken(name)} is {value} {'more' if m.value > 0 else 'less'}")
    return f"Wrong values: {'; '.join(parts)}; {share:.0%} of the unexplained force."


# How much of a simulator's force is recorded beyond all of it.
GAIN = "gain"


def _times(factor: float, error: float) -> str:
    """The recorded force as a multiple of the simulator's; of another sign where it is negative."""
    size = quantity(Estimate(abs(factor), error, ""))
    if factor < 0:
        return (
            f"the recorded force has the opposite sign, and {size} times the size of the "
            "simulator's: turn one of them round (--scale force=-1)"
        )
    return f"the recorded force (the torque constant) is {size} times the simulator's"


_SPOKEN = {
    "coulomb": "Coulomb friction",
    "viscous": "viscous friction",
    "stribeck_force": "the Stribeck bump",
    "stribeck_velocity": "the Stribeck velocity",
    "offset": "the constant force",
}
_SIDES = {"+": " forwards", "-": " backwards", "": ""}


def parameter(name: str) -> str:
    """A parameter in words: "Coulomb friction forwards"."""
    side = name[-1] if name.endswith(("+", "-")) else ""
    stem = name.removesuffix(side)
    return _SPOKEN.get(stem, stem.replace("_", " ")) + _SIDES[side]


def changed_sentence(moved, share: float, other: str) -> str:
    """Values that another recording had otherwise, as a sentence; ± of the change, 95 %."""
    parts = []
    for name, m in moved.items():
        error = math.hypot(float(m.standard_error), m.before_error)
        half = 2 * error
        digits = max(0, 1 - math.floor(math.log10(half))) if 0 < half < math.inf else 3
        unit = f" {m.unit}" if m.unit not in ("", "1") else ""
        way = "rose" if m.value > m.before else "fell"
        part = f"{parameter(name)} {way} from {m.before:.{digits}f} to {m.value:.{digits}f}{unit}"
        if 0 < half < math.inf:
            part += f" (± {half:.{digits}f})"
        parts.append(part)
    text = ", ".join(parts)
    text = text[:1].upper() + text[1:]
    return f"{text} since {other or 'the other recording'}; {share:.0%} of the difference."


def _spoken(name: str) -> str:
    """A parameter's name, of a wave as the part of it that it is."""
    for end, part in (("_sin", "sine"), ("_cos", "cosine")):
        if name.endswith(end):
            return f"the {part} part of {name.removesuffix(end)}"
    return name


class _Gaps(dict):
    def __missing__(self, key):
        return "an unknown amount"
