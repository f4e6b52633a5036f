"""Interactive pictures of an explanation, as pieces of HTML that plotly's script brings to life."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

BEFORE, AFTER, MEASURED = "#c4570a", "#0b5fa5", "#9aa3ab"
Curves = Mapping[str, Any]


def library():
    """The modules `graph_objects` and `subplots` of plotly; raises `ValueError` without it."""
    try:
        from plotly import graph_objects, subplots
    except ImportError as error:
        raise ValueError('The page needs plotly: pip install "jaxfric[report]".') from error
    return graph_objects, subplots


def script() -> str:
    """Plotly's own script, so that the page needs no network."""
    library()
    from plotly.offline import get_plotlyjs

    return f"<script>{get_plotlyjs()}</script>"


def maps(entries: Sequence[Curves], force: str) -> str:
    """The mean residual over each coordinate, before and after, with its standard error."""
    objects, subplots = library()
    figure = subplots.make_subplots(
        rows=(len(entries) + 1) // 2, cols=min(2, len(entries)), vertical_spacing=_gap(len(entries))
    )
    for i, entry in enumerate(entries):
        place = {"row": i // 2 + 1, "col": i % 2 + 1}
        for key, colour in (("before", BEFORE), ("after", AFTER)):
            if not entry.get(key):
                continue
            error = entry.get("error") if key == "before" else None
            bars = {"type": "data", "array": error, "thickness": 1, "width": 0} if error else None
            line = _line(objects, entry["at"], entry[key], key, colour, i == 0, error_y=bars)
            figure.add_trace(line, **place)
        figure.add_hline(y=0, line={"color": "#888", "width": 1, "dash": "dot"}, **place)
        figure.update_xaxes(title_text=_label(entry["coordinate"], entry.get("unit")), **place)
        figure.update_yaxes(title_text=_label("residual", force) if i % 2 == 0 else "", **place)
    return _html(figure, 60 + 260 * ((len(entries) + 1) // 2))


def _gap(count: int) -> float:
    """Room for the axis title between the rows, as a share of the height."""
    return 0.0 if count <= 2 else 0.3 / ((count + 1) // 2)


def in_time(curves: Curves, force: str) -> str:
    """Measured and predicted force over time, and below what is left of it."""
    objects, subplots = library()
    figure = subplots.make_subplots(
        rows=2, cols=1, shared_xaxes=True, row_heights=[0.6, 0.4], vertical_spacing=0.06
    )
    time, measured = list(curves["time"]), list(curves["measured"])
    figure.add_trace(_line(objects, time, measured, "measured", MEASURED, True), row=1, col=1)
    for key, colour in (("before", BEFORE), ("after", AFTER)):
        if not curves.get(key):
            continue
        predicted = list(curves[key])
        left = [_difference(u, p) for u, p in zip(measured, predicted, strict=True)]
        figure.add_trace(_line(objects, time, predicted, key, colour, True), row=1, col=1)
        figure.add_trace(_line(objects, time, left, key, colour, False), row=2, col=1)
    figure.update_yaxes(title_text=_label("force", force), row=1, col=1)
    figure.update_yaxes(title_text=_label("residual", force), row=2, col=1)
    figure.update_xaxes(title_text=_label("time", "s"), row=2, col=1)
    return _html(figure, 460)


def _difference(first: float | None, second: float | None) -> float | None:
    return None if first is None or second is None else first - second


def friction(curves: Curves, force: str, position: str) -> str:
    """The friction curve before and after; the jump at zero velocity stays a gap."""
    objects, _ = library()
    figure = objects.Figure()
    for key, colour in (("before", BEFORE), ("after", AFTER)):
        if curves.get(key):
            for side in (-1, 1):
                at = [i for i, v in enumerate(curves["velocity"]) if side * v > 0]
                x, y = ([curves[name][i] for i in at] for name in ("velocity", key))
                figure.add_trace(_line(objects, x, y, key, colour, side > 0))
    figure.update_xaxes(title_text=_label("velocity", f"{position}/s"))
    figure.update_yaxes(title_text=_label("friction", force))
    return _html(figure, 380)


def _line(objects, x, y, name, colour, legend, **more):
    return objects.Scatter(
        x=list(x),
        y=list(y),
        name=name,
        legendgroup=name,
        mode="lines",
        line={"color": colour, "width": 1.5},
        showlegend=legend,
        **{key: value for key, value in more.items() if value is not None},
    )


def _label(quantity: str, unit: str | None) -> str:
    text = escape(quantity.replace("_", " "))
    return f"{text} ({escape(unit)})" if unit else text


def _html(figure, height: int) -> str:
    figure.update_layout(
        template="plotly_white",
        height=height,
        margin={"l": 70, "r": 15, "t": 35, "b": 50},
        font={"family": "system-ui, sans-serif", "size": 12, "color": "#222"},
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0.0},
    )
    config = {
        "displaylogo": False,
        "displayModeBar": "hover",
        "responsive": True,
        # A recording is its owner's: no button that uploads it.
        "modeBarButtonsToRemove": ["sendChartToCloud", "sendDataToCloud"],
        "plotlyServerURL": "",
    }
    return figure.to_html(full_html=False, include_plotlyjs=False, config=config)
