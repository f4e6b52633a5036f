"""A position that is counted from another zero than the simulator's."""

from ..effect import Effect

POSITION_ZERO = Effect(
    "position_zero",
    "f(q − z)",
    "position",
    coordinates=("position",),
    confusable_with=("gravity_unbalance", "spring"),
    separate_by="Move to the mechanical zero, and read the position there.",
    drawn=False,
)
