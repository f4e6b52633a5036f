"""Run what a user runs on every case, in this process, and judge what comes of it."""

import contextlib
import io
import json
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxfric import signals
from jaxfric.data.recording import Recording

from . import judging
from .cases import Case, Made, make
from .judging import Ran, Verdict
from .logs import TRUE_VELOCITY, Log, spelled

Command = Callable[[Sequence[str]], int]


def hunt(case: Case, command: Command, folder: Path, explain: bool = True) -> dict[str, Any]:
    """Make the files of a case in a folder, run the command line on them, and judge.

    **Arguments:** `command`: the entry point, `jaxfric.cli.main`; `folder`: exists and is empty;
    `explain`: ask `explain` too, where its turn is.

    **Returns:** plain data: the case, its mistake and machine, `outcome` (one of
    [`OUTCOMES`][jaxfric.validation.hunt.judging.OUTCOMES]) with the figures that are off, and
    `own`: the outcome of the same log without the mistake, where that of the case is silent.
    """
    start = time.monotonic()
    made = make(case)
    file, held = (
        _write(folder / n, x) for n, x in (("log.csv", made.log), ("held.csv", made.holdout))
    )
    verdicts = {}
    if made.mistake is None or not made.mistake.held_out:
        ran = run(command, ["identify", str(file), "--model", made.log.model], folder)
        verdicts["identify"] = _with_own(ran, made, command, folder)
    if made.explained and explain:
        words = ["explain", str(file), "--baseline", made.log.model, "--holdout", str(held)]
        ran = run(command, words, folder)
        verdicts["explain"] = judging.explained(ran, made.log, made.mistake)
    verdict = judging.worst(list(verdicts.values()))
    answer = _described(case, made, verdict, verdicts)
    if made.mistake is None and judging.OF_THE_DERIVATIVE & {
        s for v in verdicts.values() for s in v.signs
    }:
        answer["velocity_error"] = _velocity_error(made.log)
    if verdict.outcome == "wrong in silence" and made.mistake is not None:
        answer["own"] = _own(made, command, folder)[0].outcome
    return answer | {"seconds": time.monotonic() - start}


def _described(case: Case, made: Made, verdict: Verdict, verdicts) -> dict[str, Any]:
    mistake = made.mistake
    return {
        "seed": case.seed,
        "number": case.number,
        "unseen": case.unseen,
        "mistake": mistake.name if mistake else "none",
        "family": mistake.family if mistake else "healthy",
        "machine": made.log.machine,
        "model": made.log.model,
        "velocity": "velocity" in made.log.columns,
        "lacks": made.log.lacks,
        "outcome": verdict.outcome,
        "commands": {name: each._asdict() for name, each in verdicts.items()},
    }


def _velocity_error(log: Log) -> float:
    """How far the velocity of a position is from the true one, of its root mean square."""
    recording = Recording(*(log.columns[role] for role in ("time", "force", "position")))
    true = log.columns[TRUE_VELOCITY]
    wrong = np.asarray(signals.prepare(recording).velocity) - true
    return float(np.sqrt(np.nanmean(wrong**2) / np.mean(true**2)))


def _with_own(ran: Ran, made: Made, command: Command, folder: Path) -> Verdict:
    """The verdict; the healthy log is asked only where its force error decides."""
    verdict = judging.identified(ran, made.log, made.mistake, 0.0)
    doubtful = any(text.startswith("force error") for text in verdict.off)
    if not doubtful or made.mistake is None:
        return verdict
    return judging.identified(ran, made.log, made.mistake, _own(made, command, folder)[1])


def _own(made: Made, command: Command, folder: Path) -> tuple[Verdict, float]:
    """The verdict on the log without the mistake, and its force error."""
    file = _write(folder / "healthy.csv", made.healthy)
    ran = run(command, ["identify", str(file), "--model", made.healthy.model], folder)
    verdict = judging.identified(ran, made.healthy, None, 0.0)
    error = ran.document["force_error"] if ran.document else None
    return verdict, 0.0 if error is None else error


def _write(path: Path, log: Log) -> Path:
    path.write_text(spelled(log), encoding="utf-8")
    return path


def run(command: Command, words: Sequence[str], folder: Path) -> Ran:
    """One command in this process, with its JSON written to the folder."""
    file = folder / f"{Path(words[1]).stem}-{words[0]}.json"
    file.unlink(missing_ok=True)
    printed, complained = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(complained):
        try:
            status = command([*words, "--json", str(file)])
        except SystemExit as error:
            status = error.code if isinstance(error.code, int) else 1
        except Exception:  # noqa: BLE001 - a traceback is a finding of the hunt
            traceback.print_exc()
            status = 1
    document = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else None
    return Ran(status, printed.getvalue(), complained.getvalue(), document)
