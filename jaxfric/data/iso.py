"""Dates and times of day as ISO 8601 spells them."""

import re

import numpy as np

# A date and a time of day, with what it is ahead of universal time.
_MOMENT = re.compile(
    r"(\d{4}-\d\d-\d\d)(?:[T ]+(\d\d:\d\d(?::\d\d)?)(?:[.,](\d+))?\s*"
    r"(?:Z|([-+])(\d\d):?(\d\d)?)?)?",
    re.IGNORECASE,
)


def is_moment(text: str) -> bool:
    """Whether a text is a date, with or without a time of day."""
    return bool(_MOMENT.fullmatch(text.strip()))


def moment(text: str) -> tuple[str, np.timedelta64] | None:
    """A date as NumPy spells it, to the nanosecond, and what it is ahead of universal time."""
    found = _MOMENT.fullmatch(text)
    if found is None:
        return None
    date, day, part, sign, hours, minutes = found.groups()
    ahead = int(f"{sign}{60 * int(hours) + int(minutes or 0)}") if sign else 0
    return f"{date}T{day}.{(part or '0')[:9]}" if day else date, np.timedelta64(ahead, "m")
