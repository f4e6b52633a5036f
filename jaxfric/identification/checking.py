"""What was identified, checked on the host before anyone sees it."""

import dataclasses
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .. import checks, signals
from ..checks import Design
from ..data.recording import Recording, row_of
from ..terms.base import AbstractTerm, changed_columns
from . import constant_load, uncertainty
from .identified import Identified, Result, result_names


def faults(
    recording: Recording, rows: Sequence[signals.Ready], given: int | None = None
) -> np.ndarray:
    """The faults of a recording as it was read, `(W,)`, or of a batch, `(B, W)`.

    `rows`: the same prepared, each; `given`: of how many samples it is an
    [`excerpt`][jaxfric.data.excerpt].
    """
    host = jax.tree.map(np.asarray, recording)
    if host.time.ndim == 1:
        found = checks.recorded(host, rows[0])
        if given is not None and given > recording.num_samples:
            found[checks.NAMES.index("excerpt")] = recording.num_samples / given
        return found
    return checks.recorded_rows(host, rows)


def looked_at(
    recording: Recording, rows: Sequence[signals.Ready], given: int | None = None
) -> "Future[np.ndarray]":
    """The [`faults`][] of a recording that is not traced, found while others compute."""
    pool = ThreadPoolExecutor(1, "jaxfric")
    found = pool.submit(faults, recording, rows, given)
    pool.shutdown(wait=False)  # its thread ends with what it was given
    return found


def checked(
    found: Identified, design: Design, recording: Recording, faults: np.ndarray
) -> Identified:
    """What was identified with its warnings, and with the error that a late force makes, to first
    order, in its covariance; a severe warning makes a row contradictory.

    `faults`: those of the recording itself, by `checks.recorded`, `(W,)`, or `(B, W)` of a batch.
    """
    warnings = np.array(faults, ndmin=2)
    names, batch = found.names[: len(found.model.term.affine)], faults.ndim == 2
    designs, logs = jax.tree.map(
        lambda x: np.asarray(x) if batch else np.asarray(x)[None], (design, recording)
    )
    alphas, matrices, errors = (
        np.array(x, float, ndmin=n)
        for x, n in ((found.model.alpha, 2), (found.covariance, 3), (found.filtered_force_error, 1))
    )
    spreads = np.diagonal(matrices, axis1=1, axis2=2)[:, : len(names)]
    halves = uncertainty.student_quantile(0.975, uncertainty.COSINES) * np.sqrt(spreads)
    delayed = found.model.force_delay is not None
    passive = [i for i, n in enumerate(names) if checks.passive(n)]
    intervals = signals.host_intervals(logs)
    looks = checks.looks(designs)
    fits = [
        checks.Estimated(alpha, half, float(interval), look.late, delayed)
        for alpha, half, interval, look in zip(alphas, halves, intervals, looks, strict=True)
    ]
    suspect = checks.suspects(designs, errors, looks, fits)
    for i, (fit, error) in enumerate(zip(fits, errors, strict=True)):
        alpha, half, interval, late, _ = fit
        fitted = checks.places({})
        if suspect[i]:
            fitted = checks.fitted(row_of(designs, i), float(error), fit)
            warnings[i] = np.where(np.isnan(fitted), warnings[i], fitted)
        late_force = not np.isnan(fitted[LATE])
        if unsure := abs(fitted[LATE]) if late_force else _unsure(late, interval, delayed):
            shift = designs.shift[i] * unsure
            matrices[i] += np.outer(shift, shift)
        # Those told from zero, of the ones that no passive axis has below it.
        sure = [k for k in passive if abs(alpha[k]) > half[k]]
        if logs.position is not None and np.isnan(fitted[STRUCTURE]):
            own, log = row_of(designs, i), row_of(logs, i)
            if checks.hides(own, log.time, log.position, log.mask, alpha, sure):
                warnings[i, STRUCTURE] = error
        # A force that is late by cycles bends the curve, too.
        if not late_force and (missed := checks.misfit(row_of(designs, i))):
            warnings[i, checks.NAMES.index(missed.name) :][:2] = missed.most, missed.at
        if negative := _negative(names, alpha, half, passive):
            warnings[i, NEGATIVE] = negative
        if not np.isnan(warnings[i, ONE_SPEED]) and "inertia" in names:
            # What accelerates the axis there is noise.
            k = names.index("inertia")
            if not abs(alpha[k]) > half[k]:
                matrices[i, k, k], alphas[i, k] = np.inf, np.nan
        if not np.isnan(gain := warnings[i, GAIN]):
            shift = (gain - 1) * _by_velocity(found, i)
            matrices[i] += np.outer(shift, shift)
    count = _open_shapes(found.model.term, alphas, matrices)
    warnings[:, SHAPE] = np.where(count > 0, count, np.nan)
    severe = np.array([kind.severe for kind in checks.KINDS])
    wrong = np.any(~np.isnan(warnings) & severe, axis=1).reshape(faults.shape[:-1])
    warnings = warnings.reshape(faults.shape).astype(np.asarray(found.filtered_force_error).dtype)
    hidden = np.isinf(np.diagonal(matrices, axis1=1, axis2=2)).any(axis=1)
    flat = (hidden & ~np.isnan(warnings[..., ONE_SPEED].ravel())).reshape(wrong.shape)
    model = found.model
    if np.isnan(alphas).any():
        known = jnp.asarray(alphas.reshape(model.alpha.shape), model.alpha.dtype)
        model = dataclasses.replace(model, alpha=known)
    return dataclasses.replace(
        found,
        model=model,
        covariance=jnp.asarray(matrices.reshape(found.covariance.shape), found.covariance.dtype),
        warnings=jnp.asarray(warnings),
        result=_contradicted(_unexcited(found.result, flat), wrong),
    )


def _negative(names: tuple[str, ...], alpha: np.ndarray, half: np.ndarray, passive) -> int:
    """How many of the `passive` parameters, by number, are negative for sure.

    Of a load beyond the dry friction one direction has the friction less the load.
    """
    loaded = constant_load.load(names, alpha, half) is not None
    counted = [k for k in passive if not (loaded and checks.passive(names[k]) == "coulomb")]
    return int(np.sum((alpha + half)[counted] < 0))


def _open_shapes(term: AbstractTerm, alphas: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    """How many ratio-scaled shapes of each row are known no better than down to zero, of sizes that
    seem sure, `(B,)`.

    Of affine parameters `alphas`, `(B, p)`, and the covariances of all, `(B, P, P)`. An interval
    is a straight line's: so far from the value the size is another one.
    """
    beta = np.array(term.beta(), float).reshape(len(alphas), -1)
    width = uncertainty.student_quantile(0.975, uncertainty.COSINES)
    reach = width * np.sqrt(np.diagonal(matrices, axis1=1, axis2=2))
    half, reach = np.split(reach, [alphas.shape[1]], axis=1)
    sure, count = np.abs(alphas) > half, np.zeros(len(alphas), int)
    for i, (parameter, sizes) in enumerate(zip(term.nonlinear, changed_columns(term), strict=True)):
        if parameter.logarithmic:
            count += (reach[:, i] >= beta[:, i]) & sure[:, sizes].any(axis=1)
    return count


def _unsure(late: checks.Lateness | None, interval: float, delayed: bool) -> float:
    """The standard error, s, of the moment at which the force acts.

    Whether it is held or its stamp is right is not known: all of a sure lateness is an error. Where
    a delay was found, that it was found is.
    """
    if late is None:
        return 0.0
    return abs(late.time) if late.sure(interval) else late.error if delayed else 0.0


def _by_velocity(found: Identified, row: int) -> np.ndarray:
    """By how much each parameter moves where the velocity is another, times its relative change.

    What has a time in its unit is measured by the velocity, what has none by the position.
    """
    term = found.model.term
    values = np.array([np.ravel(value)[row] for value in found.model.parameters.values()], float)
    units = [p.dimension for p in (*term.affine, *term.nonlinear)]
    powers = [d.position if not isinstance(d, str) and d.time else 0 for d in units]
    return np.where(np.isfinite(values), values, 0.0) * np.array(powers)


STRUCTURE, ONE_SPEED, GAIN, NEGATIVE, LATE, SHAPE = map(
    checks.NAMES.index,
    (
        "structure_left",
        "one_speed",
        "velocity_gain",
        "negative_parameter",
        "force_late",
        "shape_unknown",
    ),
)


# What says more than that signals contradict each other.
_PLAINER = ("not_finite", "no_slip", "open_windows")


def _unexcited(result: Result, flat: np.ndarray) -> Result:
    """The result where one speed alone is the reason that a bump lies anywhere in its bounds."""
    border, unexcited = (result_names().index(name) for name in ("on_border", "not_excited"))
    own = np.asarray(result._value)
    number = np.where(flat & (own == border), unexcited, own)
    return eqx.tree_at(lambda r: r._value, result, jnp.asarray(number, result._value.dtype))


def _contradicted(result: Result, wrong: np.ndarray) -> Result:
    names = result_names()
    plainer = np.isin(np.asarray(result._value), [names.index(name) for name in _PLAINER])
    number = np.where(wrong & ~plainer, names.index("contradictory"), np.asarray(result._value))
    return eqx.tree_at(lambda r: r._value, result, jnp.asarray(number, result._value.dtype))
