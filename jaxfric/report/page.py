"""The HTML page of an explanation: one file that needs no network, for the screen and for paper."""

import math
from collections.abc import Mapping
from html import escape
from typing import Any

from ..looks.html import table as _table
from ..terms.effects import EFFECTS
from . import charts

# Half a 95 % interval in standard errors, as in the findings' sentences.
HALF_WIDTH = 2.0
_NONE = "–"
_VERDICTS = {
    "consistent": ("Consistent", "#1b7f4b", "Nothing is missing beyond the noise."),
    "explained": ("Explained", "#0b5fa5", "The named physics accounts for the mismatch."),
    "partly_explained": (
        "Partly explained",
        "#b26a00",
        "Named physics accounts for a part; structure is left, or terms overlap.",
    ),
    "unexplained": (
        "Unexplained",
        "#b3261e",
        "Something is missing that no effect of the library accounts for.",
    ),
}
STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; background: #fff;
  max-width: 62rem; margin: 0 auto; padding: 1.5rem; }
h1 { font-size: 1.5rem; margin: 0 0 .2rem; } h2 { font-size: 1.15rem; margin: 2rem 0 .5rem; }
.file { color: #555; overflow-wrap: anywhere; margin: 0 0 1rem; }
.verdict { border-left: .5rem solid var(--tone); background: #f5f6f7; padding: .8rem 1rem; }
.verdict strong { color: var(--tone); }
.warnings { border-left: .5rem solid #b26a00; background: #f5f6f7; margin: .6rem 0;
  padding: .6rem 1rem .6rem 2rem; }
.numbers { display: flex; flex-wrap: wrap; gap: .8rem 2.5rem; margin: 1rem 0; padding: 0; }
.numbers div { min-width: 9rem; } .numbers dt { color: #555; font-size: .85rem; }
.numbers dd { margin: 0; font-size: 1.2rem; font-variant-numeric: tabular-nums; }
table { border-collapse: collapse; margin: .4rem 0 1rem; }
th, td { text-align: left; vertical-align: top; padding: .35rem 1.5rem .35rem 0;
  border-bottom: 1px solid #ddd; }
th { font-weight: 600; font-size: .85rem; color: #444; border-bottom-color: #888; }
td.number, th.number { text-align: right; white-space: nowrap;
  font-variant-numeric: tabular-nums; }
.note { color: #555; font-size: .9rem; margin: .2rem 0 .6rem; } code { font-size: .9em; }
@media screen { section { overflow-x: auto; } }
@media print { body { max-width: none; padding: 0; font-size: 11pt; }
  section { break-inside: avoid; } h2 { break-after: avoid; } .modebar { display: none; }
  .verdict { print-color-adjust: exact; -webkit-print-color-adjust: exact; } }
"""


def render(document: Mapping[str, Any], pictures: Mapping[str, Any] | None = None) -> str:
    """The page of an explanation, HTML that loads nothing from elsewhere.

    **Arguments:** `document`, an explanation (schema `jaxfric.explanation/1`); `pictures`, plain
    lists to draw from, any of them absent: `map`, a list of `coordinate`, `unit`, `at`, `before`,
    `after`, `error` (binned mean residual); `time` and `holdout`, each `time`, `measured`,
    `before`, `after` (s; forces); `friction`, `velocity`, `before`, `after`; `units`, the names
    of `force` and `position`.

    **Raises:** `ValueError` if it is another document, or pictures are given without plotly.
    """
    schema = document.get("schema")
    if schema != "jaxfric.explanation/1":
        raise ValueError(f"Not an explanation: schema is {schema!r}, not 'jaxfric.explanation/1'.")
    drawn = _pictures(document, pictures or {})
    file = document.get("recording", {}).get("file") or "recording"
    sections = [
        _findings(document),
        _separation(document),
        _where(document, drawn.get("map", "")),
        _section("Before and after in time", drawn.get("time", "")),
        _section(
            "Held-out recording",
            drawn.get("holdout", ""),
            "Nothing was refitted to this recording.",
        ),
        _section("Friction curve", drawn.get("friction", "")),
        _parameters(document),
        _not_visible(document),
        _recording(document),
    ]
    body = "\n".join([_head(document, file), *filter(None, sections)])
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(file)} – explained by jaxfric</title>
<style>{STYLE}</style>
{charts.script() if drawn else ""}
</head>
<body>
{body}
</body>
</html>
"""


def verdict_name(verdict: str) -> str:
    """A verdict as the page calls it."""
    return _VERDICTS[verdict][0]


def _pictures(document: Mapping[str, Any], curves: Mapping[str, Any]) -> dict[str, str]:
    """The pictures that there are curves for, as HTML, by name."""
    units = _units(document) | (curves.get("units") or {})
    force, position = units["force"], units["position"]
    drawn = {}
    if curves.get("map"):
        drawn["map"] = charts.maps(curves["map"], force)
    for name in ("time", "holdout"):
        if curves.get(name):
            drawn[name] = charts.in_time(curves[name], force)
    if curves.get("friction"):
        drawn["friction"] = charts.friction(curves["friction"], force, position)
    return drawn


def _units(document: Mapping[str, Any]) -> dict[str, str]:
    return {"force": "N", "position": "m"} | (document.get("model") or {}).get("units", {})


def _head(document: Mapping[str, Any], file: str) -> str:
    name, tone, sentence = _VERDICTS.get(document["verdict"], (document["verdict"], "#444", ""))
    sentence = document.get("summary") or sentence
    baseline = (document.get("baseline") or {}).get("name")
    against = f" · baseline {escape(baseline)}" if baseline else ""
    return f"""<h1>What the model leaves out</h1>
<p class="file">{escape(file)}{against}</p>
<div class="verdict" style="--tone: {tone}">
<strong>{escape(name)}.</strong> {escape(sentence)}
</div>
{_warnings(document, sentence)}{_numbers(document.get("fit") or {})}"""


def _warnings(document: Mapping[str, Any], said: str) -> str:
    """What makes the answer doubtful, but for what the verdict's sentence says already."""
    texts = [each["text"] for each in document.get("warnings") or () if each["text"] not in said]
    entries = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f'<ul class="warnings">{entries}</ul>\n' if entries else ""


def _numbers(fit: Mapping[str, Any]) -> str:
    """The errors before and after, large."""
    labels = {
        "force_error": "Force error",
        "holdout_force_error": "… on the held-out recording",
        "simulation_error": "Simulation error",
        "filtered_force_error": "Filtered force error",
        "filtered_holdout_force_error": "… on the held-out recording",
    }
    entries = [
        (label, f"{_percent(fit[key].get('before'))} → {_percent(fit[key].get('after'))}")
        for key, label in labels.items()
        if fit.get(key)
    ]
    if fit.get("noise_floor") is not None:
        entries.append(("Noise floor of the force error", _percent(fit["noise_floor"])))
    cells = [f"<div><dt>{escape(label)}</dt><dd>{value}</dd></div>" for label, value in entries]
    return f'<dl class="numbers">{"".join(cells)}</dl>{_how_measured(fit)}' if cells else ""


def _how_measured(fit: Mapping[str, Any]) -> str:
    """What the figures are, where there are two kinds."""
    width = (fit.get("filtered_force_error") or {}).get("width")
    if width is None:
        return ""
    text = (
        "Force error: norm(force − predicted)/norm(force) over the samples in motion, as jaxfric "
        "predict has it with the saved model, noise and all. Filtered: both passed through the "
        f"kernel by which effects are looked for, half-width {1e3 * width:.3g} ms."
    )
    adjusted = fit.get("holdout_adjusted") or {}
    for key, how in (("left_out", "left out"), ("rephased", "taken at its own phase")):
        if names := adjusted.get(key):
            text += f" On the held-out recording {', '.join(map(_spoken, names))} is {how}."
    return f'<p class="note">{escape(text)}</p>'


def _section(title: str, content: str, note: str = "") -> str:
    """A part of the page; nothing where there is no content."""
    if not content:
        return ""
    remark = f'<p class="note">{escape(note)}</p>' if note else ""
    return f"<section>\n<h2>{escape(title)}</h2>\n{remark}{content}\n</section>"


def _findings(document: Mapping[str, Any]) -> str:
    rows = [
        (
            _spoken(finding["effect"]),
            finding.get("sentence") or "",
            finding.get("equation") or "",
            _percent(finding.get("share"), 0),
            _percent(finding.get("holdout_share"), 0),
            _chance(finding.get("p_value")),
        )
        for finding in document.get("findings") or ()
    ]
    head = ("effect", "finding", "equation", "share", "held out", "p")
    note = "Share: part of the mean-square residual that the effect removes, strongest first."
    return _section("Findings", _table(head, rows, (3, 4, 5)), note)


def _separation(document: Mapping[str, Any]) -> str:
    """For each finding that could be another effect, the experiment that decides."""
    rows = []
    for finding in document.get("findings") or ():
        if others := finding.get("confusable_with"):
            known = EFFECTS.get(finding["effect"])
            experiment = finding.get("separate_by") or (known.separate_by if known else "")
            rows.append(
                (_spoken(finding["effect"]), ", ".join(map(_spoken, others)), experiment or _NONE)
            )
    head = ("named", "could also be", "experiment that decides")
    note = "This recording cannot tell these apart."
    return _section("How to tell confusable effects apart", _table(head, rows), note)


def _where(document: Mapping[str, Any], picture: str) -> str:
    rows = [
        (
            _spoken(place["coordinate"]),
            _percent(place.get("share"), 0),
            _chance(place.get("p_value")),
            place.get("detail") or "",
        )
        for place in document.get("where") or ()
    ]
    table = _table(("over", "share of the residual", "p", "detail"), rows, (1, 2))
    note = "Mean residual over each coordinate: flat at zero where nothing is missing."
    return _section("Where the model and the recording differ", table + picture, note)


def _parameters(document: Mapping[str, Any]) -> str:
    sources = [(_spoken(f["effect"]), f.get("parameters")) for f in document.get("findings") or ()]
    sources.append(("baseline", (document.get("baseline") or {}).get("parameters")))
    rows = [
        (source, name, *_estimate(entry))
        for source, entries in sources
        for name, entry in (entries or {}).items()
    ]
    head = ("of", "parameter", "value", "± 95 %", "unit")
    note = (
        "The interval is two standard errors to either side; the baseline's values are those "
        "without the findings."
    )
    return _section("Parameters", _table(head, rows, (2, 3)), note)


def _estimate(entry: Mapping[str, Any]) -> tuple[str, str, str]:
    """Value, half the interval and unit; a value that was wrong with what it was."""
    value = _number(entry.get("value", entry.get("to")))
    if "from" in entry:
        value = f"{_number(entry['from'])} → {value}"
    error = entry.get("standard_error")
    seen = error is not None and math.isfinite(error)
    unit = entry.get("unit") or ""
    return value, _number(HALF_WIDTH * error, 2) if seen else "not visible", unit


def _not_visible(document: Mapping[str, Any]) -> str:
    rows = [
        (_spoken(e["effect"]), _number(e.get("smallest_detectable"), 3), e.get("unit") or "")
        for e in document.get("not_visible") or ()
    ]
    head = ("effect", "smallest size that would have shown", "unit")
    note = "Not found, which rules them out down to this size only."
    return _section("What this recording could not have shown", _table(head, rows, (1,)), note)


def _recording(document: Mapping[str, Any]) -> str:
    facts, units = document.get("recording") or {}, _units(document)
    labels = {
        "samples": ("samples", "{:d}"),
        "duration": ("duration", "{:.4g} s"),
        "sample_rate": ("sample rate", "{:.6g} Hz"),
        "segments": ("segments", "{:d}"),
    }
    rows = [("file", facts.get("file") or _NONE)]
    rows += [
        (label, form.format(facts[key]))
        for key, (label, form) in labels.items()
        if facts.get(key) is not None
    ]
    rows.append(("units", f"force in {units['force']}, position in {units['position']}"))
    rows += [("put in order", note) for note in facts.get("notes") or ()]
    return _section("Recording", _table(("", ""), rows))


def _spoken(name: str) -> str:
    return str(name).replace("_", " ")


def _number(value: float | None, digits: int = 5) -> str:
    return _NONE if value is None or not math.isfinite(value) else f"{value:.{digits}g}"


def _percent(value: float | None, places: int = 2) -> str:
    return _NONE if value is None or not math.isfinite(value) else f"{value:.{places}%}"


def _chance(value: float | None) -> str:
    if value is None or not math.isfinite(value):
        return _NONE
    return "< 0.001" if value < 0.001 else f"{value:.3f}"
