"""The verb: locate where a model and a recording differ, name what is missing, verify it."""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from .. import terms as laws
from ..identified import Identified
from ..models import Model, named
from ..recording import Recording
from ..terms.base import AbstractTerm
from . import parameters as spelled, verification
from .candidates import OF_THE_MOMENT, Field
from .chance import blocks
from .evidence import Evidence, gather
from .explained import Explanation, Finding
from .locate import Place, locate
from .naming import LATER_SHARE, LEAST_SHARE, LEVEL, Named, contest, search
from .predictions import with_predictions
from .regression import Fit, fit
from .sentences import sentence


class _Question(NamedTuple):
    """A recording through a kernel and one of twice the width, its base fit, the held-out one."""

    evidence: Evidence
    wide: Evidence | None
    held: Evidence | None
    base: Fit
    block: np.ndarray
    structure: AbstractTerm


def explain(
    recording: Recording,
    baseline: str | AbstractTerm | Model | Identified = "gaussian",
    holdout: Recording | None = None,
    *,
    seed: int = 0,
) -> Explanation:
    """What a model leaves out of a recording: where, what, how much, and what could not be seen.

    **Arguments:** `recording` and `holdout`, signals of shape `(N,)`; `baseline`, a model's name,
    a sum of terms, or a model whose parameters are refitted; `seed` of the bootstrap.

    **Raises:** `ValueError` if the recording slips for too short a time.
    """
    structure, name = _structure(baseline)
    asked = _question(recording, holdout, structure)
    found = search(asked.evidence, asked.base, structure, asked.wide, seed)
    found = _verified(found, asked, structure, seed)
    return _explained(recording, asked, found, name, seed)


def _structure(baseline) -> tuple[AbstractTerm, str]:
    if isinstance(baseline, str):
        return named(baseline), baseline
    if isinstance(baseline, Identified):
        baseline = baseline.model
    if isinstance(baseline, Model):
        return baseline.term, "model"
    return baseline, "model"


def _question(recording, holdout, structure) -> _Question:
    motion = _from_position(recording)
    first = gather(motion)
    wide = _wider(motion, first.width)
    delay = _alignment([first] if wide is None else [first, wide], structure)
    evidence = gather(motion, first.width, delay)
    wide = None if wide is None else gather(motion, wide.width, delay)
    held = None
    if holdout is not None:
        held = gather(_from_position(holdout), evidence.width, delay)
    base = fit([structure], evidence)
    block = blocks(evidence.elapsed[evidence.centre], evidence.reach)
    return _Question(evidence, wide, held, base, block, structure)


def _wider(recording: Recording, width: int) -> Evidence | None:
    try:
        return gather(recording, 2 * width)
    except ValueError:  # too few rows are left between the reversals
        return None


def _from_position(recording: Recording) -> Recording:
    """A recorded velocity is late by its filter, which would look like a delay of the force."""
    if recording.position is None:
        return recording
    return dataclasses.replace(recording, velocity=None)


def _alignment(views: list[Evidence], structure: AbstractTerm) -> float:
    """How much later the force is to be taken, s, to belong to the same instant as the position.

    A force that is held from sample to sample acts half a sample late, a controller that needs the
    cycle for its computation one more: within a sample either way it is a matter of logging, which
    nobody calls a fault. What is beyond is left to be found. The wider kernel decides where the
    two differ, since noise of the encoder moves the narrow one only.
    """
    sample, delays = views[0].limits.interval, []
    for evidence in views:
        now = fit([structure], evidence)
        seen = with_predictions(evidence, now)
        both = fit([structure, laws.TransportDelay()], seen, [now.betas[0], None])
        delays.append(float(both.alphas[1][0]))
    delay = delays[0] if abs(delays[0] - delays[-1]) < 0.5 * sample else delays[-1]
    return -delay if abs(delay) <= sample else -0.5 * sample


def _verified(found: Named, asked: _Question, structure, seed) -> Named:
    """Without terms that do not help on the held-out recording."""
    if asked.held is None:
        return found
    evidence = with_predictions(asked.evidence, found.last)
    for number in reversed(range(len(found.taken))):
        if found.taken[number].trial.candidate.effect.name in OF_THE_MOMENT:
            continue
        less = verification.without(found, evidence, number)
        if verification.share(less, found.last, found.base, asked.held) <= 0:
            taken = [t for i, t in enumerate(found.taken) if i != number]
            left = contest(evidence, less, Field(evidence, structure), seed)
            found = found._replace(last=less, taken=taken, left=left)
    return found


def _explained(recording, asked: _Question, found: Named, name: str, seed: int) -> Explanation:
    units, evidence = recording.unit_names, asked.evidence
    before = locate(with_predictions(evidence, found.base), found.base, seed)
    seen = with_predictions(evidence, found.last)
    after = locate(seen, found.last, seed) if found.taken else before
    findings = _findings(found, asked, seen, units)
    base_parameters = spelled.estimates(found.base, asked.block, units)[0]
    return Explanation(
        verdict=_verdict(found, before, after),
        where=[_where(p, units) for p in before if p.p_value <= LEVEL and p.share >= LEAST_SHARE],
        findings=findings,
        fit=_errors(found, asked),
        not_visible=_not_visible(found, units),
        model=spelled.model(found.last, recording.units),
        baseline=spelled.model(found.base, recording.units),
        baseline_name=name,
        baseline_parameters=base_parameters,
        recording=_facts(recording),
    )


def _verdict(found: Named, before: list[Place], after: list[Place]) -> str:
    places = after if found.taken else before
    least = LATER_SHARE if found.taken else LEAST_SHARE
    left = any(p.p_value <= LEVEL and p.share >= least for p in places)
    if found.taken:
        return "partly_explained" if left else "explained"
    return "unexplained" if left else "consistent"


def _findings(found: Named, asked: _Question, seen: Evidence, units) -> list[Finding]:
    start = len(found.last.terms) - len(found.taken)
    values = spelled.estimates(found.last, asked.block, units)[start:]
    findings = []
    for number, (taken, parameters) in enumerate(zip(found.taken, values, strict=True)):
        effect = taken.trial.candidate.effect
        less = verification.without(found, seen, number)
        share = (less.energy - found.last.energy) / found.base.energy
        held = None
        if asked.held is not None and effect.name not in OF_THE_MOMENT:
            held = verification.share(less, found.last, found.base, asked.held)
        rivals = taken.rivals
        text = sentence(effect.name, parameters, share, rivals)
        findings.append(
            Finding(
                effect.name,
                effect.equation,
                text,
                rivals,
                effect.separate_by,
                parameters,
                float(share),
                held,
                taken.p_value,
            )  # fmt: skip
        )
    return sorted(findings, key=lambda finding: -finding.share)


_SPELLED = {"position_lines": "period", "time_lines": "frequency"}


def _where(place: Place, units: Mapping[str, str]) -> dict[str, Any]:
    detail = ""
    if place.coordinate == "position_lines":
        detail = f"period {1 / place.peak:.4g} {units['position']}"
    elif place.coordinate == "time_lines":
        detail = f"{place.peak:.4g} Hz"
    elif len(place.curve[0]):
        at, height = place.curve
        peak = int(np.argmax(np.abs(height)))
        detail = f"strongest at {at[peak]:.3g}"
    return {
        "coordinate": place.coordinate.removesuffix("_lines"),
        "share": place.share,
        "size": place.size,
        "p_value": place.p_value,
        "detail": detail,
    }


def _errors(found: Named, asked: _Question) -> dict[str, Any]:
    def pair(evidence):
        return {
            "before": verification.error(found.base, evidence),
            "after": verification.error(found.last, evidence),
        }

    return {
        "force_error": pair(asked.evidence),
        "holdout_force_error": None if asked.held is None else pair(asked.held),
        "simulation_error": None,
        "noise_floor": verification.noise(found.last, asked.evidence.target),
    }


def _not_visible(found: Named, units) -> list[dict[str, Any]]:
    names = {taken.trial.candidate.effect.name for taken in found.taken}
    sizes = verification.smallest_visible(found.left, found.last)
    return [
        {"effect": effect, "smallest_detectable": float(size), "unit": units["force"]}
        for effect, size in sorted(sizes.items(), key=lambda item: item[1])
        if effect not in names
    ]


def _facts(recording: Recording) -> dict[str, Any]:
    time, mask = np.asarray(recording.time), np.asarray(recording.mask)
    steps = np.diff(time[mask])
    steps = steps[steps > 0]
    return {
        "file": recording.source,
        "samples": int(mask.sum()),
        "duration": float(steps.sum()),
        "sample_rate": float(1 / np.median(steps)),
    }
