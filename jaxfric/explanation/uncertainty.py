"""Parameters of the selected terms, with errors that contain what other rows of the machine say."""

import numpy as np

from ..identification.uncertainty import Estimate
from ..terms.effects import traits
from . import parameters as spelled, verification
from .findings import Findings


def estimated(findings: Findings) -> list[dict[str, Estimate]]:
    """The parameters of each term; their errors contain what a wider kernel and the held-out
    recording change.

    Where the force acts late, all terms but the last, the delay or lag itself, are estimated with
    the force put back.
    """
    selection, rows = findings.selection, findings.problem
    units = rows.evidence.motion.unit_names
    ours = spelled.estimates(selection.last, rows.block, units)
    delayed = traits(selection.last.terms[-1]).late
    problem, others = findings.undelayed if delayed else findings.recorded
    late = [
        {
            name: own._replace(standard_error=np.hypot(own.standard_error, selection.time_error))
            for name, own in term.items()
        }
        for term in ours[len(others.last.terms) :]
    ]
    both, count = ours[: len(others.last.terms)], int(problem.block[-1]) + 1
    if problem.wide is not None:
        wide = spelled.refitted_to(problem.wide, others.last, count, units)
        both = [spelled.with_smoothing(*pair) for pair in zip(both, wide, strict=True)]
    if problem.held is not None:
        # A moment's parameters are its recording's own, and so is the phase of an encoder's zero.
        lasting = verification.lasting(others.last, others.rephased)
        there = spelled.refitted_to(problem.held, lasting, count, units)
        own = {id(term): values for term, values in zip(lasting.terms, there, strict=True)}
        both = [
            spelled.with_elsewhere(mine, own.get(id(term), mine))
            for term, mine in zip(others.last.terms, both, strict=True)
        ]
    return both + late
