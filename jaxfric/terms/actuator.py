"""What an amplifier or motor does to the force it was asked for.

Let f be the force that the motion needs. A faulty actuator delivers f when it is told u ≠ f; each
law is u − f to first order in the fault, a function of f. The measured force must not stand in
for f, since it would explain itself: the channel `predicted_force` holds f as the model without
the fault predicts it from the motion, free of the force's noise.
"""

from .base import AbstractTerm

PREDICTED = "predicted_force"
REACTION = "predicted_reaction"
"""The channel of what friction carries: f without the friction in it, as the model predicts it."""


def predicted(term: AbstractTerm) -> bool:
    """Whether a term reads what the rest of its model predicts."""
    return bool(term.coordinates & {PREDICTED, REACTION})


def carried(term: AbstractTerm) -> bool:
    """Whether guide or screw carry something of a term: not where all of it is friction."""
    return not (term.affine and all(term.frictional))
