"""The parameters of what was found, as every view of the machine shows them."""

import numpy as np

from ..identification.uncertainty import Estimate
from ..terms.effects import traits
from . import parameters as spelled, verification
from .naming import Named
from .problem import Problem


def estimated(found: Named, problem: Problem, rest) -> list[dict[str, Estimate]]:
    """The parameters of each term; their errors contain what another view of the machine changes.

    Views are a kernel of twice the width and the held-out recording. Where the force acts late,
    that is seen with the force put back, `rest`, by all terms but the last, which is the delay or
    lag itself.
    """
    units = problem.evidence.motion.unit_names
    ours = spelled.estimates(found.last, problem.block, units)
    where, left = rest if traits(found.last.terms[-1]).late else (problem, found)
    late = [
        {
            name: own._replace(standard_error=np.hypot(own.standard_error, found.smoothed))
            for name, own in term.items()
        }
        for term in ours[len(left.last.terms) :]
    ]
    both, count = ours[: len(left.last.terms)], int(where.block[-1]) + 1
    if where.wide is not None:
        wide = spelled.seen_by(where.wide, left.last, count, units)
        both = [spelled.with_smoothing(*pair) for pair in zip(both, wide, strict=True)]
    if where.held is not None:
        # A moment's parameters are its recording's own, and so is the phase of an encoder's zero.
        lasting = verification.lasting(left.last, left.rephased)
        there = spelled.seen_by(where.held, lasting, count, units)
        own = {id(term): values for term, values in zip(lasting.terms, there, strict=True)}
        both = [
            spelled.with_elsewhere(mine, own.get(id(term), mine))
            for term, mine in zip(left.last.terms, both, strict=True)
        ]
    return both + late
