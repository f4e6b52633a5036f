"""What the page says of an explanation, as text and rows of tables."""

import math
from collections.abc import Mapping
from typing import Any

from ..terms.effects.parameter_mismatch import MISMATCH
from . import charts, equations
from .advice import spoken

_NONE = "–"
_ERRORS = {
    "force_error": "Force error",
    "holdout_force_error": "… on the held-out recording",
    "simulation_error": "Velocity error, run forward",
}


def errors(fit: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The errors before and after, large."""
    entries = []
    for key, label in _ERRORS.items():
        if fit.get(key):
            before, after = fit[key].get("before"), fit[key].get("after")
            same = before == after
            both = f"{_percent(before)} → {_percent(after)}"
            entries.append((label, _percent(before) if same else both))
    if fit.get("noise_floor") is not None:
        entries.append(("of which noise alone makes", _percent(fit["noise_floor"])))
    return entries


def definitions(fit: Mapping[str, Any]) -> str:
    """What the figures are."""
    if not fit.get("force_error"):
        return ""
    text = (
        "Force error: norm(force − predicted)/norm(force) over the samples in motion, as jaxfric "
        "predict has it with the saved model, noise and all."
    )
    for key, where in (
        ("filtered_force_error", "here"),
        ("filtered_holdout_force_error", "on the held-out recording"),
    ):
        if error := fit.get(key):
            width = f", half-width {1e3 * error['width']:.3g} ms," if error.get("width") else ""
            text += (
                f" Through the kernel by which effects are looked for{width} it is {where} "
                f"{_percent(error.get('before'))} before and {_percent(error.get('after'))} after."
            )
    adjusted = fit.get("holdout_adjusted") or {}
    for key, how in (
        ("left_out", "left out"),
        ("rephased", "taken at its own phase"),
        ("changed_before", "taken as after its change"),
    ):
        if names := adjusted.get(key):
            text += f" On the held-out recording {', '.join(map(spoken, names))} is {how}."
    return text


def averaged(fit: Mapping[str, Any]) -> str:
    """That the pictures over a coordinate show filtered forces."""
    width = (fit.get("filtered_force_error") or {}).get("width")
    if not width:
        return ""
    return (
        f"Forces are averaged over {2e3 * width:.2g} ms here, as in the search for effects: "
        "what changes quicker looks smaller than its amplitude in the text."
    )


def benefit(document: Mapping[str, Any], units: Mapping[str, str]) -> list[tuple[str, ...]]:
    """Tracking error and controller force in closed loop, without and with feed-forward."""
    found = document.get("benefit")
    if not found:
        return []
    runs = [("no feed-forward", found["improved"]["without"])]
    known = (("baseline", "by the baseline"), ("improved", "by the improved model"))
    runs += [(text, found[name]["compensated"]) for name, text in known if name in found]
    return [
        (
            name,
            f"{run['error']:.3g} {units['position']}",
            f"{run['largest_error']:.3g} {units['position']}",
            f"{run['force']:.3g} {units['force']}",
        )
        for name, run in runs
    ]


def cards(document, curves, units, terms) -> list[dict[str, Any]]:
    """Each finding with its picture, its formula in numbers, parameters and facts."""
    findings = document.get("findings") or ()
    shown = list(curves.get("findings") or ())
    left = list(terms)
    cards = []
    for number, finding in enumerate(findings):
        name = spoken(finding["effect"])
        formula = next((row for row in left if row.name == name and _own(row, finding)), None)
        if formula:
            left.remove(formula)
        facts = [("share of the mismatch", _percent(finding.get("share"), 0))]
        if finding.get("holdout_share") is not None:
            facts.append(("held out", _percent(finding["holdout_share"], 0)))
        if finding.get("p_value") is not None:
            facts.append(("by chance", _chance(finding["p_value"])))
        if others := finding.get("confusable_with"):
            facts.append(("could also be", ", ".join(map(spoken, others))))
            if how := finding.get("separate_by"):
                facts.append(("experiment that decides", how))
        cards.append(
            {
                "name": name,
                "sentence": finding.get("sentence") or "",
                "equation": finding.get("equation") or "",
                "formula": formula,
                "chart": charts.finding(shown[number], units["force"])
                if number < len(shown) and shown[number]
                else None,
                "parameters": _told(finding.get("parameters") or {}),
                "facts": facts,
            }
        )
    return cards


def _own(row: equations.Row, finding: Mapping[str, Any]) -> bool:
    """Whether a term of the model is that finding: its numbers stand in the formula."""
    entries = (finding.get("parameters") or {}).values()
    values = [e["value"] for e in entries if e.get("value") is not None]
    text = " ".join((*row.products, *row.values))
    return any(f"{abs(value):.{equations.DIGITS}g}" in text for value in values)


def _told(parameters: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """The parameters of a finding; a wave by amplitude and phase, not by sine and cosine."""
    waves = any(name.startswith("amplitude") for name in parameters)
    return [
        (name, *_estimate(entry))
        for name, entry in parameters.items()
        if not (waves and name.endswith(("_sin", "_cos")))
    ]


def parameters(document: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """All parameters of the improved model, each with its interval."""
    baseline = (document.get("baseline") or {}).get("parameters") or {}
    rows = [(name, *_estimate(entry)) for name, entry in baseline.items()]
    for finding in document.get("findings") or ():
        if finding["effect"] != MISMATCH:
            rows += [
                (name, *_estimate(entry))
                for name, entry in (finding.get("parameters") or {}).items()
                if not name.startswith(("amplitude", "phase"))
            ]
    return rows


def places(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Where the baseline errs, each share with the length of its bar, rem."""
    return [
        {
            "name": spoken(place["coordinate"]),
            "share": _percent(place.get("share"), 0),
            "width": f"{8 * min(max(place.get('share') or 0.0, 0.0), 1.0):.2f}",
            "detail": place.get("detail") or "",
        }
        for place in document.get("where") or ()
    ]


def places_note(document: Mapping[str, Any]) -> str:
    """What the places are, and how sure all of them are."""
    chances = [p["p_value"] for p in document.get("where") or () if p.get("p_value") is not None]
    text = "Coordinates with which the residual of the baseline goes; one cause shows over several."
    return f"{text} Each is beyond chance (p ≤ {max(chances):.2g})." if chances else text


def sanity(document: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """What was looked at before any physics: what, whether it is wrong, and in words."""
    return [
        (spoken(row["check"]), "wrong" if row["wrong"] else "", row["text"])
        for row in document.get("sanity") or ()
    ]


def hidden(document: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """The effects that were not found, with the smallest size that would have been seen."""
    return [
        (spoken(e["effect"]), _number(e.get("smallest_detectable"), 3), e.get("unit") or "")
        for e in document.get("not_visible") or ()
    ]


def _estimate(entry: Mapping[str, Any]) -> tuple[str, str, str]:
    """Value, half the interval and unit; a value that was wrong with what it was."""
    value = _number(entry.get("value", entry.get("to")))
    if "from" in entry:
        value = f"{_number(entry['from'])} → {value}"
    ends = entry.get("interval")
    return (
        value,
        "not visible" if ends is None else _number((ends[1] - ends[0]) / 2, 2),
        (entry.get("unit") or ""),
    )


def _number(value: float | None, digits: int = 5) -> str:
    return _NONE if value is None or not math.isfinite(value) else f"{value:.{digits}g}"


def _percent(value: float | None, places: int = 2) -> str:
    return _NONE if value is None or not math.isfinite(value) else f"{value:.{places}%}"


def _chance(value: float) -> str:
    return "p < 0.001" if value < 0.001 else f"p = {value:.3f}"
