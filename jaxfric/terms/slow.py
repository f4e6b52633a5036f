"""How what changes slowly is told: by how much it changes, along the stroke or over the record."""

from collections.abc import Callable, Mapping

from .effect import REPEATED, Extent

# Places along the stroke at which a slow curve is told, by name: from −1 at its low end to 1.
ALONG = {"at_low_end": -1.0, "at_first_quarter": -0.5, "at_third_quarter": 0.5, "at_high_end": 1.0}
# What settles is at the end of the record so much more than at its start.
OVER_RECORD = "over_record"
# A force of time alone moves so far over the record, from its least to its greatest.
RANGE = "range_over_record"
# Changes, of which nothing is told that may be nil.
CHANGES = (*ALONG, OVER_RECORD, RANGE)
_PLACES = "at its low end", "at a quarter of it", "at three quarters", "at its high end"


def slowly(
    period: str, begin: str, end: str = ""
) -> Callable[[Mapping[str, float], Extent], str | None]:
    """Another sentence where a wave does not repeat within the stroke: by its values along that,
    which are known where its period and amplitude are not.

    `begin`: what varies; `end`: what follows.
    """

    def told(values: Mapping[str, float], extent: Extent) -> str | None:
        if values[period] * REPEATED <= extent.stroke:
            return None
        known = [
            f"{{{name}:more}} {place}"
            for name, place in zip(ALONG, _PLACES, strict=True)
            if name in values
        ]
        if not known:
            return f"{begin}, by {{amplitude}}{end}"
        listed = " and ".join((", ".join(known[:-1]), known[-1])) if known[1:] else known[0]
        return f"{begin}: compared with the middle of the stroke it is {listed}{end}"

    return told
