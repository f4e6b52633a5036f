"""What was planted in a real recording, scored by the difference to the recording as it is."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jaxfric.validation.concealed.kinds import unrepeated
from jaxfric.validation.proof.planning import Case
from jaxfric.validation.proof.scoring import Score, held_out, score
from jaxfric.validation.proof.trials import ANSWERS, SEALED, failed, path, read

# Parameters that say where a finding is: two with others are two findings.
PLACES = ("pitch", "unbalance_period", "friction_period", "inertia_period", "frequency",
          "spot_position", "step_time")  # fmt: skip
# A machine has one stop at each end, wherever it is said to begin.
ENDS = ("stop_position", "lower_stop_position")
# Places that differ by less, or by less than twice their standard error, are the same place.
SAME = 0.02


def scores(folder: Path, cases: Sequence[Case]) -> list[Score]:
    """Open what was sealed, and score the planted cases against those to the logs as they are."""
    own: dict[str, dict[str, Any]] = {}
    found: list[Score] = []
    for case in cases:
        if not path(folder, ANSWERS, case).is_file():
            continue
        answer = read(path(folder, ANSWERS, case))
        log = case.name.rpartition("-")[0]
        if not case.effects:
            own[log] = answer
            continue
        truth = path(folder, SEALED, case)
        sealed = read(truth) if truth.is_file() else None
        if answer["error"] is None and own.get(log, {"error": "not there"})["error"] is not None:
            answer = answer | failed(f"{log} as it is has no answer")
        elif answer["error"] is None and sealed is not None:
            answer = difference(answer, own[log], case.effects)
            if unrepeated(case.effects):
                answer["oracle"] = None
        found.append(score(case, sealed, answer))
    return found


def difference(
    answer: Mapping[str, Any], own: Mapping[str, Any], effects: Sequence[str]
) -> dict[str, Any]:
    """An answer without what the recording shows as it is.

    Findings: those of the same effect at the same place are its own, unless this effect was planted
    and its part has grown by half of what the baseline's residual has, in power; so are those that
    are declared confusable with one of its own that is not named again, unless they are what was
    planted, or as large as half of that growth and declared confusable with what was planted too.
    Where: a place counts if it was not there, or if its structure has grown by half of what the
    residual has. Held-out error: that before is freed of what its own findings remove, in squares;
    the oracle, who knows the planted force, is left with what the recording's own model leaves.
    """
    first, now = _power(own["where"]), _power(answer["where"])
    half = 0.5 * max(now - first, 0.0)

    def grown(finding, known) -> bool:
        more = (finding["share"] or 0.0) * now - (known["share"] or 0.0) * first
        return finding["effect"] in effects and more > half > 0

    def renamed(finding) -> bool:
        alike = {*finding["confusable_with"]}
        large = (finding["share"] or 0.0) * now > half > 0
        meant = finding["effect"] in effects or (large and bool(alike & {*effects}))
        return not meant and bool(gone & alike)

    gone = {known["effect"] for known in own["findings"]}
    gone -= {finding["effect"] for finding in answer["findings"]}
    rest = [
        f for f in answer["findings"]
        if not renamed(f)
        and not any(same(f, known) and not grown(f, known) for known in own["findings"])
    ]  # fmt: skip
    before: dict[str, float] = {}
    for place in own["where"]:
        name = place["coordinate"]
        before[name] = max(before.get(name, 0.0), place["size"])
    where = [
        place
        for place in answer["where"]
        if place["size"] ** 2 - before.get(place["coordinate"], 0.0) ** 2 > half
        or place["coordinate"] not in before
    ]
    return {**answer, "findings": rest, "where": where, **_errors(answer, own)}


def _power(where: Sequence[Mapping[str, Any]]) -> float:
    """Mean square of the baseline's residual, of which each place has its share; 0 without any."""
    return next((p["size"] ** 2 / p["share"] for p in where if p["share"] > 0), 0.0)


def same(finding: Mapping[str, Any], known: Mapping[str, Any]) -> bool:
    """Whether two findings are of one effect, at one place where the effect has one."""
    if finding["effect"] != known["effect"]:
        return False
    if any((name in finding["parameters"]) != (name in known["parameters"]) for name in ENDS):
        return False
    for name in PLACES:
        if name in finding["parameters"] and name in known["parameters"]:
            here, there = (f["parameters"][name] for f in (finding, known))
            spread = math.hypot(*(e["standard_error"] or 0.0 for e in (here, there)))
            apart = abs(here["value"] - there["value"])
            return apart <= max(SAME * abs(there["value"]), 2 * spread)
    return True


def _errors(answer, own) -> dict[str, Any]:
    held, alone = (held_out(a["fit"]) for a in (answer, own))
    if held is None or alone is None:
        return {}
    before, after = (held[when] * answer["held_norm"] for when in ("before", "after"))
    first, last = (alone[when] * answer["own_norm"] for when in ("before", "after"))
    known = math.sqrt(max(before**2 - max(first**2 - last**2, 0.0), last**2))
    errors = {"before": known / answer["held_norm"], "after": held["after"]}
    fit = answer["fit"] | {"holdout_force_error": errors, "filtered_holdout_force_error": errors}
    return {"fit": fit, "oracle": last / answer["held_norm"]}


def described(folder: Path, cases: Sequence[Case]) -> list[tuple[str, ...]]:
    """A row for each log as it is: name, verdict, findings with size, held-out error."""
    rows: list[tuple[str, ...]] = []
    for case in cases:
        file = path(folder, ANSWERS, case)
        if case.effects or not file.is_file():
            continue
        answer, log = read(file), case.name.rpartition("-")[0]
        if answer["error"] is not None:
            rows.append((log, answer["error"], "-", "-"))
            continue
        said = ", ".join(f"{f['effect']} ({f['share']:.0%})" for f in answer["findings"])
        errors = answer["fit"]["force_error"]
        change = f"{errors['before']:.2%}, {errors['after']:.2%}"
        rows.append((log, answer["verdict"], said or "nothing", change))
    return rows
