"""Known forces planted in real recordings, scored against what the recordings show without them.

Adding a known force of the recorded motion to the recorded force makes the recording of a machine
with that physics at the same motion: real noise, real friction, and a truth. A real machine has
findings of its own, though, so each answer is compared with that to the recording as it is.
"""

import dataclasses
import functools
import itertools
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxfric import signals
from jaxfric.data.io import read, write_text
from jaxfric.data.recording import Recording
from jaxfric.explanation.motion import from_position
from jaxfric.identification.documents import to_json
from jaxfric.identification.identifying import identify
from jaxfric.validation.concealed.kinds import kind, names
from jaxfric.validation.concealed.machines import Plan
from jaxfric.validation.concealed.nominal import Nominal
from jaxfric.validation.proof.planning import Case, turns
from jaxfric.validation.proof.running import LIMIT, claim, do_all
from jaxfric.validation.proof.trials import (
    ANSWERS,
    SEALED,
    answered,
    failed,
    fingerprint,
    path,
    plain,
)


def planted() -> tuple[str, ...]:
    """What is a force of the recorded position, velocity, acceleration and time alone.

    Asymmetry every real machine has already, and another axis would have to be recorded.
    """
    return tuple(name for name in names() if kind(name).planted)


# Draws of an effect's parameters until most of its force acts where the axis moves: at rest,
# friction answers any force.
ATTEMPTS = 50


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
            dataclasses.replace(read(file, **self.reading), source=self.name, sha256="")
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
    effects, numbers = turns(planted(), np.random.default_rng((seed, 4))), itertools.count(1)
    for log, size, _ in itertools.product(logs, sizes, range(each)):
        number = next(numbers)
        machine = int(np.random.default_rng((seed, 5, number)).integers(2**31))
        # A baseline with a bump of its own takes up another one.
        bumped = not log.baseline.endswith("coulomb-viscous")
        effect = next(name for name in effects if not (bumped and kind(name).bump is False))
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
        truth, norm = {}, _norm(holdout)
        for name in case.effects:
            known = level(recording, log.baseline)
            truth[name], forces = plant(recording, holdout, known, name, case)
            recording = _with(recording, forces[0])
            holdout = None if holdout is None else _with(holdout, forces[1])
        sealed = {"case": case.name, "kind": case.kind, "seed": case.seed, "truth": plain(truth)}
        write_text(path(folder, SEALED, case), to_json(sealed))
        answer = answered(recording, log.baseline, holdout)
        answer |= {"oracle": None, "held_norm": _norm(holdout), "own_norm": norm}
    except Exception as error:  # the others go on
        answer = failed(f"{type(error).__name__}: {error}")
    write_text(path(folder, ANSWERS, case), to_json(answer | {"case": case.name, "code": code}))


def _norm(recording: Recording | None) -> float | None:
    return None if recording is None else float(np.linalg.norm(np.asarray(recording.force)))


def _with(recording: Recording, force: np.ndarray) -> Recording:
    return dataclasses.replace(recording, force=np.asarray(recording.force) + force)


def level(recording: Recording, baseline: str) -> tuple[float, float]:
    """The Coulomb level, N, and the inertia, kg (zero where it is not seen), of a recording."""
    found = identify(baseline, recording).parameters
    levels = [float(v.value) for name, v in found.items() if name.startswith("coulomb")]
    inertia = float(found["inertia"].value) if "inertia" in found else 0.0
    return float(np.mean(np.abs(levels))), inertia


def plant(
    recording: Recording,
    holdout: Recording | None,
    known: tuple[float, float],
    name: str,
    case: Case,
) -> tuple[dict[str, Any], list[np.ndarray]]:
    """The truth of an effect drawn for a recording, and its force along both, N, each `(N,)`.

    **Arguments:** `known`: Coulomb level and inertia, as [`level`][] finds them.

    **Raises:** `ValueError` where the recording leaves no room for the effect.
    """
    motion = nominal(recording, *known)
    rng = np.random.default_rng((case.seed, zlib.crc32(name.encode())))
    own = kind(name)
    for _ in range(ATTEMPTS):
        truth = own.draw(rng, motion, case.size[0])
        force = own.force(truth, motion)
        power = float(np.sum(force**2))
        if power > 0 and np.sum(force[motion.way != 0] ** 2) > 0.5 * power:
            break
    else:
        raise ValueError(f"this recording leaves no room for {name}: give another seed or log.")
    # Rounded, since a tenth is to be counted among those of a tenth or more.
    size, forces = round(own.measure(truth, motion), 9), [force]
    if holdout is not None:
        other = nominal(holdout, *known)
        forces.append(own.over(truth, other, 1).load if own.unrepeated else own.force(truth, other))
    return {**truth, "size": size, "where": own.where(truth)}, forces


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
