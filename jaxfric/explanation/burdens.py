"""What a load takes of a machine's inertia and friction, and what the machine has."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..terms.base import AbstractTerm
from .regression import Fit

# The law of a load knows one dry friction, alike in both directions, where the machine's has a dip,
# a slope and two sides: by half of it the load's may come out too large.
IDEALISED = 1.5


class Machine(NamedTuple):
    """The inertia, kg, and the friction, N, that a model gives a machine; infinite if unknown."""

    inertia: float
    friction: float


def machine(terms: Sequence[AbstractTerm], alphas: Sequence[np.ndarray]) -> Machine:
    """What the terms of a model, with their affine parameters, give a machine."""
    values = [
        (p.name.rstrip("+-"), float(a))
        for term, alpha in zip(terms, alphas, strict=True)
        for p, a in zip(term.affine, alpha, strict=True)
    ]

    def most(name: str, default: float) -> float:
        return max((a for n, a in values if n == name), default=default)

    friction = most("coulomb", np.inf) + most("stribeck_force", 0.0)
    return Machine(most("inertia", np.inf), friction)


def largest(term: AbstractTerm, betas: np.ndarray, current: Fit) -> np.ndarray:
    """The largest amplitude of a law of one for which its load is a part of the machine, `(G,)`."""
    if len(term.affine) != 1:
        return np.full(len(betas), np.inf)
    most = machine(current.terms, current.alphas)
    units = [term.burden(beta, np.ones(1)) for beta in betas]
    return np.array([
        np.inf
        if unit is None
        else min(
            most.inertia / unit.inertia if unit.inertia > 0 else np.inf,
            IDEALISED * most.friction / unit.friction if unit.friction > 0 else np.inf,
        )
        for unit in units
    ])  # fmt: skip
