"""The parameters of what was found, as every view of the machine shows them."""

from collections.abc import Iterator

import numpy as np

from ..identification.uncertainty import Estimate
from ..terms.effects import traits
from . import parameters as spelled, verification
from .evidence import Evidence
from .naming import Named
from .predictions import with_predictions
from .question import Question
from .regression import Fit, fit


def estimated(found: Named, asked: Question, rest) -> list[dict[str, Estimate]]:
    """The parameters of each term; their errors contain what another view of the machine changes.

    Views are a kernel of twice the width and the held-out recording. Where the force acts late,
    that is seen with the force put back, `rest`, by all terms but the last, which is the delay or
    lag itself.
    """
    units = asked.evidence.motion.unit_names
    ours = spelled.estimates(found.last, asked.block, units)
    where, left = rest if traits(found.last.terms[-1]).late else (asked, found)
    late = [
        {
            name: own._replace(standard_error=np.hypot(own.standard_error, found.smoothed))
            for name, own in term.items()
        }
        for term in ours[len(left.last.terms) :]
    ]
    both, count = ours[: len(left.last.terms)], int(where.block[-1]) + 1
    if where.wide is not None:
        wide = _seen_by(where.wide, left.last, count, units)
        both = [spelled.with_smoothing(*pair) for pair in zip(both, wide, strict=True)]
    if where.held is not None:
        # A moment's parameters are its recording's own, and so is the phase of an encoder's zero.
        lasting = verification.lasting(left.last, left.rephased)
        there = _seen_by(where.held, lasting, count, units)
        own = {id(term): values for term, values in zip(lasting.terms, there, strict=True)}
        both = [
            spelled.with_elsewhere(mine, own.get(id(term), mine))
            for term, mine in zip(left.last.terms, both, strict=True)
        ]
    return both + late


def _seen_by(view: Evidence, known: Fit, count: int, units) -> list[dict[str, Estimate]]:
    """The parameters of a model refitted to another view of the machine, in `count` blocks."""
    again = fit(known.terms, with_predictions(view, known), known.betas, 4)
    return spelled.estimates(again, np.arange(len(view.rows)) * count // len(view.rows), units)


def weightless(found: Named, asked: Question) -> Iterator[int]:
    """Numbers of the findings that add inertia, all of which may as well be none.

    Of a load on a spring that leaves its friction, which acts late: another effect, with fewer
    parameters.
    """
    start = len(found.last.terms) - len(found.taken)
    added = found.last.terms[start:]
    if not any(term.inertial for term in added):
        return
    values = estimated(found, asked, (asked, found))[start:]
    for number, (term, known) in enumerate(zip(added, values, strict=True)):
        sizes = (
            estimate.interval()
            for name, estimate in known.items()
            if name.startswith("amplitude") or any(name == p.name for p in term.affine)
        )
        if term.inertial and not any(low * high > 0 for low, high in sizes):
            yield number
