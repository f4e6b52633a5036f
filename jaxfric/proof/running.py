"""Doing the cases of a proof in several processes, and those only that have not been done."""

import json
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from ..documents import to_json
from ..io import write_text
from .planning import Case, plan
from .trials import ANSWERS, SEALED, failed, path, trial

ABOUT = "proof.json"


def run(
    folder: Path,
    cases: int,
    seed: int,
    size: tuple[float, float],
    jobs: int = 1,
    prepare: Callable[[], object] | None = None,
) -> list[Case]:
    """Do what is left to do of a proof in a folder; returns its cases.

    **Arguments:** `cases`, `seed`, `size`: as [`plan`][jaxfric.proof.plan] takes them;
    `jobs`: processes; `prepare`: called in each of them first, to configure jax.

    **Raises:** `ValueError` if the folder holds a proof of another seed or size.
    """
    planned = plan(cases, seed, size)
    _claim(folder, {"seed": seed, "size": list(size)})
    for part in (SEALED, ANSWERS):
        (folder / part).mkdir(exist_ok=True)
    left = _undone(planned, folder)
    while left:
        broken = _pool(left, folder, jobs, prepare, len(planned))
        left = _undone(left, folder)
        if broken and jobs == 1 and left:  # one at a time, so it was the first
            answer = failed("the process died") | {"case": left[0].name, "code": None}
            write_text(path(folder, ANSWERS, left[0]), to_json(answer))
            left = left[1:]
        jobs = 1 if broken else jobs
    return planned


def _claim(folder: Path, about: dict) -> None:
    """Say in the folder what proof it holds, or raise if it holds another."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / ABOUT
    if file.is_file():
        there = json.loads(file.read_text(encoding="utf-8"))
        if there != about:
            raise ValueError(
                f"{folder}: holds the proof of seed {there['seed']} and sizes {there['size']}; "
                "give those to go on with it, or another --out."
            )
    elif any(folder.iterdir()):
        raise ValueError(f"{folder}: is not empty and holds no proof; give another --out.")
    write_text(file, to_json(about))


def _undone(cases: Sequence[Case], folder: Path) -> list[Case]:
    return [case for case in cases if not path(folder, ANSWERS, case).is_file()]


def _pool(cases: Sequence[Case], folder: Path, jobs: int, prepare, total: int) -> bool:
    """Do cases; returns whether a process died. They are spawned: jax does not survive a fork."""
    # Read when a process imports numpy: many small matrices, where threads wait for each other.
    before = os.environ.get("OPENBLAS_NUM_THREADS")
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=prepare)
    try:
        waiting = [pool.submit(trial, case, folder) for case in cases]
        _follow(waiting, total)
    except BrokenProcessPool:
        return True
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        if before is None:
            del os.environ["OPENBLAS_NUM_THREADS"]
        else:
            os.environ["OPENBLAS_NUM_THREADS"] = before
    return False


def _follow(waiting, total: int) -> None:
    """Wait for all, and say how far it is on a terminal."""
    start, shown = time.monotonic(), sys.stderr.isatty()
    for number, future in enumerate(as_completed(waiting), 1):
        future.result()
        if shown:
            left = (time.monotonic() - start) / number * (len(waiting) - number)
            text = f"{total - len(waiting) + number}/{total} cases, {_span(left)} left"
            print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)
    if shown:
        print("\r\x1b[K", end="", file=sys.stderr, flush=True)


def _span(seconds: float) -> str:
    minutes = round(seconds / 60)
    return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
