"""Doing the cases of a proof in several processes, and those only that have not been done."""

import functools
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from ...data.io import write_text
from ...identification.documents import to_json
from .planning import Case, plan
from .trials import ANSWERS, SEALED, failed, fingerprint, path, read, trial
from .workers import work

ABOUT, RESULTS = "proof.json", "results"
# A case takes seconds, a process' first one, which compiles, about a minute: what takes ten is a
# search that does not end, and no user would wait for it either.
LIMIT = 600.0


def run(
    folder: Path,
    cases: int,
    seed: int,
    size: tuple[float, float],
    jobs: int = 1,
    prepare: Callable[[], object] | None = None,
    limit: float = LIMIT,
    doing: Callable[[str], object] = lambda text: None,
    half: str = "",
) -> list[Case]:
    """Do what is left to do of a proof in a folder; returns its cases.

    **Arguments:** `cases`, `seed`, `size`, `half`: as [`plan`][jaxfric.validation.proof.plan] takes
    them; `jobs`: processes; `prepare`: called in each of them first, to configure jax; `limit`:
    seconds after which a case is given up; `doing`: is told how far it is. A case that is given up,
    or whose process dies twice, has an answer that says so.

    **Raises:** `ValueError` if the folder holds a proof of another seed or size.
    """
    planned = plan(cases, seed, size, half)
    by_definition = {"definitions": half} if half else {}
    claim(folder, {"seed": seed, "size": list(size)} | by_definition)
    do = functools.partial(trial, folder=folder)
    do_all(folder, planned, do, jobs, prepare, limit, doing)
    return planned


def do_all(
    folder: Path,
    cases: Sequence[Case],
    do: Callable[[Case], object],
    jobs: int = 1,
    prepare: Callable[[], object] | None = None,
    limit: float = LIMIT,
    doing: Callable[[str], object] = lambda text: None,
) -> None:
    """Do each case that has no answer in a folder yet; what `do` cannot answer is answered here."""
    for part in (SEALED, ANSWERS):
        (folder / part).mkdir(exist_ok=True)
    left = [case for case in cases if not path(folder, ANSWERS, case).is_file()]
    start, done = time.monotonic(), len(cases) - len(left)
    doing(f"{done}/{len(cases)} cases")
    for number, (case, reason, seconds, _) in enumerate(work(left, do, jobs, limit, prepare), 1):
        if reason is not None and not path(folder, ANSWERS, case).is_file():
            answer = failed(reason) | {"seconds": seconds, "case": case.name, "code": fingerprint()}
            write_text(path(folder, ANSWERS, case), to_json(answer))
        pace = _span((time.monotonic() - start) / number * (len(left) - number))
        doing(f"{done + number}/{len(cases)} cases, {pace} left")


def claim(folder: Path, about: dict) -> None:
    """Say in the folder what proof it holds, or raise if it holds another."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / ABOUT
    if file.is_file():
        there = read(file)
        there.pop(RESULTS, None)
        if there != about:
            half = f" and definitions {there['definitions']}" if "definitions" in there else ""
            raise ValueError(
                f"{file}: is of the proof of seed {there.get('seed')} and sizes "
                f"{there.get('size')}{half}; give those to go on with it, or another --out."
            )
        return
    if any(folder.iterdir()):
        raise ValueError(f"{folder}: is not empty and holds no proof; give another --out.")
    write_text(file, to_json(about))


def conclude(folder: Path, results: dict) -> None:
    """Write what came out into the file that says what the folder holds."""
    write_text(folder / ABOUT, to_json(read(folder / ABOUT) | {RESULTS: results}))


def _span(seconds: float) -> str:
    minutes = round(seconds / 60)
    return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
