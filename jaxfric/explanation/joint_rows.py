"""One joint's log as rows of a regression that several joints share: by what its bodies weigh."""

import dataclasses
from collections.abc import Callable, Collection
from typing import NamedTuple

import numpy as np

from ..data.recording import Recording
from ..models import Model
from ..simulators import Mujoco
from ..simulators.weights import by_gravity, linear, pulled
from ..terms import KnownColumns, KnownForce, Offset, channels_of
from ..terms.base import AbstractTerm, summands
from ..terms.effects import traits
from .evidence import Evidence, gather, reduced
from .fewest import SURE
from .figures import cast
from .least_squares import orthonormal, solve
from .motion import motion_of
from .nodes import NODES
from .predictions import with_predictions
from .regression import Fit, fit
from .significance import blocks


class JointRows(NamedTuple):
    """One joint's rows, divided by its noise, without the span of the physics that was found in it.

    - `name` of the joint; `own`: names of its own values, p of them, in the simulator's words.
    - `columns` `(J, p + 3 + 22 B)`: the force by a unit of its own values, of gravity along each
      axis, and of the ten parameters that the force of each of the model's B bodies is linear in;
      then of gravity along each axis on a unit of mass and of first moment of each body;
      `target` `(J,)`: what the simulator, as given, leaves; `block` of each row, `(J,)`.
    - `enough`: the energy below which no sensor of force tells anything, in units of the noise's.
    - `noise`, N or N·m, and the `evidence` that the rows are of, where it is known.
    """

    name: str
    own: tuple[str, ...]
    columns: np.ndarray
    target: np.ndarray
    block: np.ndarray
    enough: float
    noise: float = 1.0
    evidence: Evidence | None = None


class Opened(NamedTuple):
    """A joint's evidence, and what the model's values add to its force.

    `own`: rows `(J, p)` by the values of its own, of those `names`; then by what all joints have,
    three of gravity, ten of each body with mass, and the products of both, P together: `columns`
    `(J, P)`, and their rest and momentum at the nodes, `shared`, `(P, M)` each.
    """

    evidence: Evidence
    names: tuple[str, ...]
    own: np.ndarray
    columns: np.ndarray
    shared: tuple[np.ndarray, np.ndarray]


def opened(
    simulator: Mujoco, log: Recording, delay: float, wide: int = 1, width: int | None = None
) -> Opened:
    """A joint's evidence, by a simulator as given; the arguments as of [`joint_rows`][]."""
    seen, beside = simulator.along(log), simulator.beside(log)
    of = simulator.mujoco, simulator.model, simulator.number, seen
    turned, products = (
        [(rest, np.zeros_like(rest)) for rest in each(*of)] for each in (by_gravity, pulled)
    )
    attributes = [channels_of(number) for number in range(len(simulator.attributes()))]
    each = {n: np.asarray(beside.channels[n], float) for pair in attributes for n in pair}
    bare = {n: values for n, values in beside.channels.items() if n not in each}
    motion = motion_of(cast(dataclasses.replace(beside, channels=bare)))
    evidence = gather(motion, width, delay=delay)
    if wide > 1:
        evidence = gather(motion, wide * evidence.width, delay, half=wide * NODES)
    names, own = [], []
    for name, (rest, momentum) in zip(simulator.attributes(), attributes, strict=True):
        if not name.startswith("body/"):
            names.append(name)
            own.append((each[rest], each[momentum]))
    known = evidence.project(*reduced(motion, evidence, own)).T
    constant = [t for t in summands(simulator.baseline(log.units).term) if isinstance(t, Offset)]
    more = [evidence.columns(t, np.zeros((1, 0)))[0] for t in constant]
    names += [p.name for t in constant for p in t.affine]
    shared = reduced(motion, evidence, turned + linear(*of) + products)
    return Opened(
        evidence, tuple(names), np.concatenate([known, *more], axis=1),
        evidence.project(*shared).T, shared,
    )  # fmt: skip


def joint_rows(
    simulator: Mujoco, log: Recording, found: Model, delay: float, linearity: float,
    wide: int = 1, width: int | None = None, needless: Collection[AbstractTerm] = (),
) -> JointRows:  # fmt: skip
    """The rows of a joint.

    **Arguments:** `simulator` as given, `log` `(N,)`; `found`, the model of the joint's own
    explanation, whose missing physics stands beside, but for the terms `needless`; `delay`, s, by
    which the force is taken later; `linearity` of a sensor of force, relative; `wide`: how many
    times the usual kernel's width, or how many times `width`, samples in half of it.
    """
    evidence, names, own, shared, _ = opened(simulator, log, delay, wide, width)
    columns = np.concatenate([own, shared], axis=1)
    basis = physics(found, evidence, among(needless))
    columns = columns - basis @ (basis.T @ columns)
    target = evidence.target - basis @ (basis.T @ evidence.target)
    left = target - columns @ solve(columns, target)
    noise = max(float(np.sqrt(np.mean(left**2))), 1e-300)
    enough = (linearity / noise) ** 2 * float(evidence.force @ evidence.force)
    block = blocks(evidence.elapsed[evidence.centre], evidence.reach)
    return JointRows(
        simulator.joint, names, columns / noise, target / noise, block, enough, noise, evidence
    )


def physics(
    found: Model, evidence: Evidence, but: Callable[[AbstractTerm], bool] = lambda term: False
) -> np.ndarray:
    """An orthonormal basis of the force of the missing physics that a joint's model holds, `but`
    for some terms.
    """
    terms, betas, alphas, start = [], [], [], 0
    for term in summands(found.term):
        alpha = np.asarray(found.alpha[start : start + len(term.affine)], float)
        start += len(term.affine)
        terms.append(term)
        betas.append(np.asarray(term.beta(), float).reshape(len(term.nonlinear)))
        alphas.append(alpha)
    empty = np.zeros((len(evidence.target), 0))
    whole = Fit(tuple(terms), tuple(betas), tuple(alphas), empty, empty, evidence.target, 0.0)
    missing = [i for i, term in enumerate(terms) if _is_physics(term) and not but(term)]
    if not missing:
        return empty
    seen = with_predictions(evidence, _without_known(whole))
    there = fit(whole.only(missing).terms, seen, whole.only(missing).betas, 0)
    return orthonormal(there.jacobian)


def among(some: Collection[AbstractTerm]) -> Callable[[AbstractTerm], bool]:
    """Whether a term is one of some: itself, not another of equal values."""
    return lambda term: any(term is each for each in some)


def missing(found: Model) -> tuple[AbstractTerm, ...]:
    """The terms of the missing physics that a joint's model holds."""
    return tuple(term for term in summands(found.term) if _is_physics(term))


def needless(rows: JointRows, found: Model, shift: np.ndarray) -> tuple[AbstractTerm, ...]:
    """The terms of a joint's missing physics that take no more of what other values leave than
    noise like that puts into them, or than a sensor of force resolves; one after the other.

    **Arguments:** `rows` without any physics in their span; `found`, the joint's model; `shift`
    `(p + 3 + 22 B,)`: the values, by the rows' columns.
    """
    evidence, gone = rows.evidence, tuple[AbstractTerm, ...]()
    assert evidence is not None
    residual = rows.target - rows.columns @ shift
    while True:
        whole, least = physics(found, evidence, among(gone)), {}
        for number, term in enumerate(missing(found)):
            if among(gone)(term):
                continue
            rest = physics(found, evidence, among((*gone, term)))
            lone = orthonormal(whole - rest @ (rest.T @ whole))
            enough = max(rows.enough, by_chance(lone, residual, rows.block))
            least[number] = float(np.sum((lone.T @ residual) ** 2)) / max(enough, 1e-300)
        weakest = min(least, key=lambda number: least[number], default=None)
        if weakest is None or least[weakest] > 1:
            return gone
        gone = (*gone, missing(found)[weakest])


def by_chance(basis: np.ndarray, noise: np.ndarray, block: np.ndarray) -> float:
    """The energy that noise puts into directions at most: its mean and 3.5 standard deviations.

    **Arguments:** orthonormal `basis` `(J, r)`; `noise` `(J,)`, which is correlated within each
    `block` `(J,)` and not beyond.
    """
    count = int(block[-1]) + 1
    sums = np.array([np.bincount(block, each * noise, count) for each in basis.T])
    if not len(sums):
        return 0.0
    # A quadratic form of normal variables of covariance C: its mean is tr C, its variance 2 tr C².
    covariance = sums @ sums.T
    return float(np.trace(covariance) + SURE * np.sqrt(2 * np.sum(covariance**2)))


def _is_physics(term) -> bool:
    return not isinstance(term, KnownForce | KnownColumns | Offset) and not traits(term).late


def _without_known(whole: Fit) -> Fit:
    """The fit without what a simulator says its parameters add, which predicts little."""
    return whole.only([i for i, t in enumerate(whole.terms) if not isinstance(t, KnownColumns)])
