"""Columns of a term at the nodes of a recording, compiled once for each kind of term."""

import copy
import dataclasses
import operator
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .. import programs
from ..data.recording import Recording
from ..terms.base import AbstractTerm

# Values of the nonlinear parameters that one compiled call takes: of a grid, or one with the
# neighbour that gives its derivative.
BATCH, PAIR = 8, 2
# Of a load that is stepped along the motion: of a grid, or one with all neighbours that give its
# derivatives, as eight steps side by side take hardly longer than two.
STEPPED, NEIGHBOURS = 64, 8


def evaluate(term: AbstractTerm, betas: np.ndarray, motion: Recording):
    """Columns, `(B, p, M)`, and momentum, `None` where there is none, at β, `(B, d)`.

    Compiled once for each kind of term and each of the few B: numbers of the recording that are
    built into a term's structure (the middle of the stroke, say) go in as data.
    """
    numbers: list[float] = []

    def take(number: float) -> float:
        numbers.append(number)
        return 1.0

    form = _renumbered(term, take)
    # Nothing is compiled for a channel that the term does not read.
    read = {name: own for name, own in motion.channels.items() if name in term.coordinates}
    if len(read) < len(motion.channels):
        motion = _with_fields(motion, {"channels": read})
    return _compiled(form, betas, np.asarray(numbers, betas.dtype), motion)


def in_batches(
    term: AbstractTerm, betas: np.ndarray, motion: Recording
) -> Iterator[tuple[np.ndarray, np.ndarray | None]]:
    """As [`evaluate`][] at many β, `(G, d)`, of some of them at a time: temporaries stay small."""
    few, most = sizes(term)
    for start in range(0, len(betas), most):
        some = betas[start : start + most]
        size = few if len(some) <= few else most
        full = np.concatenate([some, np.repeat(some[-1:], size - len(some), axis=0)])
        plain, momentum = evaluate(term, full, motion)
        momentum = None if momentum is None else np.asarray(momentum)[: len(some)]
        yield np.asarray(plain)[: len(some)], momentum


def sizes(term: AbstractTerm) -> tuple[int, int]:
    """How many β one compiled call takes: of few, and of many."""
    return (NEIGHBOURS, STEPPED) if term.stepped else (PAIR, BATCH)


def _columns(form, betas, numbers, motion):
    def one(beta):
        inside = iter(numbers)
        known = _renumbered(form.with_beta(beta), lambda _: next(inside))
        return jax.tree.map(jnp.transpose, known.columns_and_momentum(motion))

    if form.nonlinear:
        return jax.vmap(one)(betas)
    alone = one(betas[0])
    return jax.tree.map(lambda x: jnp.broadcast_to(x[None], (len(betas), *x.shape)), alone)


_compiled = programs.compiled(_columns, optimised=programs.LITTLE)


def _renumbered(part: Any, number: Callable[[float], Any]) -> Any:
    """A term whose static floating-point numbers, however deep, are replaced; but zeros, which are
    another form of the law, stay.
    """
    if isinstance(part, float) and part != 0:
        return number(part)
    if isinstance(part, tuple):
        parts = tuple(_renumbered(each, number) for each in part)
        return part if all(map(operator.is_, parts, part)) else parts
    if not isinstance(part, AbstractTerm):
        return part
    changed = {}
    for name, value in vars(part).items():
        if name in _static(type(part)) or isinstance(value, tuple | AbstractTerm):
            new = _renumbered(value, number)
            if new is not value:
                changed[name] = new
    return _with_fields(part, changed) if changed else part


def _with_fields(module: Any, changed: dict[str, Any]) -> Any:
    """A module with other values of some fields, which are neither converted nor checked."""
    other = copy.copy(module)
    for name, value in changed.items():
        object.__setattr__(other, name, value)
    return other


@cache
def _static(kind: type) -> frozenset[str]:
    """The names of a term's fields that are part of its structure."""
    fields = dataclasses.fields(kind)
    return frozenset(field.name for field in fields if field.metadata.get("static"))
