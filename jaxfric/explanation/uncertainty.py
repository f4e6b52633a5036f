"""Parameters of a model, with errors that contain what other rows of the machine say."""

from collections.abc import Collection

import numpy as np

from ..identification.uncertainty import Estimate
from ..terms.effects import traits
from . import parameters as spelled, verification
from .baseline import refitted
from .evidence import Evidence
from .findings import Findings
from .intervals import aliased
from .regression import Fit, at_shapes, freed
from .significance import evenly


def estimated(
    findings: Findings, moved: Collection[int] = (), shaped: bool = False
) -> list[dict[str, Estimate]]:
    """The parameters of each term; their errors contain what a wider kernel and the held-out
    recording change.

    Where the force acts late, all terms but the last, the delay or lag itself, are estimated with
    the force put back. `moved`: numbers of the base's values that were found wrong, if any; what
    stayed is exact. `shaped`: sizes at the shapes that the terms have.
    """
    selection, rows = findings.selection, findings.problem
    units = rows.evidence.motion.unit_names

    def asked(current: Fit) -> Fit:
        current = freed(current, moved) if moved or selection.trusted else current
        return at_shapes(current) if shaped else current

    def again(evidence: Evidence, known: Fit) -> tuple[Fit, np.ndarray]:
        steps = 0 if shaped else 4
        current = refitted(evidence, known, others.given, others.free, steps)
        return asked(current), evenly(len(evidence.rows), int(problem.block[-1]) + 1)

    ours = spelled.estimates(asked(selection.last), rows.block, units)
    delayed = traits(selection.last.terms[-1]).late
    problem, others = findings.undelayed if delayed else findings.recorded
    late = [
        {
            name: own._replace(standard_error=np.hypot(own.standard_error, selection.time_error))
            for name, own in term.items()
        }
        for term in ours[len(others.last.terms) :]
    ]
    both = ours[: len(others.last.terms)]
    if problem.wide is not None:
        current, block = again(problem.wide, others.last)
        false = aliased(asked(others.last), problem.evidence.rows, current)
        wide = spelled.estimates(current, block, units, false)
        both = [spelled.with_smoothing(*pair) for pair in zip(both, wide, strict=True)]
    if problem.held is not None:
        # A moment's parameters are its recording's own, and so is the phase of an encoder's zero.
        lasting = verification.lasting(others.last, others.rephased)
        there = spelled.estimates(*again(problem.held, lasting), units)
        own = {id(term): values for term, values in zip(lasting.terms, there, strict=True)}
        both = [
            spelled.with_elsewhere(mine, own.get(id(term), mine))
            for term, mine in zip(others.last.terms, both, strict=True)
        ]
    return both + late
