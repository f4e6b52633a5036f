"""What a written file leaves of a joint's force, beside what it was to leave, in words."""

from collections.abc import Mapping

from ..explanation import Explanation
from ..explanation.acceptance import LINEARITY


def reached(error: Mapping[str, float]) -> float:
    """The force error with all that was written: the file, and the forces beside it if any."""
    return error.get("forces", error["file"])


def _more(one: float, other: float) -> bool:
    """Whether an error, relative to the force, is more than another beyond what a sensor tells."""
    return one**2 > other**2 + LINEARITY**2


def worse(errors: Mapping[str, Mapping[str, float]]) -> bool:
    """Whether what was written leaves a joint more than the file as it was, on any recording."""
    return any(_more(reached(each), each["before"]) for each in errors.values())


def from_to(errors: Mapping[str, Mapping[str, float]]) -> str:
    """Errors before and after in words."""
    return ", ".join(
        f"{each['before']:.2%} → {reached(each):.2%}{' held out' * name.startswith('holdout')}"
        for name, each in errors.items()
    )


def miss(joint: str, told: Explanation, errors: Mapping[str, Mapping[str, float]]) -> str:
    """That what was written leaves more of a joint's force than its answer does, if it does."""
    texts = []
    for name, each in errors.items():
        own = told.fit[f"filtered_{name}"]
        if own and _more(reached(each), own["after"]):
            held = "of the held-out recording " if name.startswith("holdout") else ""
            texts.append(f"{held}{own['after']:.2%} by its answer, {reached(each):.2%} by the file")
    return f"joint {joint}: not all of its answer is in the file: {'; '.join(texts)}" * bool(texts)
