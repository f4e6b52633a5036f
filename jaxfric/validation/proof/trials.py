"""One case: the truth sealed, the recording explained blind, the oracle fitted afterwards."""

import dataclasses
import functools
import hashlib
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from ...data.io import write_text
from ...data.recording import Recording
from ...explanation import Explanation, explain
from ...explanation.evidence import gather
from ...explanation.forward import motion_error
from ...explanation.motion import motion_of
from ...explanation.problem import across_reversals, problem_of, with_holdout
from ...explanation.verification import residual
from ...identification.documents import to_json
from ...models import named
from ..concealed import Machine, Run, draw, record
from ..concealed.kinds import unrepeated
from .planning import Case

SEALED, ANSWERS = "sealed", "answers"
# Of an explanation, what is kept: not the model, nor what could not have been seen.
KEPT = ("verdict", "where", "findings", "fit")
REMEDY = "remove it, and what it stood for is done again."


def path(folder: Path, part: str, case: Case) -> Path:
    """The file of a case in a part of the folder."""
    return folder / part / f"{case.name}.json"


def trial(case: Case, folder: Path) -> None:
    """Do one case, and write its answer; whatever goes wrong is written as its answer too."""
    code = fingerprint()
    try:
        machine = draw(case.seed, case.effects, case.size, dict(case.definitions))
        write_text(path(folder, SEALED, case), to_json(sealed(case, machine)))
        run = record(machine)
        recording = _nameless(run.recording, case)
        answer = answered(recording, machine.baseline, _nameless(run.holdout, case))
        answer["oracle"] = oracle(run, machine) if machine.effects else None
        several = machine.effects if len(machine.effects) > 1 else ()
        answer["oracle_without"] = {name: oracle(run, machine, name) for name in several}
    except Exception as error:  # a proof of hundreds of cases outlives any one of them
        answer = failed(f"{type(error).__name__}: {error}")
    answer |= {"case": case.name, "code": code}
    write_text(path(folder, ANSWERS, case), to_json(answer))


def failed(text: str) -> dict[str, Any]:
    """The answer of a case that went wrong."""
    return {"error": text.strip(), "seconds": None}


def sealed(case: Case, machine: Machine) -> dict[str, Any]:
    """What is true of a case."""
    truth = {name: plain(values) for name, values in machine.truth.items()}
    return {
        "case": case.name,
        "kind": case.kind,
        "seed": case.seed,
        "effects": list(case.effects),
        "size": list(case.size),
        "definitions": dict(case.definitions),
        "coulomb": machine.coulomb,
        "truth": truth,
    }


def answered(recording: Recording, baseline: str, holdout: Recording | None) -> dict[str, Any]:
    """What `explain` says of two recordings, and how long it takes; it is told nothing else.

    Afterwards its models are run forward.
    """
    start = time.perf_counter()
    found = explain(recording, baseline, holdout)
    seconds = time.perf_counter() - start
    document = found.to_dict()
    kept = {key: document[key] for key in KEPT}
    facts = {"baseline": baseline, "recording": document["recording"], "seconds": seconds}
    return {"error": None, **kept, **facts, "run": _run(found, recording, holdout)}


def _run(found: Explanation, recording: Recording, holdout: Recording | None) -> dict[str, Any]:
    """Relative velocity errors of both models run forward, driven by the held-out force.

    Without anything found they are one model, and not run; `None` for one that cannot run forward.
    """
    if not found.findings:
        return {"before": None, "after": None}
    judge = recording if holdout is None else holdout
    errors = {}
    for when, model in (("before", found.baseline), ("after", found.model)):
        try:
            error = motion_error(model, judge)
        except (ValueError, RuntimeError):  # what explain said stands without it
            error = None
        errors[when] = None if error is None or not np.isfinite(error) else error
    return errors


def oracle(run: Run, machine: Machine, unknown: str = "") -> float | None:
    """The held-out force error that would be left if the concealed force were known exactly.

    With the name of an effect that is `unknown`, if only the others' were. The true concealed
    force is subtracted from the measured force of both recordings; the baseline is fitted to what
    is left of the first, and predicts what is left of the second with nothing refitted. The norm
    of that residual over the norm of the held-out force as measured is the error, over the rows,
    and by the kernel and the alignment, that `explain` chooses for the recordings without the
    concealed force. `None` where no one could know the held-out force.
    """
    if unrepeated(machine.effects):
        return None
    structure = named(machine.baseline)
    first, second = (
        {name: force for name, force in hidden.items() if name != unknown}
        for hidden in (run.hidden, run.hidden_holdout)
    )
    run_less, holdout_less = _without(run.recording, first), _without(run.holdout, second)
    problem = problem_of(run_less, structure)
    known = with_holdout(across_reversals(run_less, problem), holdout_less)
    for candidates in known.candidate_sets:
        candidates.close()  # nobody asks for the candidates' columns
    rows = known.evidence.width, known.delay, known.reversals
    measured = gather(motion_of(run.holdout), *rows).target
    return _norm(residual(known.base, known.held)) / _norm(measured)


def _norm(values: np.ndarray) -> float:
    return float(np.sqrt(values @ values))


def _without(recording: Recording, hidden: dict[str, np.ndarray]) -> Recording:
    force = np.asarray(recording.force)
    rest = force - sum(hidden.values(), np.zeros_like(force))
    return dataclasses.replace(recording, force=rest)


def _nameless(recording: Recording, case: Case) -> Recording:
    """Its name would tell the seed."""
    return dataclasses.replace(recording, source=f"case {case.name}", sha256="")


def plain(value: Any) -> Any:
    """Numbers of numpy as those of Python."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


@functools.cache
def fingerprint() -> str:
    """Of the package's source, as a process finds it at its first case.

    Answers of different ones are not of one proof.
    """
    digest = hashlib.sha256()
    package = Path(__file__).parents[1]
    for file in sorted(package.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def read(file: Path) -> dict[str, Any]:
    """A file that a proof has written; raises `ValueError` where it is another, or damaged."""
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{file}: is damaged, {error}: {REMEDY}") from error
    if not isinstance(found, dict):
        raise ValueError(f"{file}: holds a {type(found).__name__}, no part of a proof: {REMEDY}")
    return found
