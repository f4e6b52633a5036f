"""An explanation of the free motion, with the hard end stops of the log as its first findings."""

import dataclasses

from ...terms.effects.end_stop import END_STOP, place
from ..explained import Explanation
from ..figures import Figures
from ..finding import Finding
from ..quantities import quantity
from .preceding import with_preceding
from .pressed import Stop, Stopped
from .table import EQUATIONS


def with_stops(found: Explanation, seen: Stopped, whole: Figures) -> Explanation:
    """An explanation of the free motion, with the stops as its first findings.

    `whole`: the figures of the log as it is.
    """
    findings = [_finding(stop) for stop in seen.stops]
    errors = {
        "force_error": whole.here(seen.baseline), "filtered_force_error": seen.filtered,
    }  # fmt: skip
    if seen.filtered_held is not None:
        errors["holdout_force_error"] = whole.held(seen.baseline)
        errors["filtered_holdout_force_error"] = seen.filtered_held
    # Standstill counts in no error. Without a blow both errors are of the free motion.
    before = {name: max(size, found.fit[name]["before"]) for name, size in errors.items()}
    told = [finding for finding in findings if finding.confirmed is not False]
    refuted = [finding for finding in findings if finding.confirmed is False]
    left = 1 - max((finding.share for finding in told), default=0.0)
    found = without_visible(with_preceding(found, told, left, before) if told else found)
    verdict = "unexplained" if refuted and found.verdict == "consistent" else found.verdict
    return dataclasses.replace(
        found, not_confirmed=[*refuted, *found.not_confirmed], verdict=verdict
    )


def without_visible(found: Explanation) -> Explanation:
    """Without a size from which a stop would have been seen: rows in slip do not show one."""
    others = [each for each in found.not_visible if each["effect"] != END_STOP.name]
    return dataclasses.replace(found, not_visible=others)


_CONFIRMED = {
    None: "",
    True: " The held-out recording is stopped there, too.",
    False: " But the held-out recording passes there.",
}


def _finding(stop: Stop) -> Finding:
    contact = stop.contact
    end = "upper" if contact.upper else "lower"
    unit = contact.place.unit
    often = "once" if stop.visits == 1 else f"{stop.visits} times"
    text = (
        f"At {quantity(contact.place)}, the {end} end of the stroke, a hard end stop blocks the "
        f"axis: it stands there {often}, pressed by up to {contact.held:.3g} {contact.unit}, more "
        f"than friction can hold, and never gets beyond. The stop gives way by "
        f"{stop.yields:.2g} {unit} at most, and has {stop.stiffness:.2g} {contact.unit}/{unit} at "
        f"least.{_CONFIRMED[stop.confirmed]} All else is said, and the errors after are taken, "
        f"without the {contact.samples} samples there: the model is of the free motion."
    )
    apart = (
        "Look at the machine there: does it touch its own end or something beside it, or is a "
        "brake closed? Turn the motion round shortly before."
    )
    return Finding(
        END_STOP.name, EQUATIONS[END_STOP.name], text, (), apart,
        {place(contact.upper): contact.place}, contact.share, None, 0.0,
        confirmed=stop.confirmed,
    )  # fmt: skip
