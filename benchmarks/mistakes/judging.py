"""What came of a case: right, refused, warned, or wrong without a word."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from .logs import Log
from .mistake import Mistake

OUTCOMES = ("right", "refused", "warned", "rescaled", "wrong in silence", "crashed")
# Verdicts that say that something is left.
UNSURE = ("unexplained", "partly_explained")
# Warnings that a velocity may be off by more than a hundredth: true where it is.
OF_THE_DERIVATIVE = {"velocity_noise", "coarse_sampling"}
UNRESOLVED = 0.01
# A figure is wrong from a quarter on.
QUARTER = 0.25
# Parameters are compared as forces: viscous friction at the top speed, inertia at the hardest
# acceleration. One that makes under a fifth of the sum of these forces may err by as much as one
# that makes a fifth: a twentieth of the force.
LEAST_SHARE = 0.2


class Ran(NamedTuple):
    """One command: its exit status, what it printed, and its JSON where it wrote any."""

    status: int
    printed: str
    complained: str
    document: Mapping[str, Any] | None


class Verdict(NamedTuple):
    """An outcome, the figures that are off, and what gave a warning."""

    outcome: str
    off: list[str]
    signs: list[str]


def forces(log: Log) -> dict[str, float]:
    """By how much each parameter that matters is multiplied to be a force."""
    weights = {"inertia": log.hardest}
    for sign in "+-":
        weights |= {f"coulomb{sign}": 1.0, f"viscous{sign}": log.top}
    return weights


def off(parameters: Mapping[str, Any], log: Log) -> list[str]:
    """The parameters that are off by more than a quarter and outside of their 95 % intervals."""
    weights, truth = forces(log), log.truth
    level = 0.5 * sum(abs(truth[k]) * w for k, w in weights.items() if k != "inertia")
    level += abs(truth["inertia"]) * weights["inertia"]
    found = []
    for name, weight in weights.items():
        if (entry := parameters.get(name)) is None or (ends := entry.get("interval")) is None:
            continue  # it says that it does not know
        value, half = entry["value"], (ends[1] - ends[0]) / 2
        error = abs(value - truth[name])
        limit = QUARTER * max(abs(truth[name]) * weight, LEAST_SHARE * level)
        if error * weight > limit and error > half:
            found.append(f"{name} {value:.3g} ± {half:.1g} for {truth[name]:.3g}")
    return found


def signs(document: Mapping[str, Any]) -> list[str]:
    """What in a document tells the reader to beware."""
    found = [remark["name"] for remark in document.get("warnings") or []]
    notes = document.get("recording", {}).get("notes", [])
    found += ["note: " + note[9:70] for note in notes if note.startswith("Warning")]
    if "describe the recording badly" in document.get("diagnosis", ""):
        found.append("describes badly")
    return found


def identified(ran: Ran, log: Log, mistake: Mistake | None, own_error: float) -> Verdict:
    """The verdict on an identification; `own_error`: the force error of the healthy log."""
    if (short := _without_document(ran)) is not None:
        return short
    document = ran.document
    if document["result"] != "successful":
        return Verdict("refused", [], [document["result"], *signs(document)])
    wrong = off(document["parameters"], log)
    if _more(document["force_error"], own_error):
        wrong.append(f"force error {document['force_error']:.0%}")
    if beware := signs(document):
        return Verdict("warned", wrong, beware)
    if not wrong:
        return Verdict("right", [], [])
    if mistake is not None and mistake.rescaling and "force in" in ran.printed:
        return Verdict("rescaled", wrong, [])
    return Verdict("wrong in silence", wrong, [])


def _more(error: float | None, own: float) -> bool:
    return error is None or (math.isfinite(own) and error - own > QUARTER)


def explained(ran: Ran, log: Log, mistake: Mistake | None) -> Verdict:
    """The verdict on an explanation.

    It is wrong in silence if the model is worse after than before, here or held out, or if
    nothing, or everything, is said to be explained while the parameters are off or most of the
    force is left. A finding that is the mistake by another name (a delay) is no silence.
    """
    if (short := _without_document(ran)) is not None:
        return short
    document = ran.document
    worse = _worse(document["fit"])
    effects = {finding["effect"] for finding in document["findings"]}
    near = {name for finding in document["findings"] for name in finding["confusable_with"]}
    said = document["verdict"] in UNSURE
    beware = signs(document) + [document["verdict"]] * said
    if mistake is not None:
        beware += sorted(mistake.effects & (effects | near))
    wrong = off(document["baseline"]["parameters"], log) if not effects else []
    left = document["fit"]["force_error"]["after"]
    if left is None or left > 1 - QUARTER:
        wrong.append(f"force error {_share(left)} after")
    held = (document["fit"].get("holdout_force_error") or {"after": 0.0})["after"]
    if mistake is not None and mistake.held_out and _more(held, left or 0.0):
        wrong.append(f"held-out force error {_share(held)}")
        beware += ["held-out sentence"] * (HELD_OUT in document["summary"])
    if worse and not signs(document):
        return Verdict("wrong in silence", [*worse, *wrong], beware)
    if beware:
        return Verdict("warned", wrong + worse, beware)
    if not wrong:
        return Verdict("right", [], sorted(effects))
    if mistake is not None and mistake.rescaling:
        return Verdict("rescaled", wrong, [])
    return Verdict("wrong in silence", wrong, sorted(effects))


# How an explanation says that its values do not carry over.
HELD_OUT = "But the held-out recording"


def _share(value: float | None) -> str:
    return "without a value" if value is None else f"{value:.0%}"


def _worse(fit: Mapping[str, Any]) -> list[str]:
    found = []
    for what in ("force_error", "holdout_force_error"):
        pair = fit.get(what)
        if pair and None not in pair.values() and pair["after"] > pair["before"] * 1.001 + 1e-6:
            found.append(f"{what} {pair['before']:.1%} → {pair['after']:.1%}")
    return found


def _without_document(ran: Ran) -> Verdict | None:
    if ran.status == 2 and ran.complained.strip():
        return Verdict("refused", [], [ran.complained.strip()[:300]])
    if ran.status != 0 or ran.document is None:
        return Verdict("crashed", [], [ran.complained.strip()[-300:]])
    return None


def worst(verdicts: Sequence[Verdict]) -> Verdict:
    """The one that counts where several commands were run."""
    order = ("crashed", "wrong in silence", "warned", "refused", "rescaled", "right")
    return min(verdicts, key=lambda verdict: order.index(verdict.outcome))
