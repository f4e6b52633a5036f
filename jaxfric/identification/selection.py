"""Which friction model a recording supports: the first open issue of Kim, Kim & Ha (2004)."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .. import signals
from ..data.excerpt import excerpt
from ..data.recording import Recording, require, require_force
from ..looks import html, text
from ..models import Model, listed_as, names, weighed
from ..terms.base import AbstractTerm
from ..units import VELOCITY, spell
from . import standings, tabulate
from .identifying import identify
from .projections import WeakForm
from .uncertainty import student_quantile

# Each fold is made of this many stretches spread over the record, so that a drift or a trajectory
# of several parts does not put one part alone into a fold.
STRETCHES = 4
# The check of a fit that says so of its curve.
CONTRADICTED = "curve_missed"
# Fewer samples hold no five folds of a model of three parameters a direction.
FEWEST = 16


class Candidate(NamedTuple):
    """One model's standing: number of parameters, held-out mean-square force residual of each
    fold, N², and the root of their mean relative to the force, dimensionless, with half its 95 %
    interval over the folds.
    """

    name: str
    parameters: int
    held_out: np.ndarray
    filtered_force_error: float
    half_width: float = np.nan


class Selection(NamedTuple):
    """The chosen model's name, all candidates by rising held-out error, the names of those that
    cannot be told from the best, and why not; `contradicted`: simpler ones of these that the whole
    recording contradicts.
    """

    name: str
    candidates: tuple[Candidate, ...]
    tied: tuple[str, ...] = ()
    reason: str = ""
    contradicted: tuple[str, ...] = ()

    def to_dict(self) -> dict:
        """The standings as plain data."""
        rows = [c._asdict() | {"held_out": c.held_out.tolist()} for c in self.candidates]
        return {"model": self.name, "candidates": rows, "tied": list(self.tied),
                "reason": self.reason, "contradicted": list(self.contradicted)}  # fmt: skip

    def __repr__(self) -> str:
        return text.text(tabulate.standings(self.to_dict()))

    def _repr_html_(self) -> str:
        return html.html(tabulate.standings(self.to_dict()))


def select(
    recording: Recording,
    candidates: Mapping[str, AbstractTerm] | Sequence[str] | None = None,
    *,
    folds: int = 5,
) -> Selection:
    """The simplest friction model that predicts held-out force as well as the best one does.

    Every candidate is fitted to the rows of the weak form without those of one fold, and validated
    on these. Among the candidates whose mean error does not exceed the least one significantly
    (5 %, one-sided t test of the folds' ratios), the one with the fewest parameters is chosen, of
    named models the first whose curve the whole recording does not contradict (`curve_missed`). One
    standard error (Breiman et al. 1984) would prefer a needless parameter in 19 % of ties, as five
    folds have four degrees of freedom; and by differences the fold with the largest force decides.

    **Arguments:** `recording`, one recording; `candidates`, models by name, or names; by default
    all named models, each with its own directions and with tied ones; `folds`, at least two.
    Named models share their rows and take a second together; others are identified one by one.

    **Raises:** `ValueError` if no candidate could be identified on every fold.
    """
    require(recording, "select", least=FEWEST)
    require_force(recording, "select")
    if candidates is None:
        candidates = names()
    recording = excerpt(recording)
    prepared = signals.prepare(recording)
    if isinstance(candidates, Mapping):
        width = signals.kernel_half_width(prepared, standings.NARROWEST)
        fold = _folds(prepared, folds)
        found = [
            _standing(name, term, prepared, width, fold, folds) for name, term in candidates.items()
        ]
        return _chosen(found)
    some = (candidates,) if isinstance(candidates, str) else candidates
    candidates = tuple(dict.fromkeys(map(listed_as, some)))
    together, log = standings.all_of(prepared, _stretches(prepared, folds), candidates, folds)
    found = []
    for name, one in together.items():
        error = float(np.sqrt(np.mean(one.held_out) / np.mean(one.size)))
        found.append(
            Candidate(name, one.parameters, one.held_out, error, _half(one.held_out, error))
        )
    chosen = _not_contradicted(_chosen(found), recording)
    speed = spell(VELOCITY, recording.unit_names)
    if len(chosen.tied) < 2:
        return chosen._replace(reason=_unseen(chosen.name, log, speed))
    curves = {name: together[name].curve for name in chosen.tied}
    return chosen._replace(reason=_reason(curves, log, speed, recording.unit_names["force"]))


def _chosen(standings: Sequence[Candidate]) -> Selection:
    able = sorted(
        (c for c in standings if np.isfinite(c.filtered_force_error)),
        key=lambda c: c.filtered_force_error,
    )
    if not able:
        raise ValueError(
            "No candidate could be identified on every fold: the recording is too short or hardly "
            "moves. Use fewer folds or a longer recording."
        )
    level = student_quantile(0.95, able[0].held_out.size - 1)
    near = [c for c in able if _excess(c, able[0]) <= level]
    simplest = min(near, key=lambda c: c.parameters)
    return Selection(simplest.name, tuple(able), tuple(c.name for c in near))


def _not_contradicted(chosen: Selection, recording: Recording) -> Selection:
    """Another choice of those that are alike where the recording contradicts the simplest one's
    curve: five folds tell less than all samples do.
    """
    if len(chosen.tied) < 2:
        return chosen
    alike = [one for one in chosen.candidates if one.name in chosen.tied]
    gone: tuple[str, ...] = ()
    for one in sorted(alike, key=lambda c: (c.parameters, c.filtered_force_error)):
        if not _contradicted(one.name, recording):
            return chosen._replace(name=one.name, contradicted=gone)
        gone = (*gone, one.name)
    return chosen


def _contradicted(name: str, recording: Recording) -> bool:
    found = identify(name, recording)
    return any(remark.name == CONTRADICTED for remark in found.remarks)


def _half(held_out: np.ndarray, error: float) -> float:
    """Half the 95 % interval of the error over the folds: of the mean square, by its root."""
    count = held_out.size
    spread = np.std(held_out, ddof=1) / np.sqrt(count) / np.mean(held_out)
    return float(0.5 * error * student_quantile(0.975, count - 1) * spread)


def _unseen(name: str, log: standings.Regression, speed: str) -> str:
    """What a model without a bump leaves open."""
    if not name.endswith("coulomb-viscous"):
        return ""
    below, why = f"below {standings.recorded(log):.2g} {speed}", _slow_motion(log)
    return f"whether there is a Stribeck bump {below} cannot be told, because {why} {below}"


def _slow_motion(log: standings.Regression) -> str:
    """Why friction below the slowest rows is not seen: the axis is not so slow, or not for long."""
    speed = np.abs(log.speed)
    brief = np.any((speed > log.slowest) & (speed < standings.recorded(log)))
    return "there is too little motion" if brief else "there is no motion"


def _reason(curves: Mapping[str, np.ndarray], log, speed: str, force: str) -> str:
    """Why models cannot be told apart: they differ only where nothing moved, or hardly at all."""
    every = np.stack(list(curves.values()))
    apart = np.max(every, axis=0) - np.min(every, axis=0)  # (2, K)
    speeds, slowest = standings.curve_speeds(log), standings.recorded(log)
    within = float(np.max(apart[:, speeds >= slowest]))
    below = float(np.max(apart[:, speeds < slowest], initial=0.0))
    names = ", ".join(curves)
    if below > 2 * within:
        return (
            f"cannot tell these apart ({names}), because {_slow_motion(log)} below {slowest:.2g} "
            f"{speed}: there their curves differ by up to {below:.2g} {force}, above by "
            f"{within:.2g} at most"
        )
    return (
        f"cannot tell these apart ({names}): over the speeds recorded their curves differ by "
        f"{within:.2g} {force} at most, less than the folds differ by"
    )


def _excess(candidate: Candidate, best: Candidate) -> float:
    """Mean logarithm of the ratio of the held-out errors, in standard errors over the folds."""
    one, other = (np.maximum(each.held_out, 1e-300) for each in (candidate, best))
    excess = np.log(one / other)
    error = np.std(excess, ddof=1) / np.sqrt(excess.size)
    return 0.0 if np.all(excess == 0) else float(np.mean(excess) / max(error, 1e-300))


def _folds(recording: Recording, folds: int) -> jax.Array:
    """The fold that each sample belongs to, `(N,)`: stretches of equal length, dealt in turn."""
    return jnp.asarray(_stretches(recording, folds) % folds)


def _stretches(recording: Recording, folds: int) -> np.ndarray:
    return np.arange(recording.num_samples) * folds * STRETCHES // recording.num_samples


def _standing(name, term, recording, width, fold, folds) -> Candidate:
    left_out = fold[None, :] == jnp.arange(folds)[:, None]
    batch = jax.tree.map(lambda x: jnp.broadcast_to(x, (folds, *x.shape)), recording)
    training = eqx.tree_at(lambda r: r.mask, batch, batch.mask & ~left_out)
    found = identify(term, training, projection=WeakForm(width))
    testing = eqx.tree_at(lambda r: r.mask, batch, batch.mask & left_out)
    square, size = _held_out_power(found.model, testing, width)
    held_out = np.asarray(square)
    relative = float(np.sqrt(np.mean(held_out) / np.mean(np.asarray(size))))
    count = len(term.affine) + len(term.nonlinear)
    return Candidate(name, count, held_out, relative, _half(held_out, relative))


@eqx.filter_jit
def _held_out_power(models: Model, recordings: Recording, width: int):
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
