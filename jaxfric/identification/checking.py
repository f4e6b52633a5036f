"""What was identified, checked on the host before anyone sees it."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .. import checks
from ..checks import Design
from ..data.recording import Recording
from . import uncertainty
from .identified import Identified, Result, result_names


def faults(recording: Recording, given: int | None = None) -> np.ndarray:
    """The faults of a recording as it was read, `(W,)`, or of a batch, `(B, W)`.

    `given`: of how many samples it is an [`excerpt`][jaxfric.data.excerpt].
    """
    host = jax.tree.map(np.asarray, recording)
    if recording.time.ndim == 1:
        found = checks.recorded(host)
        if given is not None and given > recording.num_samples:
            found[checks.NAMES.index("excerpt")] = recording.num_samples / given
        return found
    rows = range(len(host.time))
    return np.stack([checks.recorded(jax.tree.map(lambda x, i=i: x[i], host)) for i in rows])


def checked(
    found: Identified, design: Design, recording: Recording, faults: np.ndarray
) -> Identified:
    """What was identified with its warnings; a severe one makes a row contradictory.

    `faults`: those of the recording itself, by `checks.recorded`, `(W,)`, or `(B, W)` of a batch.
    """
    warnings = np.array(faults, ndmin=2)
    motion = (recording.time, recording.position, recording.mask)
    host = jax.tree.map(np.asarray, (found, design, motion))
    for i in range(len(warnings)):
        row, own, where = jax.tree.map(lambda x, i=i: x[i], host) if faults.ndim == 2 else host
        fitted = checks.fitted(own, float(row.filtered_force_error))
        time, position, mask = where
        alpha, sure = _certain(row)
        if np.isnan(fitted[STRUCTURE]) and checks.hides(own, time, position, mask, alpha, sure):
            fitted[STRUCTURE] = float(row.filtered_force_error)
        warnings[i] = np.where(np.isnan(fitted), warnings[i], fitted)
        if (negative := _negative(row)) > 0:
            warnings[i, checks.NAMES.index("negative_parameter")] = negative
    severe = np.array([kind.severe for kind in checks.KINDS])
    wrong = np.any(~np.isnan(warnings) & severe, axis=1).reshape(faults.shape[:-1])
    warnings = warnings.reshape(faults.shape).astype(np.asarray(found.filtered_force_error).dtype)
    return dataclasses.replace(
        found, warnings=jnp.asarray(warnings), result=_contradicted(found.result, wrong)
    )


STRUCTURE = checks.NAMES.index("structure_left")


def _passive(row: Identified) -> list[int]:
    """Numbers of inertia, Coulomb and viscous friction among the affine parameters."""
    affine = row.names[: len(row.model.term.affine)]
    return [i for i, n in enumerate(affine) if n.startswith(("inertia", "coulomb", "viscous"))]


def _half_widths(row: Identified) -> np.ndarray:
    """Halves of the 95 % intervals of the affine parameters, `(p,)`; infinite where unknown."""
    count = len(row.model.term.affine)
    variance = np.diagonal(np.asarray(row.covariance, float))[:count]
    return uncertainty.student_quantile(0.975, uncertainty.COSINES) * np.sqrt(variance)


def _negative(row: Identified) -> int:
    """How many of inertia, Coulomb and viscous friction are negative beyond their intervals."""
    high = np.asarray(row.model.alpha, float) + _half_widths(row)
    return int(np.sum(high[_passive(row)] < 0))


def _certain(row: Identified) -> tuple[np.ndarray, list[int]]:
    """The affine parameters, and which of the passive ones are told from zero."""
    alpha = np.asarray(row.model.alpha, float)
    sure = np.abs(alpha) > _half_widths(row)
    return alpha, [i for i in _passive(row) if sure[i]]


# What says more than that signals contradict each other.
_PLAINER = ("not_finite", "no_slip", "open_windows")


def _contradicted(result: Result, wrong: np.ndarray) -> Result:
    names = result_names()
    plainer = np.isin(np.asarray(result._value), [names.index(name) for name in _PLAINER])
    number = np.where(wrong & ~plainer, names.index("contradictory"), np.asarray(result._value))
    return eqx.tree_at(lambda r: r._value, result, jnp.asarray(number, result._value.dtype))
