"""Which friction model a recording supports: the first open issue of Kim, Kim & Ha (2004)."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .. import signals
from ..data.recording import Recording, require, require_force
from ..models import Model, named, weighed
from ..terms.base import AbstractTerm
from .identifying import identify
from .projections import WeakForm

# Each fold is made of this many stretches spread over the record, so that a drift or a trajectory
# of several parts does not put one part alone into a fold.
STRETCHES = 4
# Fewer samples hold no five folds of a model of three parameters a direction.
FEWEST = 16


class Candidate(NamedTuple):
    """One model's standing: number of parameters, held-out mean-square force residual of each
    fold, N², and the root of their mean relative to the force, dimensionless.
    """

    name: str
    parameters: int
    held_out: np.ndarray
    force_error: float


class Selection(NamedTuple):
    """The chosen model's name, and all candidates by rising held-out error."""

    name: str
    candidates: tuple[Candidate, ...]


def select(
    recording: Recording,
    candidates: Mapping[str, AbstractTerm] | Sequence[str] | None = None,
    *,
    folds: int = 5,
) -> Selection:
    """The simplest friction model that predicts held-out force as well as the best one does.

    Every candidate is identified by the weak form with one fold of the record left out, and judged
    on the rows of that fold. Among the candidates whose mean error exceeds the least one by no
    more than one standard error of the difference over the folds, the one with the fewest
    parameters is chosen (the one-standard-error rule, Breiman et al. 1984, on paired differences).

    **Arguments:** `recording`, one recording; `candidates`, models by name, or names; by default
    the named models, each with its own directions and with tied ones; `folds`, at least two.

    **Raises:** `ValueError` if no candidate could be identified on every fold.
    """
    require(recording, "select", least=FEWEST)
    require_force(recording, "select")
    if candidates is None:
        stems = ("coulomb-viscous", "gaussian", "lorentzian", "exponential")
        candidates = (*stems, *(f"symmetric-{stem}" for stem in stems))
    if not isinstance(candidates, Mapping):
        candidates = {name: named(name) for name in candidates}
    prepared = signals.prepare(recording)
    width = signals.kernel_half_width(prepared)
    fold = _folds(prepared, folds)
    standings = [
        _standing(name, term, prepared, width, fold, folds) for name, term in candidates.items()
    ]
    able = sorted((c for c in standings if np.isfinite(c.force_error)), key=lambda c: c.force_error)
    if not able:
        raise ValueError(
            "No candidate could be identified on every fold: the recording is too short or hardly "
            "moves. Use fewer folds or a longer recording."
        )
    near = [c for c in able if _excess(c, able[0]) <= 1]
    return Selection(min(near, key=lambda c: c.parameters).name, tuple(able))


def _excess(candidate: Candidate, best: Candidate) -> float:
    """Mean excess of the held-out error over the best one's, in standard errors over the folds."""
    excess = candidate.held_out - best.held_out
    error = np.std(excess, ddof=1) / np.sqrt(excess.size)
    return 0.0 if np.all(excess == 0) else float(np.mean(excess) / max(error, 1e-300))


def _folds(recording: Recording, folds: int) -> jax.Array:
    """The fold that each sample belongs to, `(N,)`: stretches of equal length, dealt in turn."""
    stretch = np.arange(recording.num_samples) * folds * STRETCHES // recording.num_samples
    return jnp.asarray(stretch % folds)


def _standing(name, term, recording, width, fold, folds) -> Candidate:
    left_out = fold[None, :] == jnp.arange(folds)[:, None]
    batch = jax.tree.map(lambda x: jnp.broadcast_to(x, (folds, *x.shape)), recording)
    training = eqx.tree_at(lambda r: r.mask, batch, batch.mask & ~left_out)
    found = identify(term, training, projection=WeakForm(width))
    testing = eqx.tree_at(lambda r: r.mask, batch, batch.mask & left_out)
    square, size = _judge(found.model, testing, width)
    held_out = np.asarray(square)
    relative = float(np.sqrt(np.mean(held_out) / np.mean(np.asarray(size))))
    return Candidate(name, len(term.affine) + len(term.nonlinear), held_out, relative)


@eqx.filter_jit
def _judge(models: Model, recordings: Recording, width: int):
    """Mean-square residual and force of each fold's rows in slip, N²."""

    def one(pair):
        model, recording = pair
        rows = WeakForm(width).rows(recording, signals.scales(recording))
        # A direction that no other fold shows has no force; a model without any value, no number.
        unknown = jnp.where(jnp.all(jnp.isnan(model.alpha)), jnp.nan, 0.0)
        predicted = weighed(rows.columns(model.term, recording), model.alpha, unknown)
        left = rows.target - predicted - rows.offset(model.term, recording)
        weight = rows.positive + rows.negative
        total = jnp.sum(weight)
        return jnp.sum(weight * left**2) / total, jnp.sum(weight * rows.target**2) / total

    return jax.lax.map(one, (models, recordings))
