"""The force errors of an explanation: as a user gets them, and through the kernel of the rows."""

from typing import Any

import jax
import numpy as np

from ..data.recording import Recording
from ..models import Model
from ..terms.base import changed_columns
from . import parameters as spelled, verification
from .acceptance import LINEARITY
from .baseline import at_values
from .bins import unit
from .evidence import gather
from .figures import Figures, cast
from .findings import Findings, Solution
from .improvement import Improved, holdout_model
from .locate import Structure
from .mismatch import SURE
from .motion import motion_of
from .predictions import with_predictions
from .regression import Fit, fit
from .significance import blocks
from .wording import ELSEWHERE


def filtered_errors(findings: Findings, first: Fit) -> dict[str, Any]:
    """The force errors through the kernel of the rows."""
    recorded, (problem, selection) = findings.problem, findings.undelayed

    def pair(before, after, rephased=frozenset()):
        return {
            "before": verification.error(first, before),
            "after": verification.error(selection.last, after, rephased),
        }

    held = recorded.held and pair(recorded.held, problem.held, selection.rephased)
    return {
        "force_error": pair(recorded.evidence, problem.evidence),
        "holdout_force_error": held,
        "noise_floor": verification.noise(selection.last, problem.evidence.force),
    }


def document(
    better: Improved, filtered: dict, model: Model, figures: Figures, tone: Structure | None = None
) -> dict:
    """The document's errors: those of `predict` and a subtraction, and those through the kernel.

    `tone`: one that is left and is no noise.
    """

    def pair(before, after):
        return None if before is None else {"before": before, "after": after}

    before, after, problem = better.before, better.after, better.findings.problem
    reach = problem.evidence.reach
    refitted = _refitted(better.findings, figures)
    return {
        "force_error": pair(before.here, after.here),
        "holdout_force_error": pair(before.held, after.held),
        "holdout_adjusted": _adjusted(better.findings) if problem.held else None,
        "holdout_refitted_error": refitted["error"],
        "holdout_values": refitted["values"],
        "simulation_error": None,
        "noise_floor": figures.floor(model, 2 * reach, tone),
        "holdout_noise_floor": _held_floor(better.findings, figures, 2 * reach),
        "filtered_force_error": filtered["force_error"]
        | {
            "width": reach,
            "force_taken_later": problem.delay,
            "force_taken_later_after": better.findings.undelayed.problem.delay,
            "across_reversals": problem.reversals,
            "slowest": _slowest(better.findings),
        },
        "filtered_holdout_force_error": filtered["holdout_force_error"],
        "filtered_holdout_refitted_error": refitted["filtered"],
        "filtered_noise_floor": filtered["noise_floor"],
    }


def _slowest(findings: Findings) -> dict[str, Any] | None:
    """The speed of the slowest row, with its unit, below which nothing is said of friction; `None`
    where rows reach across reversals, where the curve is that of the samples, and where that is
    within an octave of the slowest slip, so that hardly any slip is left out.
    """
    evidence, selection = findings.problem.evidence, findings.selection
    if findings.problem.reversals or selection.curve:
        return None
    slowest = float(np.min(np.abs(np.asarray(evidence.motion.velocity)[evidence.centre])))
    if slowest <= 2 * evidence.limits.slowest:
        return None
    return {"value": slowest, "unit": unit("velocity", evidence.motion.unit_names)}


def _held_floor(findings: Findings, figures: Figures, lag: float) -> float | None:
    """What noise alone makes on the held-out recording; `None` without one."""
    if findings.problem.held is None:
        return None
    return figures.floor(holdout_model(findings), lag, where="held")


def _refitted(findings: Findings, figures: Figures) -> dict[str, Any]:
    """What the model leaves of the held-out recording with values of its own, and which these are.

    Listed are values of the baseline's terms that differ by more than both recordings leave open,
    unless this recording is left with as little by them: then it does not determine them.
    """
    problem, selection = findings.undelayed
    if problem.held is None:
        return dict.fromkeys(("error", "filtered", "values"))
    again = _fitted_there(findings.undelayed)
    model = findings.model(findings.with_late(again))
    known = selection.fitted and _left_by(findings.undelayed, again) > ELSEWHERE * (
        verification.error(selection.last, problem.evidence)
    )
    return {
        "error": figures.held(model),
        "filtered": verification.error(again, problem.held),
        "values": _differing(findings.undelayed, again) if known else {},
    }


def _fitted_there(solution: Solution) -> Fit:
    """The model fitted to the held-out recording."""
    problem, selection = solution
    carried = verification.carried(selection.last, problem.held, selection.rephased)
    return fit(carried.terms, with_predictions(problem.held, carried), carried.betas)


def brief(findings: Findings) -> float | None:
    """About when most of what the model leaves of the held-out recording, fitted to it, is left.

    In s; `None` where no one of its blocks holds more than half of it.
    """
    solution = findings.undelayed
    held, left = solution.problem.held, _fitted_there(solution).residual ** 2
    by_block = np.bincount(blocks(held.elapsed[held.centre], held.reach), left)
    if by_block.max() <= 0.5 * left.sum():
        return None
    return float(np.asarray(held.motion.time)[held.centre[np.argmax(left)]])


def _left_by(solution: Solution, again: Fit) -> float:
    """What is left of this recording's force, relative, with the first term of another fit."""
    evidence, last = solution.problem.evidence, solution.selection.last
    seen = with_predictions(evidence, last)
    other = seen.columns(last.terms[0], again.betas[0][None])[0] @ again.alphas[0]
    left = last.residual + last.part(0) - other
    return float(np.linalg.norm(left)) / max(float(np.linalg.norm(evidence.force)), 1e-300)


def _differing(solution: Solution, again: Fit) -> dict[str, dict[str, Any]]:
    """Values of the first term that are others on the held-out recording, here and there.

    By more than both errors, and of forces that this recording would show with the values there: of
    a bump that is narrower than its slowest row it says nothing, whatever it has in place of it.
    """
    problem, held = solution.problem, solution.problem.held
    units = problem.evidence.motion.unit_names
    here = spelled.estimates(solution.selection.last, problem.block, units)[0]
    there = spelled.estimates(again, blocks(held.elapsed[held.centre], held.reach), units)[0]
    term = again.terms[0]
    names = [p.name for p in (*term.affine, *term.nonlinear)]
    shown = dict(zip(names, _shown(solution, again), strict=True))
    return {
        name: {
            "here": float(own.value),
            "there": float(there[name].value),
            "standard_error": float(np.hypot(own.standard_error, there[name].standard_error)),
            "unit": own.unit,
        }
        for name, own in here.items()
        if shown.get(name, True)
        and abs(own.value - there[name].value)
        > SURE * np.hypot(own.standard_error, there[name].standard_error)
    }


def _shown(solution: Solution, again: Fit) -> list[bool]:
    """Whether this recording's rows would show the force of each parameter of another fit's first
    term, affine ones first: it is more than a sensor of force resolves.
    """
    evidence, last = solution.problem.evidence, solution.selection.last
    term, beta = again.terms[0], again.betas[0]
    columns = with_predictions(evidence, last).columns(term, beta[None])[0]
    sizes = np.linalg.norm(columns * again.alphas[0], axis=0)
    seen = sizes >= LINEARITY * np.linalg.norm(evidence.force)
    return [*map(bool, seen), *(bool(np.any(seen[list(own)])) for own in changed_columns(term))]


def _adjusted(findings: Findings) -> dict[str, list[str]]:
    """Findings that the held-out figures take at another phase, as changed before, or leave out."""
    problem, selection = findings.undelayed
    there = verification.carried(selection.last, problem.held, selection.rephased)
    adjusted: dict[str, list[str]] = {"left_out": [], "rephased": [], "changed_before": []}
    known = {
        id(term): own for term, *own in zip(there.terms, there.alphas, there.betas, strict=True)
    }
    for number, selected in enumerate(selection.selected):
        index = selection.term_index(number)
        term, last = selection.last.terms[index], selection.last
        if id(term) not in known:
            adjusted["left_out"].append(selected.effect.name)
        elif not np.array_equal(known[id(term)][0], last.alphas[index]):
            adjusted["rephased"].append(selected.effect.name)
        elif not np.array_equal(known[id(term)][1], last.betas[index]):
            adjusted["changed_before"].append(selected.effect.name)
    return adjusted


def through_kernel(
    model: Model,
    recording: Recording,
    delay: float = 0.0,
    reach: float | None = None,
    reversals: bool = False,
) -> float:
    """A model's force error through the kernel, at its own values; the others as `gather` takes."""
    with jax.enable_x64(True):
        motion = motion_of(cast(recording))
        evidence = gather(motion, delay=delay, reach=reach, reversals=reversals)
        given = at_values(cast(model), evidence)
    return float(np.sqrt(given.energy / float(evidence.force @ evidence.force)))
