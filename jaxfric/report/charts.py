"""What the page's pictures show, as plain data that its script draws by uPlot."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..looks.drawing import label

# Digits of what is drawn: a ten-thousandth of the range is less than a dot.
DIGITS = 5
Curves = Mapping[str, Any]
Chart = dict[str, Any]


def chart(
    title: str, x: tuple[str, str], y: tuple[str, str], at: Sequence[float], series, height=260
) -> Chart:
    """A picture: `x` and `y` as label and unit, and series that [`line`][] and others make."""
    drawn = [each for each in series if each]
    columns = [column for each in drawn for column in each.pop("columns")]
    x_unit, x_scale = _prefixed(x[1], [at])
    y_unit, y_scale = _prefixed(y[1], columns)
    return {
        "title": title,
        "x": {"label": label(x[0], x_unit), "unit": x_unit},
        "y": {"label": label(y[0], y_unit), "unit": y_unit},
        "height": height,
        "series": drawn,
        "data": [_short(at, x_scale), *(_short(column, y_scale) for column in columns)],
    }


# What numbers read better in, where the largest is below a twentieth of the unit.
_SMALLER = {"m": "mm", "m/s": "mm/s", "s": "ms", "N·m": "mN·m", "Nm": "mNm", "A": "mA"}


def _prefixed(unit: str, columns: Sequence[Sequence[float | None]]) -> tuple[str, float]:
    """The unit of an axis and the factor to it."""
    greatest = max((abs(v) for column in columns for v in column if v is not None), default=1.0)
    return (_SMALLER[unit], 1e3) if unit in _SMALLER and greatest < 0.05 else (unit, 1.0)


def line(key: str, label: str, values: Sequence[float] | None, width: float = 1.6) -> Any:
    """A line; `None` where there are no values. `key`: measured, before, after."""
    if values is None:
        return None
    return {
        "kind": "line",
        "key": key,
        "label": label,
        "width": width,
        "columns": [list(values)],
    }


def points(key: str, label: str, values, error=None) -> Any:
    """Points with bars of two standard errors to either side."""
    if values is None:
        return None
    columns = [list(values)]
    if error is not None:
        for side in (-2.0, 2.0):
            ends = (_moved(v, e, side) for v, e in zip(values, error, strict=True))
            columns.append(list(ends))
    return {
        "kind": "points",
        "key": key,
        "label": label,
        "bars": error is not None,
        "columns": columns,
    }


def band(key: str, label: str, low, high) -> Any:
    """A band between two lines."""
    if low is None or high is None:
        return None
    return {"kind": "band", "key": key, "label": label, "columns": [list(low), list(high)]}


def mismatch(entry: Curves, force: str, added: bool = True) -> Chart:
    """What the baseline leaves over a coordinate, and what the improved model leaves there."""
    before, after = entry["before"], entry.get("after")
    error = entry.get("before_error", entry.get("error"))
    gained = None
    if added and after is not None:
        gained = [_less(b, a) for b, a in zip(before, after, strict=True)]
    return chart(
        f"Mismatch over {entry['coordinate']}",
        (entry["coordinate"], entry.get("unit") or ""),
        ("measured less model", force),
        entry["at"],
        [
            line("left", "what the findings add", gained, 2.2),
            points("before", "measured − baseline, ± 95 %", before, error),
            points("after", "measured − improved model", after) if after else None,
        ],
        320,
    )


def finding(entry: Curves, force: str) -> Chart:
    """One finding over its own coordinate: measured, and its law with a 95 % band."""
    return chart(
        f"Over {entry['coordinate']}",
        (entry["coordinate"], entry.get("unit") or ""),
        ("force of this effect", force),
        entry["at"],
        [
            band("after", "95 % band", entry.get("low"), entry.get("high")),
            points(
                "measured", "measured less all else, ± 95 %", entry["measured"], entry.get("error")
            ),
            line("after", "law", entry["law"], 2.0),
        ],
    )


def rerun(entry: Curves) -> Chart:
    """How far the closed loops that were run again are off the recording."""
    return chart(
        f"{entry['joint']}: off the recording, run again",
        ("time", "s"),
        ("deviation of the position", entry["unit"]),
        entry["time"],
        [line(when, when, entry.get(when)) for when in ("before", "after")],
    )


def in_time(curves: Curves, force: str) -> list[Chart]:
    """Measured and predicted force over time, and below what is left of it."""
    time, measured = curves["time"], curves["measured"]
    whole = chart(
        "Force over time",
        ("time without interruptions", "s"),
        ("force", force),
        time,
        [line("measured", "measured", measured, 2.4), *_models(curves)],
    )
    left = {
        key: [_less(u, p) for u, p in zip(measured, curves[key], strict=True)]
        for key in ("before", "after")
        if curves.get(key)
    }
    rest = chart(
        "What is left of it",
        ("time without interruptions", "s"),
        ("residual", force),
        time,
        _models(left),
        200,
    )
    return [whole, rest]


def friction(curves: Curves, force: str, position: str) -> Chart:
    """The friction curve of the improved model over the speeds that were seen."""
    held = curves.get("held") or ()
    seen = curves.get("at") or ()
    at = [*curves["velocity"], 0.0, *seen, *(each["velocity"] for each in held)]
    order = sorted(range(len(at)), key=lambda i: at[i])

    def spread(values, before: int):
        if not values:
            return None
        whole = [None] * before + list(values)
        whole += [None] * (len(at) - len(whole))
        return [whole[i] for i in order]

    modelled = len(curves["velocity"]) + 1
    measured, error = (spread(curves.get(name), modelled) for name in ("measured", "error"))
    steady = spread([each["force"] for each in held], modelled + len(seen))
    # Of bars of two standard errors.
    half = spread([0.5 * each["half"] for each in held], modelled + len(seen))
    picture = chart(
        "Correction over velocity" if curves.get("corrects") else "Friction over velocity",
        ("velocity", f"{position}/s"),
        ("correction" if curves.get("corrects") else "friction force", force),
        [at[i] for i in order],
        [
            points("measured", "measured less all else, ± 95 %", measured, error),
            line("before", "baseline", spread(curves.get("before"), 0)),
            line("after", "improved model", spread(curves.get("after"), 0), 2.0),
            points("left", "mean at constant velocity, ± 95 %", steady, half),
        ],
        300,
    )
    # Curve and points stand at different speeds: a line runs through, but never across rest.
    return picture | {"through": True}


def _models(curves: Curves) -> list[Any]:
    return [
        line("before", "baseline", curves.get("before"), 1.0),
        line("after", "improved model", curves.get("after"), 1.0),
    ]


def _moved(value, error, side: float):
    return None if value is None or error is None else value + side * error


def _less(first: float | None, second: float | None) -> float | None:
    return None if first is None or second is None else first - second


def _short(values, scale: float = 1.0) -> list[float | None]:
    return [None if v is None or v != v else float(f"{scale * v:.{DIGITS}g}") for v in values]
