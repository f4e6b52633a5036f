"""Wrong values of another simulator in its own words: what belongs to it, from what to what."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from ..identification.uncertainty import Estimate
from ..simulators import Attribute
from ..simulators.columns import GAIN
from ..terms.effects import EFFECTS
from ..terms.effects.load_dependent_friction import LOAD_DEPENDENT_FRICTION
from ..terms.effects.parameter_mismatch import MISMATCH
from .explained import Explanation
from .finding import Finding, Moved
from .sentences import indistinct, quantity, unexplained

# A correction that is no attribute by itself, as the gain of all of the force.
CONSTANT = "offset"
# More than these no one reads.
MOST = 4
POSITIVE = {"armature", "damping", "frictionloss", "inertia", "mass", "stiffness"}
STIFFNESS, REFERENCE = "stiffness", "springref"


def in_own_words(told: Explanation, own: Mapping[str, Attribute]) -> Explanation:
    """An explanation whose wrong values are the simulator's attributes, from their own values.

    The model keeps the corrections, which are zero where the simulator is right.
    """
    told = dataclasses.replace(told, findings=_without_gain_by_load(told.findings))
    rate = float(told.recording["sample_rate"])
    own = {key: a._replace(between=1 / rate) if a.unit == "s" else a for key, a in own.items()}
    findings = [_reworded(f, own) if f.effect == MISMATCH else f for f in told.findings]
    wrong = {n for f in findings if f.effect == MISMATCH for n in f.parameters} - {GAIN}
    corrected = told.model.parameters
    now = {n: a.value + (float(corrected[n]) if n in wrong else 0.0) for n, a in own.items()}
    findings = [f if f.effect == MISMATCH else _late(_stepped(f, own, now), own) for f in findings]
    values = {
        name: _absolute(estimate, own[name]) if name in own and name != GAIN else estimate
        for name, estimate in told.baseline_parameters.items()
    }
    verdict = claimed(told.verdict, findings)
    return dataclasses.replace(told, findings=findings, baseline_parameters=values, verdict=verdict)


def _without_gain_by_load(findings: Sequence[Finding]) -> list[Finding]:
    """The findings without a gain that friction by the motor's own force makes.

    Of u = f + μ abs(u) sign v, by the whole force, all is 1/(1 − μ²) times what it is of
    f + μ abs(f) sign v, by the force without that friction: no torque constant is wrong.
    """
    shares = [
        float(next(iter(f.parameters.values())).value)
        for f in findings
        if f.effect == LOAD_DEPENDENT_FRICTION.name
    ]
    found = []
    for finding in findings:
        gain = finding.parameters.get(GAIN) if finding.effect == MISMATCH else None
        made = gain is not None and any(
            abs(float(gain.value) - 1 / (1 - share**2) + 1) < share**3 + float(gain.half_width())
            for share in shares
            if abs(share) < 1
        )
        if made:
            others = {n: m for n, m in finding.parameters.items() if n != GAIN}
            finding = finding._replace(parameters=others)
        if finding.parameters or not made:
            found.append(finding)
    return found


def claimed(verdict: str, findings: Sequence[Finding]) -> str:
    """The verdict in a simulator's words: it is `explained` only by values that can be told."""
    doubtful = verdict == "explained" and any(finding.untold for finding in findings)
    return "partly_explained" if doubtful else verdict


def _absolute(estimate: Estimate, attribute: Attribute) -> Estimate:
    return estimate._replace(value=np.float64(attribute.value + estimate.value))


def _reworded(finding: Finding, own: Mapping[str, Attribute]) -> Finding:
    every = _attributes(finding.parameters, own)
    moved = {n: m for n, m in every.items() if not (_unsure(n, m, own) or impossible(n, m))}
    texts = [_text(n, m, own) + _doubt(n, finding.instead, own) for n, m in moved.items()]
    rivals = tuple(r for r in finding.confusable_with if not _same(r, moved))
    texts += _untold({n: m for n, m in every.items() if n not in moved}, own)
    texts.append(f"{unexplained(finding.share)}{indistinct(rivals)}.")
    geared = {_gear(own)} - {GAIN}
    names = [n for n in moved if n in own or n in geared or n.endswith(REFERENCE)]
    return finding._replace(
        parameters=moved,
        confusable_with=rivals,
        sentence=f"Wrong in the simulator: {'; '.join(texts)}",
        attribute=", ".join(names) or None,
        untold=tuple(n for n in every if n not in moved),
    )


def _unsure(name: str, m: Moved, own: Mapping[str, Attribute]) -> bool:
    """Whether a value may be what it was; of a gain also whether it may be none."""
    low, high = map(float, m.interval())
    return m.may_be_none or (name == _gear(own) and not (low > 0 or high < 0))


def impossible(name: str, m: Moved) -> bool:
    """Whether a value is below zero, and nothing can be: a mass, or a damping."""
    return name.split("/")[-1].partition("_")[0] in POSITIVE and m.value < 0


def _untold(others: Mapping[str, Moved], own: Mapping[str, Attribute]) -> list[str]:
    """Values that are fitted with those that are wrong, in words: those that nothing can have, and
    the names of those that may be as they were.
    """
    texts = [
        f"{_text(name, m, own)}, which cannot be below zero: something else is wrong"
        for name, m in others.items()
        if not _unsure(name, m, own)
    ]
    unsure = [_name(name, own) for name, m in others.items() if _unsure(name, m, own)]
    if unsure:
        said = listed(unsure, f"{len(unsure) - MOST} others")
        texts.append(f"perhaps {said}, by an amount that this recording cannot tell")
    return texts


def _name(name: str, own: Mapping[str, Attribute]) -> str:
    """An attribute in words, without its value."""
    if name == CONSTANT:
        return "a constant force"
    key = GAIN if name == _gear(own) else name
    return str(own[key]) if key in own else " of ".join(reversed(name.split("/")[1:]))


def _same(rival: str, moved: Mapping[str, Moved]) -> bool:
    """Whether an effect is what a wrong attribute says: a spring that is the joint's stiffness."""
    springs = any(law.in_joint == "spring" for law in EFFECTS[rival].laws)
    return springs and any(name.endswith(f"/{STIFFNESS}") for name in moved)


def _attributes(moved: Mapping[str, Moved], own: Mapping[str, Attribute]) -> dict[str, Moved]:
    """The wrong values as attributes: a gain as a gear, a constant force as a spring's rest."""
    found = {}
    for name, m in moved.items():
        if name == GAIN:
            before, times = own[GAIN].value, 1 + float(m.value)
            # A gain of less force for each command, where more of it is recorded.
            value = before * times if own[GAIN].what == GAIN else before / times
            error = float(m.standard_error) * abs(value / times)
            now = m.estimate._replace(
                value=np.float64(value), standard_error=error, unit=own[GAIN].unit
            )
            found[_gear(own)] = Moved(before, now)
        elif name in own:
            before = own[name].value
            # What a command does between its samples is anywhere within one of them.
            error = np.hypot(m.standard_error, own[name].between / np.sqrt(12))
            value = np.float64(before + m.value)
            found[name] = Moved(before, m.estimate._replace(value=value, standard_error=error))
        else:
            found[name] = m
    return _sprung(found, own)


def _gear(own: Mapping[str, Attribute]) -> str:
    """The name of the gain: the actuator's gear, or what else says it, where there is one.

    A model whose force the joint's own values make alone has no gain beside them.
    """
    attribute = own.get(GAIN)
    if attribute is None or attribute.what == GAIN:
        return GAIN
    return f"{attribute.owner.replace(' ', '/', 1)}/{attribute.what}"


# Without a command in the log, what else a constant force may be.
MAY_BE = (
    "the actuator's bias, which a log of its command would show, the zero of the force's sensor, "
    "a weight or a tilt that the model lacks, or friction that differs with the direction"
)
# A filter that the model's actuator lacks, in MuJoCo's own words.
FILTER = "filterexact"


def _late(finding: Finding, own: Mapping[str, Attribute]) -> Finding:
    """A delay or a lag as the actuator's attribute, where the joint has one."""
    effect, owner = EFFECTS.get(finding.effect), own[GAIN].owner if GAIN in own else ""
    if effect is None or not effect.late or effect.logged or not owner.startswith("actuator "):
        return finding
    what = effect.shift or "dynprm[0]"
    name = f"{owner.replace(' ', '/', 1)}/{what}"
    if effect.shift or name in own:
        return finding._replace(attribute=name)
    time = quantity(next(iter(finding.parameters.values())), smaller=False)
    text = f"{owner}: dyntype none → {FILTER}, dynprm[0] 0 → {time}: {finding.sentence}"
    return finding._replace(attribute=name, sentence=text)


def _sprung(found: dict[str, Moved], own: Mapping[str, Attribute]) -> dict[str, Moved]:
    """A constant force beside a spring is where that spring rests."""
    name = next((n for n in own if n.endswith(f"/{STIFFNESS}")), None)
    if name is None or CONSTANT not in found:
        return found
    stiffness = float(found[name].value) if name in found else own[name].value
    before, constant = own[name].rest, found[CONSTANT]
    if not stiffness > 0:
        return found
    reference = constant.estimate._replace(
        value=np.float64(before - float(constant.value) / stiffness),
        standard_error=float(constant.standard_error) / stiffness,
        unit="rad" if "rad" in own[name].unit else "m",
    )
    others = {key: m for key, m in found.items() if key != CONSTANT}
    return others | {name.replace(STIFFNESS, REFERENCE): Moved(before, reference)}


# What a joint calls the parameters of laws that may change at a moment.
OF_LAW = {"viscous": "damping", "coulomb": "frictionloss", "inertia": "armature"}


def _stepped(finding: Finding, own: Mapping[str, Attribute], now: Mapping[str, float]) -> Finding:
    """The change of an attribute at a moment: "joint elbow's damping changes from 0.5 to 1.1".

    **Arguments:** `now`, the values of the attributes with what is wrong of them put right.
    """
    moment = EFFECTS[finding.effect].moment
    changed = {n: e for n, e in finding.parameters.items() if n != moment}
    if not moment or len(changed) != 1:
        return finding
    (name, change), moment_ = next(iter(changed.items())), finding.parameters[moment]
    key = _attribute_of(name, own)
    if key is None or not isinstance(change, Estimate) or not isinstance(moment_, Estimate):
        return finding
    before, attribute = now[key], own[key]
    after = change._replace(value=np.float64(before + change.value), unit=attribute.unit)
    moved = Moved(before, after)
    keys = {n: _attribute_of(n, own) or n for others in finding.instead.values() for n in others}
    instead = {key: tuple(keys.values())} if keys else {}
    value = quantity(after, smaller=False)
    reason = finding.sentence.partition(";")[0].partition(": ")[2]
    text = f"At t = {quantity(moment_)} {attribute.owner}'s {attribute.what} "
    share = f"{unexplained(finding.share)}{indistinct(finding.confusable_with)}."
    if impossible(key, moved):
        text += f"would have to change from {before:.4g} to {value}, which cannot be below zero: "
        return finding._replace(sentence=f"{text}something else changes; {share}", untold=(key,))
    text += f"changes from {before:.4g} to {value}{_doubt(key, instead, own)}"
    return finding._replace(
        parameters={**finding.parameters, key: moved}, attribute=key, instead=instead,
        sentence=f"{text}{reason and f': {reason}'}; {share}",
    )  # fmt: skip


def _attribute_of(name: str, own: Mapping[str, Attribute]) -> str | None:
    """The attribute that a parameter of a change is, `step_viscous` for instance."""
    stem = name.partition("_")[2]
    what = OF_LAW.get(stem, "")
    ends = (n for n in own if n.startswith("joint/") and n.endswith(f"/{what}"))
    return stem if stem in own and stem != GAIN else next(ends, None) if what else None


def _text(name: str, m: Moved, own: Mapping[str, Attribute]) -> str:
    """One wrong value: "joint elbow: damping 0.5 → 1.10 N·m·s/rad ± 0.02 N·m·s/rad"."""
    said = quantity(m.estimate, smaller=name == CONSTANT)
    if name == CONSTANT:
        return f"a constant force of {said}, for which it has no attribute (it may be {MAY_BE})"
    if name == GAIN:
        size = quantity(m.estimate._replace(value=abs(m.value), unit=""))
        if m.value < 0:
            return (
                f"the recorded force is counted the other way, and is {size} times the "
                "simulator's (--scale force=-1)"
            )
        return f"the recorded force (the torque constant) is {size} times the simulator's"
    if name == _gear(own):
        times = _times(m) if own[GAIN].what == "gear" else ""
        return f"{own[GAIN].owner}: {own[GAIN].what} {m.before:.4g} → {said}{times}"
    if name in own:
        attribute = own[name]
        text = f"{attribute.owner}: {attribute.what} {attribute.value:.4g} → {said}"
        missing = attribute.what == STIFFNESS and not attribute.value and m.value > 0
        return f"missing, a spring: {text}" if missing else text
    kind, owner, what = name.split("/")
    return f"{kind} {owner}: {what} {m.before:.4g} → {said}"


def _times(m: Moved) -> str:
    """What another gain is of the recorded force."""
    times = float(m.before) / float(m.value)
    if times < 0:
        return f" (the recorded force is counted the other way, {-times:.4g} times the simulator's)"
    return f" (the recorded force, or the torque constant, is {times:.4g} times the simulator's)"


def _doubt(name: str, instead: Mapping[str, tuple[str, ...]], own: Mapping[str, Attribute]) -> str:
    """What else it may be: what no motion tells from it, and what this one does not."""
    key = GAIN if name == _gear(own) else name
    texts, alike = [], [str(each) for each in own[key].alike] if key in own else []
    if alike:
        said = listed(alike, f"{len(alike) - MOST} others")
        texts.append(f"or {said}: no motion of this joint tells them apart")
    if others := instead.get(key):
        names = [str(own[n]) if n in own else "a constant force" for n in others]
        texts.append(f"or {listed(names, 'others')}: this motion cannot tell them apart")
    return f" ({'; '.join(texts)})" if texts else ""


def listed(names: Sequence[str], others: str) -> str:
    """The first names of a list, and that there are others."""
    return " or ".join([*names[:MOST], *([others] if len(names) > MOST else [])])
