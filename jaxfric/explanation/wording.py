"""The summary of an explanation in words."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..checks import LEFT
from ..data.printable import listed_and
from ..terms.effects import EFFECTS
from .beyond import FAST_TONE
from .fewest import SHAPE
from .finding import Finding
from .sentences import CONSTANT_APART, SIDES, constant_force

VERDICTS = {
    "consistent": "Nothing is missing: what the model leaves is no more than noise.",
    "explained": "The named physics accounts for what the model leaves out.",
    "partly_explained": "Named physics accounts for a part; structure is left, or terms overlap.",
    "unexplained": "Something is missing that no effect of the library accounts for.",
}


# The same where the baseline is another recording.
CHANGES = {
    "consistent": "Nothing differs between the two recordings beyond the noise.",
    "explained": "What is named accounts for the difference between the two recordings.",
    "partly_explained": "What is named accounts for a part of the difference between the two "
    "recordings; more is left.",
    "unexplained": "The two recordings differ by something that no effect of the library "
    "accounts for.",
}


# Of `unexplained`, where the held-out recording does not bear out what would account for it here.
REFUTED = "Something is missing, and no effect accounts for it in both recordings."
# Of `unexplained`, where both recordings show it, but not with values that are known well enough.
RECURS = "Something is missing, and its values from here do not hold in the other recording."
# Of `unexplained`, where a model with what would account for it is worse sample by sample.
SHAPED = "Something is missing, and the model is not better with what accounts for it."
# Instead of a verdict's words, where what was measured contradicts itself.
DOUBTED = "Until that is put right, nothing is named."


def summary(
    verdict: str,
    baseline: str,
    findings: Sequence[Finding],
    not_confirmed: Sequence[Finding],
    fit: Mapping[str, Any],
    warnings: Sequence[Mapping[str, Any]],
) -> str:
    """The verdict in words: what is certain to be wrong first, then the force errors."""
    severe = [each["text"] for each in warnings if each["severe"]]
    other = [each["text"] for each in warnings if each["name"] == "not_better"]
    words = CHANGES if baseline.startswith("recording") else VERDICTS
    shaped = any(finding.confirmed is None for finding in not_confirmed)
    not_confirmed = [finding for finding in not_confirmed if finding.confirmed is False]
    if verdict == "unexplained" and not_confirmed:
        words = words | {verdict: RECURS if all(f.recurs for f in not_confirmed) else REFUTED}
    elif shaped:
        words = words | {"unexplained": SHAPED}
    said = DOUBTED if severe and not findings else words[verdict]
    refuted = [
        _not_confirmed(some, recurs)
        for recurs in (True, False)
        if (some := [f for f in not_confirmed if f.recurs == recurs])
    ]
    hums = any(each["name"] == FAST_TONE for each in warnings)
    errors = f"{_errors(fit, bool(findings))}.{'' if hums else _by_sample(fit, verdict)}"
    if not severe and describes_nothing(fit["force_error"]["before"], fit.get("noise_floor")):
        errors = f"{errors} {nothing_described(verdict)}"
    whole = [*severe, said, *other, *refuted, errors]
    if severe and not findings:  # of such data there is no more to say
        return " ".join(whole)
    told = any(each["name"] in (HOLDS_MORE, HOLDS_OTHER) for each in warnings)
    more = [] if told else _more_there(fit, verdict)
    elsewhere = _not_determined(fit, verdict, findings, told)
    return " ".join([*whole, *(elsewhere or _of_a_moment(findings, fit) or more)])


# With this error, relative to the force, a model is no better than none: zero errs by as much.
NOTHING = 1.0


def describes_nothing(before: float, noise: float | None) -> bool:
    """Whether a baseline with this force error is no better than none, and it is not the noise
    that most of that is.
    """
    return before >= NOTHING and not (noise or 0.0) ** 2 > 0.5 * before**2


def nothing_described(verdict: str) -> str:
    """That the baseline describes nothing of the force, and what to check where nothing else
    accounts for it.
    """
    said = "Before, the model describes nothing of this force: zero would err no more."
    if verdict == "explained":
        return said
    return f"{said} Check the sign, the unit and the column of the force first."


def _not_confirmed(findings: Sequence[Finding], recurs: bool) -> str:
    names = dict.fromkeys(finding.effect.replace("_", " ") for finding in findings)
    if recurs:
        return (
            f"The held-out recording shows {' and '.join(names)} too, but with the values from "
            "here the model is worse, so that it is left out."
        )
    return (
        f"What looks like {' and '.join(names)} here does not make the model better on the "
        "held-out recording, and is left out of the model."
    )


def unexplained(where: Sequence[Mapping[str, Any]], not_confirmed: Sequence[Finding]) -> str:
    """Of a joint that nothing explains, in a line: where most is left, and what was refuted."""
    said = []
    if where:
        most = max(where, key=lambda each: each["share"])
        over, detail = most["coordinate"].replace("_", " "), most["detail"]
        more = f": {detail}" if detail else ""
        said.append(f"most that the model leaves follows {over} ({most['share']:.0%}{more})")
    for confirmed, why in _REFUSED.items():
        own = [each for each in not_confirmed if each.confirmed is confirmed]
        names = dict.fromkeys(each.effect.replace("_", " ") for each in own)
        if names:
            said.append(f"it looks like {listed_and(list(names))}, {why}")
    return f"Not explained: {'; '.join(said) or 'no place stands out, and nothing fits'}."


# Why what fits the rows is not in the model.
_REFUSED = {
    None: "with which the model is worse sample by sample",
    False: "which the held-out recording does not confirm",
}


def _errors(fit: Mapping[str, Any], found: bool) -> str:
    """The force errors, and what of them is noise."""

    def said(error: Mapping[str, float]) -> str:
        after = f" before, {error['after']:.2%} after" if found else ""
        return f"{error['before']:.2%}{after}"

    text = f"Force error {said(fit['force_error'])}"
    if held := fit.get("holdout_force_error"):
        text += f"; on the held-out recording{adjusted(fit)} {said(held)}"
    if (floor := fit.get("noise_floor")) is not None and math.isfinite(floor):
        text += f"; {floor:.2%} is what noise alone makes"
        there = fit.get("holdout_noise_floor")
        if held and there is not None and held["after"] > ELSEWHERE * floor:
            text += f", and {there:.2%} there" * math.isfinite(there)
    return text


# A third of the force, a tenth of its power.
LARGE = 0.3


def _by_sample(fit: Mapping[str, Any], verdict: str) -> str:
    """What most of a large error is that no filter leaves: noise, or short events.

    Of a smaller error too where nothing is said to be missing, and most of it is no noise.
    """
    if "filtered_force_error" not in fit:
        return ""
    whole, filtered = fit["force_error"]["after"], fit["filtered_force_error"]["after"]
    floor = fit.get("noise_floor")
    noisy = floor is not None and floor**2 > 0.5 * whole**2
    if filtered > 0.5 * whole:
        return ""
    claimed = verdict in ("consistent", "explained")
    if claimed and floor is not None and floor < 0.5 * whole <= 0.5 * LEFT:
        return (
            " What is more than that is short, as beside reversals: "
            f"{filtered:.2%} is left through a filter."
        )
    if not whole > (LARGE if noisy else LEFT):
        return ""
    if noisy:
        what = "the noise of the acceleration"
    else:
        what = "left in short events, as beside reversals, for which the values are no good"
    return f" Sample by sample most of it is {what}: {filtered:.2%} is left through a filter."


_ADJUSTED = (
    ("rephased", "at another phase"),
    ("changed_before", "as after the change"),
    ("left_out", "left out"),
)


def adjusted(fit: Mapping[str, Any]) -> str:
    """Which findings the held-out figures take otherwise than the saved model has them."""
    adjusted = fit.get("holdout_adjusted") or {}
    parts = [
        f"{' and '.join(name.replace('_', ' ') for name in adjusted[key])} {how}"
        for key, how in _ADJUSTED
        if adjusted.get(key)
    ]
    return f" ({', '.join(parts)})" * bool(parts)


# Other values of the same model leave less than half of a held-out recording's error, a quarter of
# its power: then most of it is not physics that the model lacks.
ELSEWHERE = 2.0
# A held-out recording that is left with more than half of its force is hardly of the same machine.
OTHER = 0.5
# The warning of one in which something acts that does not act in the recording itself.
HOLDS_MORE = "holdout_holds_more"
# That of one for which other values hold.
HOLDS_OTHER = "holdout_differs"


def _found_of(fit: Mapping[str, Any]) -> float:
    """The part of the held-out force, through the filter, that the findings account for."""
    errors = fit["filtered_holdout_force_error"]
    return math.sqrt(max(errors["before"] ** 2 - errors["after"] ** 2, 0.0))


def _not_determined(
    fit: Mapping[str, Any], verdict: str, findings: Sequence[Finding], warned: bool
) -> list[str]:
    """That other values hold on the held-out recording, or none that this one determines, whether
    that is a fault of the model, and what to do. `warned`: whether a warning says why.
    """
    refitted = fit.get("filtered_holdout_refitted_error")
    if refitted is None or fit["filtered_holdout_force_error"]["after"] <= ELSEWHERE * refitted:
        return []
    # Of what was found a tenth of the amplitude may be another shape than the law's.
    small = fit["filtered_holdout_force_error"]["after"] < SHAPE * _found_of(fit)
    if small and not fit.get("holdout_values"):
        return []
    through = f"{fit['filtered_holdout_force_error']['after']:.2%}"
    text = (
        f"But through the search's filter {through} of the held-out force is left, and "
        f"{refitted:.2%} where the model is fitted to that one: "
    )
    if constant := constant_apart(fit):
        return [f"{text}there a constant force of {constant} more acts. {CONSTANT_APART}"]
    values = ", ".join(
        _differs(name, **value) for name, value in (fit.get("holdout_values") or {}).items()
    )
    if anew := begins_anew(findings):
        return [f"{text}there {values or 'other values hold'}.{'' if warned else f' {anew}'}"]
    if values:
        return [
            f"{text}there {values}. Either the machine changed in between, or no model of this "
            "kind holds for both motions."
        ]
    if verdict == "consistent" and _noise_there(fit):
        return [
            f"{text}no physics is missing there either, but this recording does not determine the "
            "values that hold there. That matters only where they are used for such a motion: then "
            "identify on one that moves like it."
        ]
    return [
        f"{text}this recording does not determine the values that hold there. Identify on one that "
        "moves like both."
    ]


def _noise_there(fit: Mapping[str, Any]) -> bool:
    """Whether the model leaves no more than noise of the held-out recording with values of its own:
    less than `ELSEWHERE` times what noise alone makes there.
    """
    left, floor = fit.get("holdout_refitted_error"), fit.get("holdout_noise_floor")
    return left is not None and floor is not None and left < ELSEWHERE * floor


def begins_anew(findings: Sequence[Finding]) -> str:
    """That what was found begins anew in each recording, a sentence; empty where none does."""
    names = [f.effect.replace("_", " ") for f in findings if EFFECTS[f.effect].settles]
    if not names:
        return ""
    return (
        f"{' and '.join(dict.fromkeys(names)).capitalize()} begins anew in each recording and "
        "depends on how the axis has moved, so that the held-out one need not have the same: that "
        "shows no other change of the machine. Record both warm, or explain that one by itself."
    )


def constant_apart(fit: Mapping[str, Any]) -> str | None:
    """The constant force by which the held-out recording alone differs, in words; `None` where it
    differs otherwise.

    It adds to the Coulomb level of one direction what it takes off the other's.
    """
    values = fit.get("holdout_values") or {}
    if set(values) == {"offset"}:
        (one,) = values.values()
        change, error = one["there"] - one["here"], one["standard_error"]
    elif set(values) == {*SIDES}:
        one, other = (values[side] for side in SIDES)
        found = constant_force(
            *((v["there"] - v["here"], v["standard_error"]) for v in (one, other))
        )
        if found is None:
            return None
        change, error = found
    else:
        return None
    digits = max(0, 1 - math.floor(math.log10(2 * error)))
    return f"{change:.{digits}f} {one['unit']}"


# More than half of a mismatch's size is most of it; so it is not what was found here, of which less
# than half is left.
MOST = 0.5


def _of_a_moment(findings: Sequence[Finding], fit: Mapping[str, Any]) -> list[str]:
    """That what need not recur leaves most of the held-out recording's error as it was."""
    moments = {name for name, effect in EFFECTS.items() if effect.momentary}
    names = [f.effect.replace("_", " ") for f in findings if f.effect in moments]
    pairs = [fit.get("force_error"), fit.get("holdout_force_error")]
    if not names or any(pair is None for pair in pairs):
        return []
    here, held = (pair["after"] / max(pair["before"], 1e-300) for pair in pairs)
    noise = pairs[1]["after"] < ELSEWHERE * (fit.get("noise_floor") or 0.0)
    if here > MOST or held < MOST or noise:
        return []
    return [
        f"But {' and '.join(names)} need not recur, and most of what the held-out recording shows "
        f"is left, {pairs[1]['after']:.2%}: explain that one by itself."
    ]


def _more_there(fit: Mapping[str, Any], verdict: str) -> list[str]:
    """That nothing is missing here, but the held-out recording is left with more than its noise."""
    floors = fit.get("noise_floor"), fit.get("holdout_noise_floor")
    if verdict != "consistent" or not all(floor and math.isfinite(floor) for floor in floors):
        return []
    here, held = (
        fit[name]["after"] / floor
        for name, floor in zip(("force_error", "holdout_force_error"), floors, strict=True)
    )
    if held < ELSEWHERE * max(here, 1.0):
        return []
    return [
        "But the held-out recording is left with more than its noise: something shows there that "
        "does not show here. Explain that one, with this one held out."
    ]


def _differs(name: str, here: float, there: float, standard_error: float, unit: str) -> str:
    digits = max(0, 1 - math.floor(math.log10(2 * standard_error)))
    unit = f" {unit}" if unit not in ("", "1") else ""
    return f"{name} is {there:.{digits}f} instead of {here:.{digits}f}{unit}"
