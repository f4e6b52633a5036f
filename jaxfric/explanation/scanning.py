"""All candidates scanned for what they remove of a residual, and how likely chance does as much."""

from itertools import chain

import numpy as np

from .candidates import Candidate, CandidateSet
from .evidence import Evidence
from .significance import LEVEL, BlockBootstrap, Scan, adjusted
from .threads import each


def scanned(
    bootstrap: BlockBootstrap, field: CandidateSet, seen: Evidence
) -> tuple[list[Scan], np.ndarray]:
    """The scans of all candidates, group by group, and their p-values, `(C,)`.

    Where one is significant the residual is no noise. Then those that remove more and are not are
    scanned again as beside structure.
    """

    def first(group: list[Candidate]) -> list[Scan]:
        pairs = zip(group, field.columns(group, seen), strict=True)
        return [bootstrap(columns, one.effect.positive) for one, columns in pairs]

    groups = each(first, field.groups)
    scans = list(chain.from_iterable(groups))
    p_values = _p_values(scans)
    known = [s.gain[s.best] for s, p_value in zip(scans, p_values, strict=True) if p_value <= LEVEL]
    if not known:
        return scans, p_values
    doubtful = {
        id(scan)
        for scan, p_value in zip(scans, p_values, strict=True)
        if p_value > LEVEL and scan.gain[scan.best] > max(known)
    }

    def again(pair: tuple[list[Candidate], list[Scan]]) -> list[Scan]:
        group, own = pair
        if doubtful.isdisjoint(map(id, own)):
            return own
        every = zip(group, own, field.columns(group, seen), strict=True)
        return [
            bootstrap.beside_structure(scan, columns, one.effect.positive)
            if id(scan) in doubtful
            else scan
            for one, scan, columns in every
        ]

    scans = list(chain.from_iterable(each(again, zip(field.groups, groups, strict=True))))
    return scans, _p_values(scans)


def between(
    bootstrap: BlockBootstrap, scans: list[Scan], number: int, columns: np.ndarray, positive: bool
) -> float:
    """The p-value of what was found between the points of the grid of candidate `number`, which is
    as good as a point of it, among all candidates.

    Of a law with many minima the grid may miss all: what its best point leaves is no noise, and its
    flipped signs are fitted as well as it. Beside what was found only noise is left to be flipped.

    **Arguments:** `columns`: those of the grid and of what was found, `(G, k, J)`.
    """
    every = [*scans]
    every[number] = bootstrap(columns, positive)
    return float(_p_values(every)[number])


def _p_values(scans: list[Scan]) -> np.ndarray:
    """p-values of the best group of each scan, corrected for all of them, `(C,)`."""
    return adjusted(np.array([s.gain[s.best] for s in scans]), np.array([s.drawn for s in scans]))
