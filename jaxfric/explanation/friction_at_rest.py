"""How much friction terms add beside zero speed, by which their sizes are bounded."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .. import programs
from ..data.recording import Recording
from ..terms.base import AbstractTerm, changed_columns, summands
from ..units import FORCE


def beside_rest(terms: Sequence[AbstractTerm], both_ways: bool) -> tuple[np.ndarray, np.ndarray]:
    """How much each affine parameter adds beside zero speed to a friction with a shape that is
    searched, and to dry friction, `(p,)` each.

    Half of both directions: of motion in one, where nothing is known of it, a constant load is part
    of what seems to be friction.
    """
    each = [
        _bumps_and_dry(jax.tree.structure(term), tuple(map(np.shape, jax.tree.leaves(term))))
        for term in terms
    ]
    bumps, dry = (np.concatenate(parts) for parts in zip(*each, strict=True))
    return bumps, dry if both_ways else np.zeros_like(dry)


@cache
def _bumps_and_dry(form: Any, shapes: tuple[tuple[int, ...], ...]) -> tuple[np.ndarray, ...]:
    """Of the terms of one form, with leaves of those `shapes`: half the difference of each column
    beside zero velocity, of those that are bumps of friction and of the others.
    """
    parts = summands(jax.tree.unflatten(form, [np.ones(shape) for shape in shapes]))
    shaped = [
        part.coordinates == {"velocity"}
        and each.dimension == FORCE
        and any(number in changed for changed in changed_columns(part))
        for part in parts
        for number, each in enumerate(part.affine)
    ]
    bumps = np.array(shaped, bool)
    slow = np.sqrt(np.finfo(jax.dtypes.canonicalize_dtype(float)).tiny) * np.array([1.0, -1.0])
    jumps = np.round(np.asarray(_half_difference(parts, slow)), 6)
    # A power of speed begins at zero, and is a bump as well.
    heights = np.where(jumps < 0, jumps, np.maximum(jumps, np.finfo(float).tiny))
    return np.where(bumps, heights, 0.0), np.where(bumps, 0.0, jumps)


@programs.compiled
def _half_difference(parts, velocity):
    """Half of what a column is at one velocity less at the other; zero for other terms, `(p,)`."""
    none = jnp.zeros_like(velocity)
    motion = Recording(none, none, none, velocity)
    halves = [
        0.5 * jnp.subtract(*part.columns(motion))
        if part.coordinates == {"velocity"}
        else jnp.zeros(len(part.affine))
        for part in parts
    ]
    return jnp.concatenate(halves)
