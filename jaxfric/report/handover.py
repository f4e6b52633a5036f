"""The improved model as code to copy, each form with the force error that it costs."""

from typing import Any

from ..export import export
from ..models import Model

TITLES = {"st": "IEC 61131-3 Structured Text", "c": "C99", "mujoco": "MuJoCo (MJCF)"}


def code(model: Model) -> list[dict[str, Any]]:
    """A piece of code for each target; where one cannot hold the model, why."""
    pieces = []
    for target, title in TITLES.items():
        try:
            found = export(model, target)
        except ValueError as error:
            pieces.append({"title": f"{title}: not for this model", "note": str(error), "text": ""})
            continue
        cost = found.force_error
        worth = f"{cost.relative:.1%} ({cost.rms:.3g} {cost.unit} rms)" if cost.rms else "none"
        left = [f"Left out: {entry}." for entry in found.left_out]
        note = " ".join([f"Force error that this form costs: {worth}.", *left, *found.remarks])
        pieces.append({"title": title, "note": note, "text": found.text})
    return pieces
