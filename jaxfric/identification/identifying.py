"""Identification as it is called: one recording or a batch, its projection, its checks."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .. import signals
from ..checks import Design
from ..data.excerpt import excerpt
from ..data.recording import Recording, require, uniform
from ..models import Model
from ..terms.base import AbstractTerm
from . import alignment, grouping
from .checking import checked, looked_at
from .identified import Identified, Result, raise_unless_successful
from .narrowing import narrowed, reaching
from .projections import AbstractProjection, WeakForm
from .setup import Setup, ready_rows, set_up, structure, together
from .solving import solve_one, solve_rows

# Closed windows that use less than this share of the slip time leave most of the record's
# information on the floor; those with less than this root of the squared speed's share, in one
# direction, tell its viscous friction half as well as all of it would: a move that ends elsewhere
# may be the only fast one. Then the weak form, which needs no closing, is the better choice.
LEAST_COVERED = 0.5


def identify(
    model: AbstractTerm | Model | Identified | str,
    recording: Recording,
    *,
    projection: AbstractProjection | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    grid: int | None = None,
    align: bool = False,
    throw: bool = False,
) -> Identified:
    """The parameters of a sum of terms from a recording (Kim, Kim & Ha 2004, section III).

    **Arguments:**

    - `model`: a sum of terms, a model's name, or an earlier result (its structure is used).
    - `recording`: one recording, or a batch made by `stack`: then every leaf of the result has a
      leading axis, and what goes wrong in a row stays in that row.
    - `projection`: `ClosedWindows()` (mass and acceleration cancel; the paper) or
      `WeakForm(half_width)`; by default the terms decide, and closed windows that would
      use less than half of the slip time, or a quarter of the squared speed in one direction, give
      way to the weak form.
    - `bounds`: lower and upper bound of nonlinear parameters by name; else from the recording.
    - `grid`: points a side of the grid over the nonlinear parameters.
    - `align`: find by how much the force acts after its time stamp, half a sample for one that is
      held, and take it into account; the model keeps it as its `force_delay`. Not inside `jax.jit`.
    - `throw`: raise if any result is not successful.

    Outside of `jax.jit` the signals and what the model leaves of them are checked too: `warnings`
    and `remarks` of the result, and signals that contradict each other are its `result`. Of more
    than 262,144 samples sixteen pieces, evenly spread, are used, and a remark says so. A model that
    reads the position takes the integral of the velocity where none is recorded.

    Inside `jax.jit` and its derivatives the numbers of the recording are not known, so that
    nothing is chosen by them: the kernel reaches 24 samples each way, closed windows never give way
    to the weak form, and a velocity that is not recorded is derived by another kernel. The result
    is another one, by some per cent at times. For the same, prepare outside and give the width:
    `log = signals.prepare(recording)`, `n = signals.kernel_half_width(log)`, and inside
    `identify(model, log, projection=WeakForm(n))`.

    **Raises:** `ValueError` for closed windows with terms that depend on more than velocity, for
    `align` inside `jax.jit`, and, with `throw`, for any other failure.
    """
    require(recording, "identify", batch=True)
    traced, batch = signals.is_traced(recording), recording.time.ndim == 2
    if align and traced:
        raise ValueError(
            "align=True looks at the numbers of a fit, which are not known inside jax.jit: "
            "identify outside, or shift the force first."
        )
    given = recording.num_samples
    if "position" in structure(model).coordinates:
        recording = signals.placed(recording)
    recording = recording if traced or batch else excerpt(recording)
    rows = [] if traced else ready_rows(recording)
    how = _How(model, projection, bounds, grid, align, given)
    found = _batch(how, recording, rows) if rows and batch else _together(how, recording, rows)
    if throw:
        raise_unless_successful(found)
    return found


class _How(NamedTuple):
    """The arguments of [`identify`][], and of how many samples a recording may be an excerpt."""

    model: AbstractTerm | Model | Identified | str
    projection: AbstractProjection | None
    bounds: Mapping[str, tuple[float, float]] | None
    grid: int | None
    align: bool
    given: int


def _batch(how: _How, recording: Recording, rows: Sequence[signals.Ready]) -> Identified:
    """The rows of a batch, each with the kernel and the projection that it has alone."""
    if isinstance(how.projection, WeakForm):
        return _together(how, recording, rows)
    keys = [
        (signals.kernel_half_width(row.recording), grouping.length(np.asarray(row.recording.mask)))
        for row in rows
    ]

    def solve(some: np.ndarray, key: tuple[int, int], how: _How = how) -> Identified:
        width, samples = key
        part = jax.tree.map(lambda x: x[some, :samples], recording)
        own = [rows[i] for i in some]
        own = [r._replace(recording=grouping.shortened(r.recording, samples)) for r in own]
        return _together(how, part, own, width)

    found = grouping.grouped(keys, solve)
    if how.projection is not None or bool(np.all(found.weak)):
        return found
    wide = np.flatnonzero(_too_open(found))
    if not wide.size:
        return found

    def weakly(some: np.ndarray, key: tuple[int, int]) -> Identified:
        return solve(wide[some], key, how._replace(projection=WeakForm(key[0])))

    return grouping.replaced(found, wide, grouping.grouped([keys[i] for i in wide], weakly))


def _together(
    how: _How, recording: Recording, rows: Sequence[signals.Ready], width: int | None = None
) -> Identified:
    """One recording, or the rows of a batch by one program; `width`, of their kernel, if known."""
    batch = recording.time.ndim == 2

    def ready(rows):
        return together(recording, rows) if batch else _plain(rows[0].recording)

    prepared = ready(rows) if rows else None
    setup = set_up(how.model, recording, *how[1:4], width=width, prepared=prepared)
    solve = solve_rows if batch else solve_one
    looked = looked_at(recording, rows, how.given) if rows else None
    found, design = solve(*setup)
    weak = WeakForm(setup.width)
    known = not batch and not isinstance(found.covered, jax.core.Tracer)
    if how.projection is None and setup.projection != weak and known and _too_open(found):
        found, design = solve(*setup._replace(projection=weak))
        setup = setup._replace(projection=weak)
    apart = None
    if rows and setup.term.nonlinear:
        setup, found, design, apart = narrowed(solve, setup, rows, ready, found, design)
    if how.align:
        found, design = _aligned(solve, setup, found, design)
    if apart is not None and apart.any():
        found = reaching(found, apart)
    found = eqx.tree_at(lambda f: f.model, found, _named_in(found.model, recording.units))
    if looked and not any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(found)):
        found = checked(found, design, recording, looked.result())
    return found


def _aligned(solve, setup: Setup, found: Identified, design: Design) -> tuple[Identified, Design]:
    """The same with the force where it acts, and a model that says by how much that is later."""
    given = setup.recording
    delay = np.zeros(given.time.shape[:-1])
    for _ in range(alignment.ROUNDS):
        more = alignment.later(design, given)
        if not more.any():
            break
        delay = delay + more
        found, design = solve(*setup._replace(recording=alignment.at_stamps(given, delay)))
    model = dataclasses.replace(
        found.model, force_delay=jnp.asarray(delay, found.model.alpha.dtype)
    )
    return eqx.tree_at(lambda f: f.model, found, model), design


def _plain(recording: Recording) -> Recording:
    """A recording with nothing of its own that a compiled program would be made for: no name, no
    units, and one of few lengths.
    """
    return dataclasses.replace(uniform(recording), units=())


def _named_in(model: Model, units) -> Model:
    return dataclasses.replace(model, units=units)


def _too_open(found: Identified) -> np.ndarray:
    """Whether closed windows leave out too much of a recording, or of each row of a batch.

    Where the axis never slips another projection finds no slip either.
    """
    moves = np.asarray(found.result != Result.no_slip)
    return (np.asarray(found.covered) < LEAST_COVERED) & moves
