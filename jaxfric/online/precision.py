"""How well a stream tells its parameters, and what speaks against them.

Strokes are dealt to groups in turn, and one group at a time is left out: the delete-group jackknife
(Shao & Wu 1989, "A general theory for jackknife variance estimation", Annals of Statistics 17).
Noise within a stroke may be correlated in any way.
"""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .. import checks
from ..identification import constant_load
from ..identification.uncertainty import COSINES, Estimate
from ..models import Model
from ..terms.base import AbstractTerm
from .moments import State, Sums
from .solving import Solution, solve

# Degrees of freedom as of `identify`, and one more group.
GROUPS = COSINES + 1
# Parts of the slip time by speed, in each of which a residual has one mean: by chance the power of
# so many means is twice that of their noise once in ten thousand times.
PARTS = 16


class Assessment(NamedTuple):
    """`parameters` with standard errors, infinite of fewer than two strokes, without units;
    `passive`, whether the friction does not drive the axis; `faults`, the numbers of
    [`checks.KINDS`][] by name.
    """

    parameters: dict[str, Estimate]
    passive: bool
    faults: dict[str, float]


def dealt(ring: list[list[Sums]], count: list[int], empty: Sums) -> Sums:
    """The strokes of a window, `ring` of each direction, in their groups, `(G, 2, K)`; `count`, the
    closed strokes; `empty`, sums of that shape, `(2, K)`.
    """
    groups = Sums(*(np.zeros((GROUPS, *x.shape)) for x in empty))
    for side in (0, 1):
        for back, stroke in enumerate(reversed(ring[side])):
            for values, new in zip(groups, stroke, strict=True):
                values[(count[side] - 1 - back) % GROUPS, side] += new
    return groups


def assess(term: AbstractTerm, state: State, groups: Sums, full: Solution) -> Assessment:
    """A solution with its standard errors and faults.

    **Arguments:** `term` from `friction_only`; the `state` that was solved, `full`, and its strokes
    in groups, `(G, 2, K)`.
    """
    others = jax.tree.map(lambda x: _others(np.asarray(x), state.nodes.dtype), groups)
    left_out = jax.vmap(lambda total: solve(term, state._replace(total=total)).model)(others)
    used = int(min(GROUPS, *np.asarray(state.strokes)))
    found = {
        name: _estimate(value, rest, used)
        for (name, value), rest in zip(
            full.model.parameters.items(), left_out.parameters.values(), strict=True
        )
    }
    both = jnp.stack([state.nodes, -state.nodes])
    curve = np.asarray(full.model.friction(both), float)
    curves = np.asarray(jax.vmap(lambda m: m.friction(both))(left_out), float)
    weight = np.asarray(state.total.weight, float)
    faults: dict[str, float] = {}
    if negative := _negative(found, full.model):
        faults["negative_parameter"] = float(negative)
    power = _structure(groups, curve)
    square = float(np.sum(np.asarray(state.total.square, float)))
    if power > min(checks.LEFT**2 * square, _least(found, full.model, weight, both)):
        faults["structure_left"] = float(np.sqrt(power / square))
    return Assessment(found, _passive(weight, curve, curves, used), faults)


def _others(values: np.ndarray, dtype) -> jax.Array:
    """The sum of all groups but each: added up, since a difference would be rounded below zero."""
    return jnp.asarray(np.tensordot(1.0 - np.eye(len(values)), values, axes=1), dtype)


def _estimate(value, rest, used: int) -> Estimate:
    spread = np.asarray(rest, float) - float(value)
    error = np.sqrt((used - 1) / used * np.sum(spread**2)) if used > 1 else np.inf
    return Estimate(np.asarray(value, float), np.asarray(error), "", max(1, used - 1))  # type: ignore[arg-type]


def _negative(found: dict[str, Estimate], model: Model) -> int:
    """How many of Coulomb and viscous friction are negative beyond their intervals.

    Of a load beyond the dry friction one direction has the friction less the load.
    """
    names = tuple(p.name for p in model.term.affine)
    values = np.array([float(found[n].value) for n in names])
    half = np.array([float(found[n].half_width()) for n in names])
    loaded = constant_load.load(names, values, half) is not None
    stems = {"viscous"} if loaded else {"viscous", "coulomb"}
    counted = np.array([checks.passive(n) in stems for n in names], bool)
    return int(np.sum((values + half)[counted] < 0))


def _passive(weight: np.ndarray, curve: np.ndarray, curves: np.ndarray, used: int) -> bool:
    """Whether neither the slower nor the faster half of the slip drives the axis, for sure.

    Half the difference of the means forward and backward counts, in which a constant load cancels.
    """
    slip = np.cumsum(np.sum(weight, axis=0))
    slow = slip <= 0.5 * slip[-1]
    for half in (slow, ~slow):
        time = np.sum(weight[:, half], axis=1)
        if not np.all(time > 0):
            continue
        share = np.where(half, weight, 0.0) / time[:, None] * np.array([[0.5], [-0.5]])
        rest = np.sum(share * curves, axis=(1, 2))
        drag = _estimate(np.sum(share * curve), rest, used)
        if float(drag.value) + float(drag.half_width()) < 0:
            return False
    return True


def _least(found: dict[str, Estimate], model: Model, weight: np.ndarray, speeds) -> float:
    """The power, N²·s, that the weakest of the parameters told from zero adds to all others.

    The bias of a parameter is the part of a missing force along its column, as in `checks.hides`.
    """
    ones = jnp.eye(model.alpha.size, dtype=model.alpha.dtype)
    curves = jax.vmap(lambda a: dataclasses.replace(model, alpha=a).friction(speeds))(ones)
    columns = np.asarray(curves, float).reshape(len(ones), -1)
    own = 1 / np.maximum(np.diag(np.linalg.pinv((columns * weight.ravel()) @ columns.T)), 1e-300)
    estimates = [found[p.name] for p in model.term.affine]
    value = np.array([float(e.value) for e in estimates])
    sure = np.abs(value) > [float(e.half_width()) for e in estimates]
    return float(np.min((value**2 * own)[sure], initial=np.inf))


def _structure(groups: Sums, curve: np.ndarray) -> float:
    """The power, N²·s, that the curve leaves as a function of speed, if more than noise; or 0.

    The mean residuals of groups at one speed are multiplied with each other: noise cancels.
    """
    weight, left = (np.asarray(x, float) for x in (groups.weight, groups.load))
    left = left - weight * curve
    power = noise = 0.0
    for side in (0, 1):
        time = np.cumsum(np.sum(weight[:, side], axis=0))
        if not time[-1] > 0:
            continue
        part = np.minimum((PARTS * time / time[-1]).astype(int), PARTS - 1)
        deal = (part[:, None] == np.arange(PARTS)).astype(float)
        time_of, impulse = weight[:, side] @ deal, left[:, side] @ deal
        whole, total = np.sum(time_of, axis=0), np.sum(impulse, axis=0)
        pairs = whole**2 - np.sum(time_of**2, axis=0)
        own = np.where(pairs > 0, whole / np.where(pairs > 0, pairs, 1.0), 0.0)
        shared = own * (total**2 - np.sum(impulse**2, axis=0))
        power += float(np.sum(shared))
        noise += float(np.sum(total**2 / np.where(whole > 0, whole, 1.0) - shared))
    return power if power > max(noise, 0.0) else 0.0
