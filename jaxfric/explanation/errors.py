"""The force errors of an explanation: as a user gets them, and through the kernel of the rows."""

from typing import Any

import jax
import numpy as np

from ..data.recording import Recording
from ..models import Model
from . import parameters as spelled, verification
from .baseline import SURE, at_values
from .chance import blocks
from .evidence import gather, motion_of
from .figures import Figures, cast
from .improvement import Improved, Rest, with_late
from .naming import Named
from .predictions import with_predictions
from .problem import Problem
from .regression import Fit, fit


def filtered_errors(problem: Problem, first: Fit, where: Problem, left: Named) -> dict[str, Any]:
    """The force errors through the kernel of the rows."""

    def pair(before, after, rephased=frozenset()):
        return {
            "before": verification.error(first, before),
            "after": verification.error(left.last, after, rephased),
        }

    return {
        "force_error": pair(problem.evidence, where.evidence),
        "holdout_force_error": problem.held and pair(problem.held, where.held, left.rephased),
        "noise_floor": verification.noise(left.last, where.evidence.force),
    }


def document(
    problem: Problem, better: Improved, filtered: dict, model: Model, figures: Figures
) -> dict:
    """The document's errors: those of `predict` and a subtraction, and those through the kernel."""

    def pair(before, after):
        return None if before is None else {"before": before, "after": after}

    before, after, reach = better.before, better.after, problem.evidence.reach
    refitted = _refitted(problem, better, figures)
    return {
        "force_error": pair(before.here, after.here),
        "holdout_force_error": pair(before.held, after.held),
        "holdout_adjusted": _adjusted(better) if problem.held else None,
        "holdout_refitted_error": refitted["error"],
        "holdout_values": refitted.get("values"),
        "simulation_error": None,
        "noise_floor": figures.floor(model, 2 * reach),
        "filtered_force_error": filtered["force_error"]
        | {"width": reach, "force_taken_later": problem.delay},
        "filtered_holdout_force_error": filtered["holdout_force_error"],
        "filtered_holdout_refitted_error": refitted["filtered"],
        "filtered_noise_floor": filtered["noise_floor"],
    }


def _refitted(problem: Problem, better: Improved, figures: Figures) -> dict[str, Any]:
    """What the model leaves of the held-out recording with values of its own, and which these are.

    Named are values of the baseline's terms that differ by more than both recordings leave open.
    """
    if problem.held is None:
        return dict.fromkeys(("error", "filtered"))
    left, units = better.rest[1], problem.evidence.motion.units
    held = better.rest[0].held
    carried = verification.carried(left.last, held, left.rephased)
    again = fit(carried.terms, with_predictions(held, carried), carried.betas)
    late = len(better.found.last.terms) - len(left.last.terms)
    whole = with_late(again, better.found.last, late) if late else again
    return {
        "error": figures.held(spelled.model(whole, units)),
        "filtered": verification.error(again, held),
        "values": {} if better.found.given else _differing(better.rest, again),
    }


def _differing(rest: Rest, again: Fit) -> dict[str, dict[str, Any]]:
    """Values of the first term that are others on the held-out recording, here and there."""
    where, left = rest
    units = where.evidence.motion.unit_names
    here = spelled.estimates(left.last, where.block, units)[0]
    elapsed = where.held.elapsed[where.held.centre]
    there = spelled.estimates(again, blocks(elapsed, where.held.reach), units)[0]
    return {
        name: {
            "here": float(own.value),
            "there": float(there[name].value),
            "standard_error": float(np.hypot(own.standard_error, there[name].standard_error)),
            "unit": own.unit,
        }
        for name, own in here.items()
        if abs(own.value - there[name].value)
        > SURE * np.hypot(own.standard_error, there[name].standard_error)
    }


def _adjusted(better: Improved) -> dict[str, list[str]]:
    """Findings that the held-out figures take at another phase, or leave out."""
    where, left = better.rest
    there = verification.carried(left.last, where.held, left.rephased)
    start = len(left.last.terms) - len(left.taken)
    said: dict[str, list[str]] = {"left_out": [], "rephased": []}
    kept = {id(term): alpha for term, alpha in zip(there.terms, there.alphas, strict=True)}
    for number, taken in enumerate(left.taken):
        term, alpha = left.last.terms[start + number], left.last.alphas[start + number]
        if id(term) not in kept:
            said["left_out"].append(taken.trial.candidate.effect.name)
        elif not np.array_equal(kept[id(term)], alpha):
            said["rephased"].append(taken.trial.candidate.effect.name)
    return said


def through_kernel(model: Model, recording: Recording, delay: float = 0.0) -> float:
    """A model's force error through the kernel, at its own values; `delay` as `gather` takes it."""
    with jax.enable_x64(True):
        evidence = gather(motion_of(cast(recording)), delay=delay)
        given = at_values(cast(model), evidence)
    return float(np.sqrt(given.energy / float(evidence.force @ evidence.force)))
