"""The page of a robot: a table of its joints, each with a link to its own page."""

import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ..explanation.quantities import percent
from . import charts
from .page import picture, scripts, style, verdict_name


def render(
    simulator: str,
    log: str,
    rows: Sequence[Mapping[str, Any]],
    links: Mapping[str, str],
    lines: Sequence[str] = (),
    again: Sequence[Mapping[str, Any]] = (),
) -> str:
    """The page, HTML that loads nothing from elsewhere.

    **Arguments:** `rows` of the joints as in the document; `links` to their pages by joint;
    `lines`, what was written into the simulator's file; `again`, of each joint the closed loops
    that were run again.
    """
    pictures = "".join(picture(charts.rerun(each)) for each in again)
    name = f"{Path(simulator).name} against {Path(log).name}"
    body = "".join(_row(row, links.get(row["joint"])) for row in rows)
    done = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(name)} – explained by jaxfric</title>
<style>{style()}</style>
</head>
<body>
<h1>{escape(name)}</h1>
<p class="file">{escape(simulator)}, {escape(log)}</p>
<section>
<table>
<tr><th>joint</th><th>verdict</th><th class="number">force error</th>
<th class="number">noise</th><th class="number">held out</th><th>what</th></tr>
{body}</table>
<p class="note">Force errors before → after, through the kernel by which effects are looked for.
Noise: what it alone makes.</p>
</section>
{f"<section><h2>The simulator's file</h2><ul>{done}</ul></section>" if done else ""}
{f"<section><h2>Run again</h2>{pictures}</section>{scripts()}" if pictures else ""}
</body>
</html>
"""


def _row(row: Mapping[str, Any], link: str | None) -> str:
    joint = escape(row["joint"])
    if link is not None:
        joint = f'<a href="{quote(link)}">{joint}</a>'
    if "error" in row:
        text = escape(row["error"])
        return f'<tr><td>{joint}</td><td>refused</td><td colspan="4">{text}</td></tr>'
    here, held = (
        "" if each is None else f"{percent(each['before'])} → {percent(each['after'])}"
        for each in (row["filtered_force_error"], row["filtered_holdout_force_error"])
    )
    noise = row.get("filtered_noise_floor")
    errors = [here, "" if noise is None or math.isnan(noise) else percent(noise), held]
    more = (row.get(name) for name in ("describes_nothing", "unexplained"))
    texts = [*row["findings"], *filter(None, more)]
    said = "<br>".join(map(escape, texts)) or "–"
    cells = "".join(f'<td class="number">{each}</td>' for each in errors)
    return (
        f"<tr><td>{joint}</td><td>{verdict_name(row['verdict'])}</td>{cells}<td>{said}</td></tr>\n"
    )
