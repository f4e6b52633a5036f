"""Known forces planted in real recordings, scored against what the recordings show without them.

Adding a known force of the recorded motion to the recorded force makes the recording of a machine
with that physics at the same motion: real noise, real friction, and a truth. A real machine has
findings of its own, though, so each answer is compared with that to the recording as it is.
"""

import dataclasses
import functools
import itertools
import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .. import signals
from ..concealed.kinds import KINDS, NAMES
from ..concealed.machines import Plan
from ..concealed.nominal import Nominal, rms
from ..concealed.schedule import columns as timed
from ..documents import to_json
from ..explanation.question import from_position
from ..identification import identify
from ..io import read, write_text
from ..recording import Recording
from .planning import Case, turns
from .running import LIMIT, claim, do_all
from .scoring import Score, score
from .trials import (
    ANSWERS,
    SEALED,
    UNREPEATED,
    answered,
    failed,
    fingerprint,
    path,
    plain,
    read as document,
)

# What is a force of the recorded position, velocity, acceleration and time alone. Asymmetry every
# real machine has already, and another axis would have to be recorded.
PLANTED = tuple(
    name
    for name in NAMES
    if name in {
        "stribeck", "viscous_nonlinearity", "gravity_unbalance", "cogging", "spring",
        "hardening_spring", "end_stop", "position_dependent_friction", "sticky_spot",
        "position_dependent_inertia", "thermal_drift", "friction_step", "load_drift",
        "periodic_disturbance", "disturbance_pulses",
    }
)  # fmt: skip
# Parameters that say where a finding is: two with others are two findings.
PLACES = ("pitch", "unbalance_period", "friction_period", "inertia_period", "frequency",
          "spot_position", "stop_position", "lower_stop_position", "step_time")  # fmt: skip
# Places that differ by less, or by less than twice their standard error, are the same place.
SAME = 0.02


class Log(NamedTuple):
    """A recording to plant in: its name, the files, how they are read, and the baseline."""

    name: str
    file: str
    holdout: str | None
    baseline: str
    reading: Mapping[str, Mapping[str, Any]]

    def both(self) -> tuple[Recording, Recording | None]:
        """The recording and the held-out one; nothing of their names."""
        logs = [
            dataclasses.replace(read(file, **self.reading), source=self.name)
            for file in (self.file, self.holdout)
            if file is not None
        ]
        return logs[0], logs[1] if len(logs) > 1 else None


def plan(logs: Sequence[Log], sizes: Sequence[float], each: int, seed: int) -> list[Case]:
    """Each log as it is, then `each` cases of every log and size; the effects take turns.

    **Raises:** `ValueError` for sizes or a number of cases that make no sense.
    """
    if each < 1 or not sizes or min(sizes) <= 0:
        raise ValueError(f"{each} cases of sizes {list(sizes)}; give at least one, and over zero.")
    found = [Case(f"{log.name}-own", "healthy", 0, (), (0.0, 0.0)) for log in logs]
    names, numbers = turns(PLANTED, np.random.default_rng((seed, 4))), itertools.count(1)
    for log, size, _ in itertools.product(logs, sizes, range(each)):
        number = next(numbers)
        machine = int(np.random.default_rng((seed, 5, number)).integers(2**31))
        # A baseline with a bump of its own takes up another one.
        bumped = not log.baseline.endswith("coulomb-viscous")
        effect = next(name for name in names if not (bumped and name == "stribeck"))
        case = Case(f"{log.name}-{number:03d}", "single", machine, (effect,), (size, size))
        found.append(case)
    return found


def run(
    folder: Path,
    logs: Sequence[Log],
    sizes: Sequence[float],
    each: int,
    seed: int,
    jobs: int = 1,
    prepare: Callable[[], object] | None = None,
    limit: float = LIMIT,
) -> list[Case]:
    """Do what is left to do in a folder; returns the cases, as [`plan`][] makes them.

    **Raises:** `ValueError` if the folder holds something else, or a log cannot be read.
    """
    planned = plan(logs, sizes, each, seed)
    about = {"seed": seed, "size": list(sizes), "each": each, "logs": [log.name for log in logs]}
    for log in logs:
        log.both()
    claim(folder, about)
    do = functools.partial(trial, folder=folder, logs={log.name: log for log in logs})
    do_all(folder, planned, do, jobs, prepare, limit)
    return planned


def trial(case: Case, folder: Path, logs: Mapping[str, Log]) -> None:
    """Plant, seal, ask, and write the answer; whatever goes wrong is written as its answer too."""
    code = fingerprint()
    try:
        log = logs[case.name.rpartition("-")[0]]
        recording, holdout = log.both()
        truth, planted, norm = {}, 0.0, _norm(holdout)
        for name in case.effects:
            truth[name], forces = plant(recording, holdout, log.baseline, name, case)
            planted = rms(forces[0])
            recording = _with(recording, forces[0])
            holdout = None if holdout is None else _with(holdout, forces[1])
        sealed = {"case": case.name, "kind": case.kind, "seed": case.seed, "truth": plain(truth)}
        write_text(path(folder, SEALED, case), to_json(sealed | {"planted": planted}))
        answer = answered(recording, log.baseline, holdout)
        answer |= {"oracle": None, "held_norm": _norm(holdout), "own_norm": norm}
    except Exception as error:  # the others go on
        answer = failed(f"{type(error).__name__}: {error}")
    write_text(path(folder, ANSWERS, case), to_json(answer | {"case": case.name, "code": code}))


def _norm(recording: Recording | None) -> float | None:
    return None if recording is None else float(np.linalg.norm(np.asarray(recording.force)))


def _with(recording: Recording, force: np.ndarray) -> Recording:
    return dataclasses.replace(recording, force=np.asarray(recording.force) + force)


def plant(
    recording: Recording, holdout: Recording | None, baseline: str, name: str, case: Case
) -> tuple[dict[str, Any], list[np.ndarray]]:
    """The truth of an effect drawn for a recording, and its force along both, N, each `(N,)`."""
    fit = identify(baseline, recording)
    levels = [float(v.value) for k, v in fit.parameters.items() if k.startswith("coulomb")]
    inertia = fit.parameters.get("inertia")
    coulomb, mass = float(np.mean(np.abs(levels))), 0.0 if inertia is None else inertia.value
    motion = nominal(recording, coulomb, float(mass))
    rng = np.random.default_rng((case.seed, zlib.crc32(name.encode())))
    kind = KINDS[name]
    truth = kind.draw(rng, motion, case.size[0])
    # Rounded, since a tenth is to be counted among those of a tenth or more.
    size = round(kind.measure(truth, motion), 9)
    forces = [kind.force(truth, motion)]
    if not size > 0:
        raise ValueError(f"this recording has no room for {name}.")
    if holdout is not None:
        other = nominal(holdout, coulomb, float(mass))
        forces.append(
            timed({name: truth}, other, 1).load if name in UNREPEATED else kind.force(truth, other)
        )
    return {**truth, "size": size, "where": kind.where(truth)}, forces


def nominal(recording: Recording, coulomb: float, mass: float) -> Nominal:
    """A recorded motion in the form that the concealed effects' forces are functions of."""
    prepared = signals.prepare(from_position(recording))
    limits = signals.scales(prepared)
    time, x, v = (np.asarray(a) for a in (prepared.time, prepared.position, prepared.velocity))
    time, top = time - time[0], float(limits.fastest)
    way = np.sign(v) * (np.abs(v) > float(limits.slowest))
    moving = way[way != 0]
    count = max(int(np.count_nonzero(np.diff(moving))), 1)
    period, interval = 2 * float(time[-1]) / count, float(limits.interval)
    shape = Plan(("", ""), 1 / interval, time.size, (period, period), x.min(), np.ptp(x))
    # No loop answers a force that is added afterwards: the stiffest one does not either.
    physics = {"mass": mass, "kp": 1e9 * coulomb / float(np.ptp(x))}
    a = np.gradient(v, time)
    return Nominal(time, x, v, a, np.asarray(recording.force), way, top, coulomb, physics, shape)


def scores(folder: Path, cases: Sequence[Case]) -> list[Score]:
    """Open what was sealed, and score the planted cases against those to the logs as they are."""
    own: dict[str, dict[str, Any]] = {}
    found: list[Score] = []
    for case in cases:
        if not path(folder, ANSWERS, case).is_file():
            continue
        answer = document(path(folder, ANSWERS, case))
        log = case.name.rpartition("-")[0]
        if not case.effects:
            own[log] = answer
            continue
        truth = path(folder, SEALED, case)
        sealed = document(truth) if truth.is_file() else None
        if answer["error"] is None and own.get(log, {"error": "not there"})["error"] is not None:
            answer = answer | failed(f"{log} as it is has no answer")
        elif answer["error"] is None and sealed is not None:
            answer = difference(answer, own[log], case.effects, sealed["planted"])
            if UNREPEATED & set(case.effects):
                answer["oracle"] = None
        found.append(score(case, sealed, answer))
    return found


def difference(
    answer: Mapping[str, Any], own: Mapping[str, Any], effects: Sequence[str], planted: float
) -> dict[str, Any]:
    """An answer without what the recording shows as it is.

    Findings: those of the same effect at the same place are its own; so are those that are declared
    confusable with one of its own that is not named again, unless they are what was planted. Where:
    a place counts if it was not there, or its structure has grown by half of the `planted` force's
    power, N. Held-out error: that before is freed of what its own findings remove, in squares; the
    oracle, who knows the planted force, is left with what the recording's own model leaves.
    """
    rest = [f for f in answer["findings"] if not any(same(f, known) for known in own["findings"])]
    gone = {known["effect"] for known in own["findings"]}
    gone -= {finding["effect"] for finding in answer["findings"]}
    rest = [f for f in rest if f["effect"] in effects or not gone & set(f["confusable_with"])]
    before: dict[str, float] = {}
    for place in own["where"]:
        name = place["coordinate"]
        before[name] = max(before.get(name, 0.0), place["size"])
    where = [
        place
        for place in answer["where"]
        if place["size"] ** 2 - before.get(place["coordinate"], 0.0) ** 2 > 0.5 * planted**2
        or place["coordinate"] not in before
    ]
    return {**answer, "findings": rest, "where": where, **_errors(answer, own)}


def same(finding: Mapping[str, Any], known: Mapping[str, Any]) -> bool:
    """Whether two findings are of one effect, at one place where the effect has one."""
    if finding["effect"] != known["effect"]:
        return False
    for name in PLACES:
        if name in finding["parameters"] and name in known["parameters"]:
            here, there = (f["parameters"][name] for f in (finding, known))
            spread = math.hypot(*(e["standard_error"] or 0.0 for e in (here, there)))
            apart = abs(here["value"] - there["value"])
            return apart <= max(SAME * abs(there["value"]), 2 * spread)
    return True


def _errors(answer, own) -> dict[str, Any]:
    held, alone = (a["fit"]["holdout_force_error"] for a in (answer, own))
    if held is None or alone is None:
        return {}
    before, after = (held[when] * answer["held_norm"] for when in ("before", "after"))
    first, last = (alone[when] * answer["own_norm"] for when in ("before", "after"))
    known = math.sqrt(max(before**2 - max(first**2 - last**2, 0.0), last**2))
    errors = {"before": known / answer["held_norm"], "after": held["after"]}
    fit = answer["fit"] | {"holdout_force_error": errors}
    return {"fit": fit, "oracle": last / answer["held_norm"]}


def described(folder: Path, cases: Sequence[Case]) -> list[tuple[str, ...]]:
    """A row for each log as it is: name, verdict, findings with size, held-out error."""
    rows: list[tuple[str, ...]] = []
    for case in cases:
        file = path(folder, ANSWERS, case)
        if case.effects or not file.is_file():
            continue
        answer, log = document(file), case.name.rpartition("-")[0]
        if answer["error"] is not None:
            rows.append((log, answer["error"], "-", "-"))
            continue
        said = ", ".join(f"{f['effect']} ({f['share']:.0%})" for f in answer["findings"])
        errors = answer["fit"]["force_error"]
        change = f"{errors['before']:.2%}, {errors['after']:.2%}"
        rows.append((log, answer["verdict"], said or "nothing", change))
    return rows
