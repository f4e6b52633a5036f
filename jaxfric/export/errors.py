"""What a written file leaves of a joint's force, beside what it was to leave, in words."""

from collections.abc import Mapping

from ..explanation import Explanation
from ..explanation.acceptance import LINEARITY
from ..explanation.quantities import percent


def reached(error: Mapping[str, float]) -> float:
    """The force error with all that was written: the file, and the forces beside it if any."""
    return error.get("forces", error["file"])


def _more(one: float, other: float) -> bool:
    """Whether an error, relative to the force, is more than another beyond what a sensor tells."""
    return one**2 > other**2 + LINEARITY**2


def worse(errors: Mapping[str, Mapping[str, float]]) -> bool:
    """Whether the file leaves a joint more than it did as it was, on any recording, by itself or
    with the forces beside it.
    """
    return any(_more(max(each["file"], reached(each)), each["before"]) for each in errors.values())


def from_to(errors: Mapping[str, Mapping[str, float]]) -> str:
    """Errors before and after in words, of the file or with the forces, whichever is more."""
    return ", ".join(
        f"{percent(each['before'])} → {percent(max(each['file'], reached(each)))}"
        f"{' held out' * name.startswith('holdout')}"
        for name, each in errors.items()
    )


def miss(joint: str, told: Explanation, errors: Mapping[str, Mapping[str, float]]) -> str:
    """That what was written leaves more of a joint's force than its answer does, if it does."""
    texts = []
    for name, each in errors.items():
        own = told.fit[f"filtered_{name}"]
        if own and _more(reached(each), own["after"]):
            held = "of the held-out recording " if name.startswith("holdout") else ""
            by = "the file and the callback" if "forces" in each else "the file"
            left = f"{percent(own['after'])} by its answer, {percent(reached(each))} by {by}"
            texts.append(held + left)
    return f"joint {joint}: not all of its answer is in the file: {'; '.join(texts)}" * bool(texts)


def as_read(joint: str, told: Explanation, errors: Mapping[str, Mapping[str, float]]) -> str:
    """What the log as it was read left of a joint's force, where it has been put right since."""
    texts, right = [], not any(row["wrong"] for row in told.sanity)
    for name, each in errors.items():
        own = told.fit[f"filtered_{name}"]
        if own and not right and _more(own["before"], each["before"]):
            held = " of the held-out recording" if name.startswith("holdout") else ""
            texts.append(f"{percent(own['before'])}{held}")
    return (
        f"joint {joint}: before is of the log as it was put right; of the log as it was read "
        f"it was {', '.join(texts)}"
    ) * bool(texts)
