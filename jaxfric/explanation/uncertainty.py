"""Parameters of a model, with errors that contain what other rows of the machine say."""

from collections.abc import Collection
from itertools import zip_longest
from typing import NamedTuple

import numpy as np

from ..identification.uncertainty import Estimate
from ..terms.effects import traits
from ..terms.sample import Scales
from . import parameters as spelled, verification
from .baseline import refitted
from .evidence import Evidence
from .findings import Findings
from .regression import Fit, at_shapes, fast, freed
from .significance import evenly

# A wider kernel that passes less than this part of a term's force says nothing of it: what other
# laws lack, a hundredth of theirs, would be a tenth of it.
PASSES = 0.1


class Estimates(NamedTuple):
    """The parameters of one term by three sets of rows, with each one's own errors.

    `here`: those of the recording; `wide`: through a kernel of twice the width; `there`: those of
    the held-out recording. `None` where there are none, or what they say is not to be compared.
    """

    here: dict[str, Estimate]
    wide: dict[str, Estimate] | None = None
    there: dict[str, Estimate] | None = None

    def joined(self) -> dict[str, Estimate]:
        """Those of the recording, with errors that contain what the others say."""
        found = self.here
        if self.wide is not None:
            found = spelled.with_smoothing(found, self.wide)
        return found if self.there is None else spelled.with_elsewhere(found, self.there)


def estimated(findings: Findings, moved: Collection[int] = ()) -> list[dict[str, Estimate]]:
    """The parameters of each term; their errors contain what a wider kernel and the held-out
    recording change. `moved`: as [`by_rows`][] takes it.
    """
    return [each.joined() for each in by_rows(findings, moved)]


def by_rows(
    findings: Findings, moved: Collection[int] = (), shaped: bool = False
) -> list[Estimates]:
    """The parameters of each term by all rows that there are.

    Where the force acts late, all terms but the last, the delay or lag itself, are estimated with
    the force put back. `moved`: numbers of the base's values that were found wrong, if any; what
    stayed is exact. `shaped`: sizes at the shapes that the terms have.
    """
    selection, rows = findings.selection, findings.problem
    units = rows.evidence.motion.unit_names

    def asked(current: Fit) -> Fit:
        if moved or selection.trusted:
            current = freed(current, moved)
        elif selection.undetermined:  # what is none by choice has no error
            current = freed(current, selection.free)
        return at_shapes(current) if shaped else current

    def again(evidence: Evidence, known: Fit) -> tuple[Fit, np.ndarray]:
        steps = 0 if shaped else 4
        current = refitted(evidence, known, others.given, others.free, steps)
        return asked(current), evenly(len(evidence.rows), int(problem.block[-1]) + 1)

    limits = rows.evidence.limits
    ours = _with_structure(asked(selection.last), rows.block, units, limits)
    delayed = traits(selection.last.terms[-1]).late
    problem, others = findings.undelayed if delayed else findings.recorded
    count = len(others.last.terms)
    late = [
        {
            name: own._replace(standard_error=np.hypot(own.standard_error, selection.time_error))
            for name, own in term.items()
        }
        for term in ours[count:]
    ]
    wide: list[dict[str, Estimate] | None] = []
    if problem.wide is not None:
        current, block = again(problem.wide, others.last)
        values = spelled.estimates(current, block, units, limits)
        forces = [_sizes(each) for each in (current, others.last)]
        pairs = zip(values, *forces, strict=True)
        wide = [own if through >= PASSES * all_of_it else None for own, through, all_of_it in pairs]
    there: dict[int, dict[str, Estimate]] = {}
    if problem.held is not None:
        # A moment's parameters are its recording's own, and so is the phase of an encoder's zero;
        # but an axis that warms does so there as well, and without that its friction is another.
        lasting = verification.lasting(others.last, others.rephased).terms
        known = others.last.only([n for n in range(count) if n not in others.rephased])
        values = spelled.estimates(*again(problem.held, known), units, limits)
        pairs_there = zip(known.terms, values, strict=True)
        there = {id(t): each for t, each in pairs_there if any(t is term for term in lasting)}
    both = zip_longest(ours[:count], wide, map(there.get, map(id, others.last.terms)))
    return [Estimates(*each) for each in both] + [Estimates(each) for each in late]


def _with_structure(
    current: Fit, block: np.ndarray, units: dict[str, str], limits: Scales
) -> list[dict[str, Estimate]]:
    """The parameters of each term; of a load that is stepped along the motion with errors that
    contain what is left beside the noise, were all of it theirs.

    The energy of such a law has many minima, each with a curvature of its own. What it lacks of the
    machine (another part of the friction, a blow that is not straight between two samples) moves it
    from one to the next, which no block and no width of the kernel tells.
    """
    found = spelled.estimates(current, block, units, limits)
    stepped = [number for number, term in enumerate(current.terms) if term.stepped]
    if not stepped:
        return found
    structure = np.sqrt(max(current.energy - len(current.residual) * fast(current) ** 2, 0.0))
    jacobian = current.jacobian
    size = np.sqrt(np.sum(jacobian**2, axis=0))
    size[size == 0] = 1.0
    # Half of what it would be off by: the interval then reaches that far.
    off = 0.5 * structure * np.linalg.norm(np.linalg.pinv(jacobian / size), axis=1) / size
    for number in stepped:
        pairs = zip(found[number].items(), off[current.indices(number)], strict=True)
        found[number] = {
            name: own._replace(standard_error=np.hypot(own.standard_error, more))
            for (name, own), more in pairs
        }
    return found


def _sizes(current: Fit) -> list[float]:
    """The root mean square of each term's force over the rows, N."""
    parts = [current.part(number) for number in range(len(current.terms))]
    return [float(np.sqrt(np.mean(part**2))) for part in parts]
