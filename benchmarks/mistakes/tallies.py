"""The table of a hunt, in Markdown."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from .judging import OF_THE_DERIVATIVE, OUTCOMES, UNRESOLVED, UNSURE

Answer = Mapping[str, Any]

LEGEND = """\
A figure is wrong if a parameter, as a force, is off by more than a quarter and by more than a
twentieth of the whole force and outside of its 95 % interval, or if a quarter of the force more is
left than without the mistake. *Refused*: exit status 2 with a message, or a result that is not
`successful`. *Warned*: a warning stands beside the figures. *Rescaled*: every signal is in another
unit and nothing says so; the units assumed are printed. *Wrong in silence*: neither."""


def report(answers: Sequence[Answer], command: str) -> str:
    """Outcomes by family and by kind of mistake, and how to make each silent case again."""
    parts = [
        f"# Mistakes in logs: {len(answers)} cases",
        f"`{command}`",
        summary(answers),
        "## By family",
        _table("family", answers),
        "## By kind of mistake",
        _table("mistake", answers),
        "## Wrong in silence",
        "\n".join(_silent(answers)) or "None.",
        "## Healthy logs that were not taken as such",
        "\n".join(_false(answers)) or "None.",
        "## How this is counted",
        LEGEND,
    ]
    return "\n\n".join(parts) + "\n"


def silent(answers: Iterable[Answer]) -> list[Answer]:
    """Cases that were answered wrongly without a word, or not answered at all."""
    return [a for a in answers if a["outcome"] in ("wrong in silence", "crashed")]


def false_warnings(answers: Iterable[Answer]) -> list[Answer]:
    """Healthy logs that were refused or warned of.

    A Stribeck velocity on its border, a column that is not excited, a refinement that did not end
    say that the recording does not determine that model: no warning of the log. That the velocity
    is off by more than a hundredth is a fault of the log where it is, and that something is missing
    is one of the model where the machine has more.
    """
    return [a for a in answers if a["family"] == "healthy" and _flagged(a)]


UNDETERMINED = {"on_border", "not_converged", "not_excited", "open_windows"}


def _flagged(answer: Answer) -> bool:
    return any(_beware(verdict, answer) for verdict in answer["commands"].values())


def _beware(verdict: Answer, answer: Answer) -> bool:
    """Whether a command refused or warned; that something is left unexplained is no warning, nor
    that a finding was dropped since it made the model worse, or that reversals were left out.
    """
    signs = set(verdict["signs"])
    if answer.get("velocity_error", 0.0) > UNRESOLVED:
        signs -= OF_THE_DERIVATIVE
    if answer.get("lacks"):
        signs -= {"structure_left", "curve_missed", "force_missed"}
    undetermined = verdict["outcome"] == "refused" and signs <= UNDETERMINED
    no_warning = verdict["outcome"] == "warned" and signs <= {*UNSURE, "not_better", "creeps"}
    return verdict["outcome"] in ("refused", "warned") and not (undetermined or no_warning)


def summary(answers: Sequence[Answer]) -> str:
    """The two shares that are aimed at, in two sentences."""
    healthy = [a for a in answers if a["family"] == "healthy"]
    false, quiet = false_warnings(answers), silent(answers)
    of_mistakes = [a for a in quiet if a["family"] != "healthy"]
    return (
        f"Wrong in silence: {len(quiet)} of {len(answers)} cases, {len(of_mistakes)} of them with "
        f"a mistake in the log, {len(quiet) - len(of_mistakes)} of them healthy. False warnings: "
        f"{len(false)} of {len(healthy)} healthy logs."
    )


def _table(key: str, answers: Sequence[Answer]) -> str:
    counts: dict[str, Counter] = {}
    for answer in answers:
        counts.setdefault(answer[key], Counter())[answer["outcome"]] += 1
    rows = [[key, *OUTCOMES], ["---"] * (len(OUTCOMES) + 1)]
    for name in sorted(counts):
        rows.append([name, *(str(counts[name][outcome] or "") for outcome in OUTCOMES)])
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def _silent(answers: Sequence[Answer]) -> Iterable[str]:
    for a in sorted(silent(answers), key=lambda a: (a["mistake"], a["number"])):
        wrong = [(n, v) for n, v in a["commands"].items() if v["outcome"] == a["outcome"]]
        what = "; ".join(f"{n}: {', '.join([*v['off'], *v['signs']])}" for n, v in wrong)
        own = f" Without the mistake: {a['own']}." if "own" in a else ""
        yield f"- {_again(a)} **{a['mistake']}** ({_about(a)}): {what}.{own}"


def _false(answers: Sequence[Answer]) -> Iterable[str]:
    for a in false_warnings(answers):
        said = [(n, v["signs"]) for n, v in a["commands"].items() if _beware(v, a)]
        what = "; ".join(f"{name}: {', '.join(signs)}" for name, signs in said)
        yield f"- {_again(a)} ({_about(a)}): {what}"


def _again(answer: Answer) -> str:
    unseen = " --unseen" if answer["unseen"] else ""
    return f"`--seed {answer['seed']} --case {answer['number']}{unseen}`"


def _about(answer: Answer) -> str:
    velocity = "velocity recorded" if answer["velocity"] else "no velocity"
    return f"{answer['machine']}; {answer['model']}; {velocity}"
