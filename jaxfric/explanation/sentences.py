"""Findings in plain words."""

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from ..identification.uncertainty import Estimate
from ..simulators.columns import GAIN
from ..terms.effect import ANY, Effect, Extent
from ..terms.effects import EFFECTS
from ..terms.effects.parameter_mismatch import MISMATCH
from ..terms.slow import CHANGES
from ..units import CURRENTS, FORCE
from .fewest import SURE
from .quantities import UNSEEN, nil, quantity, turns, unseen

NOWHERE = Extent()


def sentence(
    name: str,
    parameters: dict[str, Estimate],
    share: float,
    rivals,
    extent: Extent = NOWHERE,
    together: float | None = None,
) -> str:
    """One finding as a sentence, with its share and what it could be instead.

    **Arguments:** `name` of the effect; `extent` of the recording, which some sentences depend on;
    `together`: the share of all findings, where others could stand in for a part of this one.
    """
    text = told(EFFECTS[name], parameters, extent)
    all_ = "" if together is None else f" alone, {together:.0%} with the other findings"
    return f"{text}; {unexplained(share)}{all_}{indistinct(rivals)}."


def told(effect: Effect, parameters: Mapping[str, Estimate], extent: Extent = NOWHERE) -> str:
    """An effect with its values in words, without a full stop."""
    # A period that is not known has not been seen to repeat.
    values = {
        n: math.inf if n in effect.periods and _unseen(estimate) else float(estimate.value)
        for n, estimate in parameters.items()
        if not (n in CHANGES and nil(estimate))
    }
    vague = effect.vague(values, extent) if _sizeless(effect, parameters) else None
    template = (
        vague or effect.variant(values, extent) or effect.sentence or effect.name.replace("_", " ")
    )
    words = {n: _words(effect, n, estimate) for n, estimate in parameters.items()}
    if _beyond(effect, parameters, extent.force):
        words["amplitude"] = UNSEEN
    elif "amplitude" in words:
        words["amplitude"] += _harmonics(parameters)
    words |= {f"{n}:gain": _as_gain(estimate) for n, estimate in parameters.items()}
    sizes = {n: e._replace(value=abs(e.value)) for n, e in parameters.items()}
    words |= {f"{n}:size": quantity(estimate) for n, estimate in sizes.items()}
    words |= {f"{n}:power": _as_power(estimate) for n, estimate in parameters.items()}
    words |= {f"{n}:more": _more(estimate) for n, estimate in parameters.items()}
    # Names may be a simulator's, of any characters.
    return re.sub(r"\{([^{}]*)\}", lambda m: words.get(m[1], "an unknown amount"), template)


def unexplained(share: float) -> str:
    """A share in words, in whole per cents."""
    size = "under 1%" if share < 0.005 else f"{share:.0%}"
    return f"{size} of the unexplained force"


def indistinct(rivals: Sequence[str]) -> str:
    """What a finding may be as well, the end of its sentence."""
    names = " or ".join(
        "wrong values" if rival == MISMATCH else rival.replace("_", " ") for rival in rivals
    )
    return f". This recording cannot tell it from {names}" if rivals else ""


def _words(effect: Effect, name: str, estimate: Estimate) -> str:
    """A value in words; of a size that may be nil the most that it may be.

    Of another magnitude an interval down to zero says nothing, on a scale of ratios.
    """
    most = float(estimate.interval()[1])
    sized = name.startswith(effect.sizes) or name in (*effect.vanishes, effect.lasting)
    sized |= effect.late
    if sized and nil(estimate):
        return f"at most {quantity(Estimate(max(most, 0.0), 0.0, estimate.unit))}"
    if name in effect.magnitudes and nil(estimate):
        return unseen(estimate)
    if name in effect.periods:
        return quantity(estimate) + turns(estimate)
    return quantity(estimate)


def _unseen(estimate: Estimate) -> bool:
    """Whether a magnitude is any, for all that is known of it."""
    return nil(estimate) or math.isinf(float(estimate.standard_error))


def _sizeless(effect: Effect, parameters: Mapping[str, Estimate]) -> bool:
    """Whether all that its force is proportional to may be nil."""
    names = {p.name for term in effect.shapes(ANY) for p in term.affine}
    return all(_unseen(estimate) for name, estimate in parameters.items() if name in names)


def _beyond(effect: Effect, parameters: Mapping[str, Estimate], force: float) -> bool:
    """Whether the most that a force's amplitude may be is more than the usual force, N: waves that
    nearly cancel have any amplitude together, and such a bound is none.
    """
    dimensions = {p.dimension for t in effect.shapes(ANY) for p in t.affine if p.name in parameters}
    amplitude = parameters.get("amplitude")
    if amplitude is None or dimensions != {FORCE} or not nil(amplitude):
        return False
    return bool(float(amplitude.interval()[1]) > force)


# A hundredth of a wave's power: less is told in the document alone.
_LEAST = 0.1
_ORDINALS = {2: "second", 3: "third"}


def _harmonics(parameters: Mapping[str, Estimate]) -> str:
    """The harmonics of a wave that are known and not small: ", with a third harmonic of 2.1 N"."""
    waves = {n: e for n, e in parameters.items() if n.startswith("amplitude") and not _unseen(e)}
    most = max((float(estimate.value) for estimate in waves.values()), default=0.0)
    said = [
        f"a {_ORDINALS.get(number, f'{number}th')} harmonic of {quantity(estimate)}"
        for name, estimate in waves.items()
        if (number := int(name.partition("_harmonic")[2] or 1)) > 1
        and float(estimate.value) >= _LEAST * most
    ]
    return f", with {' and '.join(said)}" if said else ""


def _as_gain(more: Estimate) -> str:
    """What a command that is by this part larger makes of the gain: "23.1% ± 0.6% lower"."""
    gain = 1 / (1 + float(more.value)) - 1
    ends = [1 / (1 + float(end)) - 1 for end in more.interval()]
    half = 0.5 * abs(ends[1] - ends[0])
    if not (math.isfinite(half) and float(more.interval()[0]) > -1):
        return "other by an unknown amount"
    digits = max(0, 1 - math.floor(math.log10(100 * half))) if half > 0 else 1
    size, spread = f"{100 * abs(gain):.{digits}f}%", f" ± {100 * half:.{digits}f}%" * (half > 0)
    return f"{size}{spread} {'higher' if gain > 0 else 'lower'}"


def _as_power(exponent: Estimate) -> str:
    """An exponent in words, or on which side of proportion it is."""
    if not _unseen(exponent):
        return f"to the power of {quantity(exponent)}"
    low, high = map(float, exponent.interval())
    if high < 1:
        return "to a power below one"
    return "to a power above one" if low > 1 else "to a power other than one"


def _more(estimate: Estimate) -> str:
    """A difference in words: "1.50 N ± 0.20 N less"."""
    size = quantity(estimate._replace(value=abs(estimate.value)))
    return f"{size} {'more' if estimate.value > 0 else 'less'}"


def mismatch_sentence(moved, share: float, rivals: Sequence[str] = (), unit: str = "") -> str:
    """Wrong values of the baseline as a sentence; `unit` of the force."""
    parts = []
    for name, m in moved.items():
        if name == GAIN and not m.before:
            parts.append(_times(m.estimate._replace(value=1 + m.value), unit))
        elif m.before:
            parts.append(f"{_spoken(name)} is {quantity(m.estimate)}, not {m.before:.4g}")
        else:
            value = quantity(m.estimate._replace(value=abs(m.value)))
            parts.append(f"{_spoken(name)} is {value} {'more' if m.value > 0 else 'less'}")
    text = f"Wrong values: {'; '.join(parts)}; {unexplained(share)}"
    return f"{text}{indistinct(rivals)}."


def _times(factor: Estimate, unit: str) -> str:
    """The recorded force as a multiple of the simulator's; of another sign where it is negative."""
    size = quantity(factor._replace(value=abs(factor.value), unit=""))
    if factor.value < 0:
        return (
            f"the recorded force has the opposite sign, and {size} times the size of the "
            "simulator's: turn one of them round (--scale force=-1)"
        )
    if unit in CURRENTS:
        return f"the recorded current is {size} times the simulator's: {of_constant(factor)}"
    return f"the recorded force (the torque constant) is {size} times the simulator's"


def of_constant(factor: Estimate) -> str:
    """The torque constant of a drive whose current is so many times the simulator's, in words."""
    value = 1 / float(factor.value)
    error = float(factor.standard_error) * value**2
    constant = factor._replace(value=np.float64(value), standard_error=np.float64(error), unit="")
    return f"the torque constant is {quantity(constant)} of what that takes it for"


def spoken(name: str) -> str:
    """The change of a parameter in words: "a step of viscous friction"."""
    return f"a step of {parameter(name.removeprefix('step_').removesuffix('_sin'))}"


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


# The Coulomb levels of either direction, and what changes both by a constant force.
SIDES = ("coulomb+", "coulomb-")
CONSTANT_APART = "A weight, a tilt or a zero of the sensor changes so, and a load that wanders."


def constant_force(
    forwards: tuple[float, float], backwards: tuple[float, float]
) -> tuple[float, float] | None:
    """The constant force, N, with its standard error, that adds to the Coulomb level of one
    direction what it takes off the other's; `None` where the changes, each with its error, are
    not opposite.
    """
    (rise, first), (fall, second) = forwards, backwards
    error = math.hypot(first, second)
    return None if abs(rise + fall) > SURE * error else (0.5 * (rise - fall), 0.5 * error)


def _as_constant(moved) -> str:
    """That the changes of both Coulomb levels are those of a constant force, a sentence."""
    if not {*SIDES} <= set(moved):
        return ""
    changes = [moved[side].change for side in SIDES]
    found = constant_force(*((float(c.value), float(c.standard_error)) for c in changes))
    if found is None:
        return ""
    change, error = found
    force = Estimate(np.float64(change), np.float64(error), changes[0].unit)
    return (
        f" Both Coulomb levels change as by a constant force of {quantity(force)}, with the same "
        f"friction. {CONSTANT_APART}"
    )


def changed_sentence(moved, share: float, other: str, rivals: Sequence[str] = ()) -> str:
    """Values that another recording had otherwise, as a sentence; ± of the change, 95 %."""
    parts = []
    for name, m in moved.items():
        half = float(m.change.half_width())
        digits = max(0, 1 - math.floor(math.log10(half))) if 0 < half < math.inf else 3
        unit = f" {m.unit}" if m.unit not in ("", "1") else ""
        way = "rose" if m.value > m.before else "fell"
        part = f"{parameter(name)} {way} from {m.before:.{digits}f} to {m.value:.{digits}f}{unit}"
        if 0 < half < math.inf:
            part += f" (± {half:.{digits}f})"
        parts.append(part)
    text = ", ".join(parts)
    text = text[:1].upper() + text[1:]
    text = f"{text} since {other or 'the other recording'}; {share:.0%} of the difference"
    return f"{text}{indistinct(rivals)}.{_as_constant(moved)}"


def factor_sentence(
    factor: Estimate, share: float, other: str | None = None, friction: bool = False,
    rivals: Sequence[str] = (),
) -> str:  # fmt: skip
    """That all forces are so many times what they were; `other`: of which recording, `None` of a
    model; `friction`: whether friction alone does as well.
    """
    gain = _as_gain(factor._replace(value=factor.value - 1))
    alone = (
        ", or friction alone is so many times what it was, which the accelerations here do not tell"
    )
    whose = "the model's" if other is None else f"those of {other or 'the other recording'}"
    text = (
        f"One factor for all values: the forces are {quantity(factor)} times {whose}, as where "
        f"the gain (the torque or force constant) is {gain}{alone * friction}"
    )
    part = unexplained(share) if other is None else f"{share:.0%} of the difference"
    return f"{text}; {part}{indistinct(rivals)}."


def _spoken(name: str) -> str:
    """A parameter's name, of a wave as the part of it that it is."""
    for end, part in (("_sin", "sine"), ("_cos", "cosine")):
        if name.endswith(end):
            return f"the {part} part of {name.removesuffix(end)}"
    return name
