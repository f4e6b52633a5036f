"""What a recording could not have shown, in words."""

from collections.abc import Mapping
from typing import Any


def slower(document: Mapping[str, Any]) -> str:
    """That nothing is said of friction at low speed; empty where something is."""
    slowest = ((document.get("fit") or {}).get("filtered_force_error") or {}).get("slowest")
    if slowest is None:
        return ""
    return (
        f"No stretch of slip that is long enough is slower than {slowest['value']:.3g} "
        f"{slowest['unit']}: of friction below that, as of a narrow Stribeck bump, nothing is said."
    )
