"""A velocity that is derived from the position, by a kernel that takes nothing off the friction.

The kernel that errs least over a whole record takes most off where the axis turns, and a bump of
friction lies there. So what half of the kernel says is compared: while a parameter moves by more
than the interval that it has then, half of the kernel is taken; and the interval holds what the
next half would say (the rule of Lepski 1991: the widest kernel that narrower ones do not refute).

A velocity that was recorded beside the position is another measurement. One that was late, or is
doubtful at the turns, has been through a filter, and gives way to the position as a wide kernel
does. Another one stays; where the position says something else, beyond the intervals of both, its
interval holds that too.
"""

import dataclasses
from collections.abc import Callable, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .. import signals
from ..checks import Design
from ..data.recording import Recording
from ..signals.polynomial import HALF_WIDTHS
from .identified import Identified, Result
from .setup import Setup
from .uncertainty import COSINES, reach, student_quantile

Solve = Callable[..., tuple[Identified, Design]]


def narrowed(
    solve: Solve,
    setup: Setup,
    rows: Sequence[signals.Ready],
    prepared: Callable[[Sequence[signals.Ready]], Recording],
    found: Identified,
    design: Design,
) -> tuple[Setup, Identified, Design, np.ndarray]:
    """An identification by the widest kernels that half of them does not refute.

    **Arguments:** `rows`, the recording or the rows of a batch, with the kernels of their velocity;
    `prepared`, what the setup has of such; `found` and `design`, what `solve` finds of the setup.

    **Returns:** the same, and by how much the parameters move with half of the kernel, `(..., P)`.
    """
    rows, apart = list(rows), np.zeros(np.shape(_values(found)))
    going = np.ones(len(rows), bool)
    recorded = np.array([row.choice is None and not row.filtered for row in rows])
    while True:
        halves = [_half(row) if go else None for row, go in zip(rows, going, strict=True)]
        going = np.array([half is not None for half in halves])
        if not going.any():
            return setup, found, design, apart
        tried = [half or row for half, row in zip(halves, rows, strict=True)]
        recording = prepared(tried)
        other, its = solve(*setup._replace(recording=recording))
        moved = np.atleast_2d(_values(other) - _values(found))
        own, half = (np.atleast_2d(_half_widths(each)) for each in (found, other))
        known = np.isfinite(moved) & np.isfinite(half)
        sure = np.atleast_1d(np.asarray(other.result == Result.successful))
        refuted = going & ~recorded & sure & np.any(known & (np.abs(moved) > half), axis=1)
        counted = known & (going & ~refuted)[:, None]
        unlike = sure[:, None] & (np.abs(moved) > own + half)
        counted &= np.where(recorded[:, None], unlike, True)
        apart = np.where(counted, moved, np.atleast_2d(apart)).reshape(apart.shape)
        taken = refuted if recording.time.ndim == 2 else refuted[0]
        found, design = _where(taken, (other, its), (found, design))
        setup = setup._replace(recording=_where(taken, recording, setup.recording))
        rows = [new if yes else old for new, old, yes in zip(tried, rows, refuted, strict=True)]
        going = refuted


def reaching(found: Identified, apart: np.ndarray) -> Identified:
    """The same with intervals that reach as far as the parameters move, `(..., P)`."""
    step = reach(apart)
    more = step[..., :, None] * step[..., None, :]
    wider = found.covariance + jnp.asarray(more, found.covariance.dtype)
    return eqx.tree_at(lambda f: f.covariance, found, wider)


def _half(row: signals.Ready) -> signals.Ready | None:
    """The row with its velocity by half of the kernel; `None` where there is no such."""
    choice = row.choice or (row.anew and row.anew.choice)
    if choice is None:
        return None
    width = choice.half_width // 2
    if width < HALF_WIDTHS[0] or 2 * width < choice.degree:
        return None
    choice = choice._replace(half_width=width)
    bare = dataclasses.replace(row.recording, velocity=None)
    return row._replace(recording=signals.prepare(bare, choice), choice=choice)


def _values(found: Identified) -> np.ndarray:
    """The parameters, affine ones first, `(..., P)`."""
    return np.stack([np.asarray(x) for x in found.model.parameters.values()], axis=-1)


def _half_widths(found: Identified) -> np.ndarray:
    """Of the 95 % intervals, `(..., P)`."""
    variance = np.diagonal(np.asarray(found.covariance), axis1=-2, axis2=-1)
    return student_quantile(0.975, COSINES) * np.sqrt(np.maximum(variance, 0.0))


def _where(rows, new, old):
    """A pytree of the `new` leaves in those rows of a batch, or all of them."""

    def pick(mine, theirs):
        mask = np.reshape(rows, np.shape(rows) + (1,) * (np.ndim(mine) - np.ndim(rows)))
        return jnp.where(mask, mine, theirs)

    return jax.tree.map(pick, new, old)
