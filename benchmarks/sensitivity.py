"""What halving and doubling the constants by which findings are believed does to the answers.

    python benchmarks/sensitivity.py --cases 24 --seed 1 --jobs 2 --out sensitivity

Machines are drawn as by `jaxfric prove`, and explained with each constant as it is, halved and
doubled. A line of a `rows-*.jsonl` in the folder is one answer. It goes on where it was stopped.
"""

import argparse
import collections
import importlib
import json
import multiprocessing
import os
import sys
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax

from jaxfric import programs
from jaxfric.explanation import explain
from jaxfric.validation.concealed import draw, record
from jaxfric.validation.proof.planning import plan
from jaxfric.validation.proof.writing import table

# Where each constant is defined.
CONSTANTS = {
    "LEVEL": "significance",
    "NEW": "significance",
    "LEAST_SHARE": "acceptance",
    "LATER_SHARE": "acceptance",
    "OF_BASE": "acceptance",
    "LEAST_OF_BASE": "acceptance",
    "LINEARITY": "acceptance",
    "EASY_OF_BASE": "acceptance",
    "REVERSAL_OF_BASE": "acceptance",
    "RIVAL": "contest",
    "ROUGH": "verdict",
}
FACTORS = (0.5, 2.0)


class Setting(NamedTuple):
    """A constant and its factor; nothing is changed by the factor one."""

    name: str
    factor: float


USUAL = Setting("", 1.0)
SETTINGS = (USUAL, *(Setting(name, factor) for name in CONSTANTS for factor in FACTORS))


def main() -> None:
    """Ask what has not been asked yet, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=24)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("sensitivity"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    cases = plan(arguments.cases, arguments.seed, (0.02, 0.3))
    shares = [(cases[i :: arguments.jobs], arguments.out, i) for i in range(arguments.jobs)]
    if arguments.jobs > 1:
        with multiprocessing.get_context("spawn").Pool(arguments.jobs) as pool:
            pool.starmap(answered, shares)
    else:
        answered(*shares[0])
    print(told(rows(arguments.out)))


def answered(cases, out: Path, part: int) -> None:
    """Answers of some cases by all settings, appended to a file of their own."""
    jax.config.update("jax_enable_x64", True)
    programs.use_cache()
    done = {(row["case"], row["name"], row["factor"]) for row in rows(out)}
    for case in cases:
        left = [s for s in SETTINGS if (case.name, *s) not in done]
        if not left:
            continue
        machine = draw(case.seed, case.effects, case.size)
        run = record(machine)
        for setting in left:
            row = {"case": case.name, **setting._asdict(), "effects": list(case.effects)}
            with (out / f"rows-{part}.jsonl").open("a") as file:
                file.write(json.dumps(row | answer(run, machine.baseline, setting)) + "\n")


def answer(run, baseline: str, setting: Setting) -> dict:
    """The verdict, the names, and what they are declared confusable with."""
    before = {} if setting == USUAL else changed(setting)
    try:
        found = explain(run.recording, baseline, run.holdout)
    finally:
        restore(setting.name, before)
    alike = {name for finding in found.findings for name in finding.confusable_with}
    names = [finding.effect for finding in found.findings]
    return {"verdict": found.verdict, "names": names, "alike": sorted(alike)}


def changed(setting: Setting) -> dict:
    """Change a constant in every module that has it; what was there before, by module."""
    own = importlib.import_module(f"jaxfric.explanation.{CONSTANTS[setting.name]}")
    value, before = getattr(own, setting.name), {}
    for name, module in list(sys.modules.items()):
        if name.startswith("jaxfric.explanation") and vars(module).get(setting.name) == value:
            before[module] = value
            setattr(module, setting.name, value * setting.factor)
    return before


def restore(name: str, before: dict) -> None:
    """What [`changed`][] has changed, as it was."""
    for module, value in before.items():
        setattr(module, name, value)


def rows(out: Path) -> list[dict]:
    """The answers in a folder."""
    return [json.loads(line) for file in sorted(out.glob("rows-*.jsonl")) for line in file.open()]


def told(answers: list[dict]) -> str:
    """The table: healthy machines that are quiet, effects named, declared, and false names."""
    by = collections.defaultdict(list)
    for row in answers:
        by[row["name"], row["factor"]].append(row)
    usual = {row["case"]: row for row in by[USUAL]}
    lines = [["as it is", "", *counts(by[USUAL]), ""]]
    for name in CONSTANTS:
        for factor in FACTORS:
            own = by[name, factor]
            other = sum(same(row) != same(usual[row["case"]]) for row in own)
            lines.append([name, f"× {factor:g}", *counts(own), str(other)])
    head = ["constant", "", "healthy quiet", "named", "or declared", "false names", "other answers"]
    return table(head, lines)


def same(row: dict):
    """What makes two answers the same."""
    return row["verdict"], sorted(row["names"])


def counts(own: list[dict]) -> list[str]:
    """The figures of one setting."""
    healthy = [row for row in own if not row["effects"]]
    quiet = sum(row["verdict"] == "consistent" for row in healthy)
    named = declared = total = false = 0
    for row in own:
        wanted = set(row["effects"])
        total += len(wanted)
        named += len(wanted & set(row["names"]))
        declared += len(wanted & {*row["names"], *row["alike"]})
        false += sum(name not in wanted for name in row["names"])
    return [
        f"{quiet} of {len(healthy)}", f"{named} of {total}", f"{declared} of {total}", f"{false}"
    ]  # fmt: skip


if __name__ == "__main__":
    main()
