"""What to do after an explanation, in an engineer's order."""

from collections.abc import Mapping
from typing import Any

from ..data.printable import listed_and
from ..terms.effects import EFFECTS
from ..terms.effects.parameter_mismatch import MISMATCH

# More steps than this are no advice.
MOST = 4
# A share of the force beyond what noise makes that is worth another look.
WORTH = 1.3


def spoken(name: str) -> str:
    """A name in words."""
    return str(name).replace("_", " ")


def headline(document: Mapping[str, Any]) -> str:
    """The verdict in one sentence."""
    severe = [each["text"] for each in document.get("warnings") or () if each.get("severe")]
    if severe and not document.get("findings"):
        return severe[0]
    errors = _errors(document.get("fit") or {})
    findings = document.get("findings") or ()
    names = [spoken(f["effect"]) for f in findings if f["effect"] != MISMATCH]
    wrong = [f["sentence"].rpartition(";")[0] for f in findings if f["effect"] == MISMATCH]
    where = [spoken(p["coordinate"]) for p in document.get("where") or ()]
    shown = _listed(names)
    if wrong and document["verdict"] in ("explained", "partly_explained"):
        beside = f"; the model also leaves out {shown}" if names else ""
        left = "; more is left" if document["verdict"] == "partly_explained" else ""
        return f"{wrong[0]}{beside}{left}{errors}."
    if _compared(document):
        return {
            "consistent": f"Nothing differs between the two recordings beyond the noise{errors}.",
            "unexplained": "The two recordings differ by something that no effect of the library "
            f"accounts for{errors}.",
        }.get(document["verdict"], f"Since the other recording {shown} has come{errors}.")
    return {
        "consistent": f"Nothing is missing beyond the noise{errors}.",
        "explained": f"The model leaves out {shown}, which accounts for the mismatch{errors}.",
        "partly_explained": f"The model leaves out {shown}; that is a part of the mismatch, and "
        f"more is left{errors}.",
        "unexplained": f"Something is missing{_unaccounted(document)}"
        + (f", most of it over {where[0]}" if where else "")
        + f"{errors}.",
    }.get(document["verdict"], f"{spoken(document['verdict'])}{errors}.")


def _unaccounted(document: Mapping[str, Any]) -> str:
    """Why nothing accounts for what is missing."""
    others = document.get("not_confirmed") or ()
    left_out = {each["confirmed"] for each in others}
    if others and all(each.get("recurs") for each in others):
        return ", and its values from here do not hold in the other recording"
    if False in left_out:
        return ", and no effect accounts for it in both recordings"
    if None in left_out:
        return ", and the model is not better with what accounts for it"
    return " that no effect of the library accounts for"


def _compared(document: Mapping[str, Any]) -> bool:
    """Whether the baseline is another recording."""
    return ((document.get("baseline") or {}).get("name") or "").startswith("recording")


def _errors(fit: Mapping[str, Any]) -> str:
    error = fit.get("force_error")
    if not error or error.get("before") is None:
        return ""
    before, after = error["before"], error.get("after")
    if after is None or after == before:
        return f": force error {before:.2%}"
    return f": force error {before:.2%} before, {after:.2%} after"


def _listed(names: list[str]) -> str:
    """Names, the same one counted."""
    counted = [f"{n} ({names.count(n)} ×)" if names.count(n) > 1 else n for n in names]
    return listed_and(list(dict.fromkeys(counted))) or "something"


def steps(document: Mapping[str, Any]) -> list[str]:
    """What to do next, the first thing first."""
    verdict, findings = document["verdict"], document.get("findings") or ()
    warned = [each for each in document.get("warnings") or () if each.get("severe")]
    if warned:
        return [
            "Put right what the warning says and explain again: until then the figures do not hold."
        ]
    found = []
    fit = document.get("fit") or {}
    if _compared(document) and not findings:
        return ["Keep this recording, and compare the next one with it (--baseline)."]
    if not fit.get("holdout_force_error"):
        found.append(
            "Record a second run with the same motion and give it as --holdout: it shows whether "
            "the answer holds on data that it was not fitted to."
        )
    for finding in document.get("not_confirmed") or ():
        name = spoken(finding["effect"])
        found.append(
            f"What looks like {name} here does not make the model better on the held-out "
            "recording, and is not in the model: record both motions once more, to see which holds."
            if finding["confirmed"] is False
            else f"Look at the machine for {name}: the recording has the shape of it, but a model "
            "with it does not meet the force sample by sample."
        )
    for finding in findings:
        if finding.get("confusable_with"):
            known = EFFECTS.get(finding["effect"])
            how = finding.get("separate_by") or (known.separate_by if known else "")
            others = " or ".join(map(spoken, finding["confusable_with"][:3]))
            if how:
                found.append(f"To tell {spoken(finding['effect'])} from {others}: {_lower(how)}")
    found = list(dict.fromkeys(found))[: MOST - 1]
    if verdict == "unexplained":
        found.append(
            "Look at the pictures below for what the mismatch follows, and record the signal that "
            "could cause it (load, temperature, another axis) beside the motion."
        )
    elif verdict == "consistent":
        found.append("Use the model as it is; below is what this recording could not have shown.")
    elif findings:
        found.append(
            "Save the improved model (--save model.json) and use it: jaxfric export model.json "
            "--to st, c, mujoco …; the code is below."
        )
    return found


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]
