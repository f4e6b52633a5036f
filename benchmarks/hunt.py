"""Mistakes that people, loggers and drives make with logs, and what the command line answers.

    python benchmarks/hunt.py --cases 600 --seed 7 --jobs 2 --out hunt
    python benchmarks/hunt.py --cases 600 --seed 7 --jobs 2 --out hunt-unseen --unseen

Interrupted, it goes on where it was; `--restart` forgets the answers of another version of the
code. One case again, its files kept:

    python benchmarks/hunt.py --seed 7 --case 123 --out again
"""

import argparse
import functools
import json
import os
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from mistakes import Case, hunt, mistake_of, report, summary

from jaxfric.cli import _configure, main as command
from jaxfric.data.io import write_text
from jaxfric.validation.proof.workers import work

# A case takes a second or two; one that takes this long hangs.
LIMIT = 300.0


def main() -> None:
    """Do what is left, and write the report to the folder."""
    arguments = parse()
    folder = Path(arguments.out)
    folder.mkdir(parents=True, exist_ok=True)
    if arguments.case is not None:
        _configure()
        found = hunt(Case(arguments.seed, arguments.case, arguments.unseen), command, folder)
        print(json.dumps(found, indent=2, ensure_ascii=False))
        return
    chosen = [Case(arguments.seed, n, arguments.unseen) for n in range(arguments.cases)]
    if arguments.identify_only:
        chosen = [c for c in chosen if (m := mistake_of(c)) is None or not m.held_out]
    if arguments.restart:
        for case in chosen:
            path(folder, case).unlink(missing_ok=True)
    left = [case for case in chosen if not path(folder, case).is_file()]
    do = functools.partial(answer, folder=folder, explain=not arguments.identify_only)
    for number, done in enumerate(work(left, do, arguments.jobs, LIMIT, _configure), 1):
        if done.reason is not None:
            write_text(path(folder, done.task), json.dumps(failed(done.task, done.reason)))
        if sys.stderr.isatty():
            print(f"\r{number}/{len(left)} cases", end="", file=sys.stderr, flush=True)
    answers = [json.loads(path(folder, case).read_text(encoding="utf-8")) for case in chosen]
    words = " ".join(["python benchmarks/hunt.py", *sys.argv[1:]])
    write_text(folder / "report.md", report(answers, words))
    print(f"{summary(answers)}\n{folder / 'report.md'}")


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=600)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", default="hunt")
    parser.add_argument("--unseen", action="store_true", help="machines that are only scored")
    parser.add_argument("--restart", action="store_true", help="forget the answers in the folder")
    parser.add_argument("--identify-only", action="store_true", help="ten times quicker")
    parser.add_argument("--case", type=int, help="one case alone; its files stay in the folder")
    return parser.parse_args()


def path(folder: Path, case: Case) -> Path:
    return folder / f"{case.seed}-{'unseen' if case.unseen else 'seen'}-{case.number:05}.json"


def answer(case: Case, folder: Path, explain: bool) -> None:
    with tempfile.TemporaryDirectory() as place:
        found = hunt(case, command, Path(place), explain)
    write_text(path(folder, case), json.dumps(found, ensure_ascii=False))


def failed(case: Case, reason: str) -> dict:
    about = {"machine": reason, "model": "", "velocity": False, "mistake": "unknown"}
    return {**case._asdict(), **about, "family": "no answer", "outcome": "crashed", "commands": {}}


if __name__ == "__main__":
    main()
