"""The HTML page of an explanation: one file that needs no network, for the screen and for paper."""

import json
import math
from collections.abc import Mapping
from html import escape
from importlib import resources
from pathlib import PurePath
from typing import Any

from ..looks.unseen import slower
from ..models import Model
from ..terms.actuator import PREDICTED, REACTION
from . import advice, charts, content, equations, handover
from .advice import spoken

# Pictures of where the baseline errs that no finding shows already.
MAPS = 2
_NONE = "–"
_VERDICTS = {
    "consistent": "Consistent",
    "explained": "Explained",
    "partly_explained": "Partly explained",
    "unexplained": "Unexplained",
}


def verdict_name(verdict: str) -> str:
    """A verdict as the page calls it."""
    return _VERDICTS[verdict]


def style() -> str:
    """The style sheet of the page."""
    return _asset("page.css")


def picture(chart: Mapping[str, Any]) -> str:
    """One picture, for pages that no template makes; [`scripts`][] draws it."""
    title, data = escape(chart["title"]), json.dumps(chart).replace("<", "\\u003c")
    data = f'<script type="application/json">{data}</script>'
    return (
        f"<figure><figcaption>{title}</figcaption>"
        f'<div class="chart" role="img" aria-label="{title}">{data}</div></figure>'
    )


def scripts() -> str:
    """What draws the pictures of a page."""
    style = f"<style>{_asset('uPlot.min.css')}</style>"
    return style + "".join(
        f"<script>{_asset(name)}</script>" for name in ("uPlot.iife.min.js", "page.js")
    )


def library():
    """The module `jinja2`; raises `ValueError` without it."""
    try:
        import jinja2
    except ImportError as error:
        raise ValueError('The page needs jinja2: pip install "jaxfric[report]".') from error
    return jinja2


def render(
    document: Mapping[str, Any],
    pictures: Mapping[str, Any] | None = None,
    command: str = "",
    date: str = "",
) -> str:
    """The page of an explanation, HTML that loads nothing from elsewhere.

    **Arguments:** `document`, an explanation (schema `jaxfric.explanation/1`); `pictures`, plain
    lists to draw from (`Explanation.curves`), any of them absent: `findings`, in the document's
    order, and `map`, lists over a coordinate; `time` and `holdout`, each `time`, `measured`,
    `before`, `after`; `friction`, `velocity`, `before`, `after`; `units`, the names of `force`
    and `position`; `command` and `date`, that made it.

    **Raises:** `ValueError` if it is another document, or without jinja2.
    """
    schema = document.get("schema")
    if schema != "jaxfric.explanation/1":
        raise ValueError(f"Not an explanation: schema is {schema!r}, not 'jaxfric.explanation/1'.")
    jinja2 = library()
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    curves = pictures or {}
    context = _context(document, curves) | _reproduce(document, command, date)
    page = {
        "style": style(),
        "chart_style": _asset("uPlot.min.css"),
        "library": _asset("uPlot.iife.min.js"),
        "script": _asset("page.js"),
    }
    from markupsafe import Markup  # jinja2 stands on it

    return environment.from_string(_asset("page.html")).render(
        **context, **{name: Markup(text) for name, text in page.items()}
    )


def _asset(name: str) -> str:
    return (resources.files(__package__) / "assets" / name).read_text(encoding="utf-8")


def _context(document: Mapping[str, Any], curves: Mapping[str, Any]) -> dict[str, Any]:
    """Everything that the template shows, as text and plain data."""
    units = _units(document) | dict(curves.get("units") or {})
    drawn = _pictures(document, curves, units)
    model = _model(document)
    headline = advice.headline(document)
    warned = [each["text"] for each in document.get("warnings") or ()]
    unseen = [n for n, v in model.parameters.items() if math.isnan(float(v))] if model else []
    terms = equations.rows(model) if model else []
    return {
        "name": PurePath(document.get("recording", {}).get("file") or "recording").name,
        "baseline": (document.get("baseline") or {}).get("name"),
        "verdict": document["verdict"] if document["verdict"] in _VERDICTS else "",
        "verdict_name": _VERDICTS.get(document["verdict"], spoken(document["verdict"])),
        "headline": headline,
        "warnings": [text for text in dict.fromkeys(warned) if text not in headline],
        "errors": content.errors(document.get("fit") or {}),
        "next": advice.steps(document),
        "cards": content.cards(document, curves, units, terms),
        "places": content.places(document),
        "sanity": content.sanity(document),
        "places_note": content.places_note(document),
        "terms": terms,
        "of_the_force": model is not None and PREDICTED in model.term.coordinates,
        "of_the_reaction": model is not None and REACTION in model.term.coordinates,
        "unseen": ", ".join(unseen),
        "parameters": content.parameters(document),
        "units": units,
        "code": handover.code(model) if model else [],
        "averaged": content.averaged(document.get("fit") or {}),
        "benefit": content.benefit(document, units),
        "assumed": (document.get("benefit") or {}).get("assumed", ""),
        "controller": (document.get("benefit") or {}).get("controller", ""),
        "hidden": content.hidden(document),
        "slower": slower(document),
        "definitions": content.definitions(document.get("fit") or {}),
        **drawn,
        "drawn": any(drawn.values()),
    }


def _pictures(document, curves, units: Mapping[str, str]) -> dict[str, Any]:
    """The pictures that there are curves for, each once."""
    if not document.get("findings"):  # the improved model is the baseline
        curves = _unchanged(curves)
    force, position = units["force"], units["position"]
    own = [each for each in curves.get("findings") or () if each]
    places = list(curves.get("map") or ())
    time, held = curves.get("time"), curves.get("holdout")
    friction = curves.get("friction")
    friction = charts.friction(friction, force, position) if friction else None
    hero, hero_place = None, None
    if own:
        hero = charts.mismatch(own[0], force)
    elif places:
        hero_place = places.pop(0)
        hero = charts.mismatch(hero_place, force, added=False)
    elif friction:
        hero, friction = friction, None
    shown = {_stem(entry) for entry in own or ([hero_place] if hero_place else [])}
    rest = {_stem(place): place for place in reversed(places) if _stem(place) not in shown}
    velocity = (curves.get("friction") or {}).get("velocity") or [-1.0, 1.0]
    return {
        "hero": hero,
        "maps": [
            charts.mismatch(p, force, added=False) for p in list(reversed(rest.values()))[:MAPS]
        ],
        "time": charts.in_time(time, force) if time else None,
        "rerun": charts.rerun(curves["rerun"]) if curves.get("rerun") else None,
        "holdout": charts.in_time(held, force)[1] if held else None,
        "friction": friction,
        "one_sided": min(velocity) > 0 or max(velocity) < 0,
    }


def _unchanged(curves: Mapping[str, Any]) -> dict[str, Any]:
    """The curves without those of an improved model."""

    def alone(entry):
        return entry and {**entry, "after": None}

    shown = {name: alone(curves.get(name)) for name in ("time", "holdout", "friction")}
    return {
        **curves,
        **shown,
        "findings": None,
        "map": [alone(each) for each in curves.get("map") or ()],
    }


def _stem(entry: Mapping[str, Any]) -> str:
    """A coordinate without what it is folded at or in step with."""
    return entry["coordinate"].partition(",")[0].partition(" by ")[0]


def _units(document: Mapping[str, Any]) -> dict[str, str]:
    return {"force": "N", "position": "m"} | (document.get("model") or {}).get("units", {})


def _model(document: Mapping[str, Any]) -> Model | None:
    found = document.get("model") or {}
    return Model.from_dict(found) if "term" in found else None


def _reproduce(document: Mapping[str, Any], command: str, date: str) -> dict[str, Any]:
    """The command, the versions, the date and the files."""
    facts = document.get("recording") or {}
    rows = [("file", facts.get("file") or _NONE)]
    rows += [("SHA-256", facts["sha256"])] if facts.get("sha256") else []
    rate = facts.get("sample_rate")
    if facts.get("samples") is not None:
        at = f", {facts['duration']:.4g} s" if facts.get("duration") is not None else ""
        rows.append(("samples", f"{facts['samples']}{at}" + (f" at {rate:.6g} Hz" if rate else "")))
    units = _units(document)
    rows.append(("units", f"force in {units['force']}, position in {units['position']}"))
    rows += [("put in order", note) for note in facts.get("notes") or ()]
    other = document.get("holdout") or {}
    if other.get("file"):
        rows.append(("held out", f"{other['file']} (SHA-256 {other.get('sha256') or 'unknown'})"))
    versions = document.get("versions") or {}
    rows += [("versions", ", ".join(f"{n} {v}" for n, v in versions.items()))] if versions else []
    rows += [("made on", date)] if date else []
    return {"command": command, "reproduce": rows}
