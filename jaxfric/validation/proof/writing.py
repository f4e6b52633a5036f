"""The report of a proof, in Markdown."""

from collections.abc import Sequence
from typing import Any

from ..concealed import names
from . import calibration, counting as counted, defining
from .counting import Rate, middle, of_kind, rate
from .planning import KINDS
from .scoring import LEAST_REDUCTION, Parameter, Score

METHOD = f"""\
A machine is drawn for each case: inertia, friction and its shape, asymmetry, units, loop, motion,
sample rate, encoder, noise, an unrecorded load; of every 24 cases 8 are healthy, 12 have one
concealed effect (all take turns), 3 have two, and one has an effect for which the library has no
term. The truth is written to `sealed/` before `explain` starts. `explain` is
given the recording, the name of the baseline that would be right for the healthy machine, and the
held-out recording; a neighbouring axis' velocity is in the recording if, and only if, there is one
that disturbs. Its answer is written to `answers/`. Scoring opens `sealed/` afterwards.

- *Size*: root mean square of the concealed force over the set-point's motion, in parts of the
  Coulomb level.
- *Exactly*: the findings are the truth and nothing else; on a healthy machine the verdict is
  `consistent`. *Among*: every true effect is named. *Within the class*: every true effect is named
  or stands in a finding's `confusable_with`.
- *Place*: one of the coordinates that the catalogue gives the true effect is among those on which
  structure was found, or on which a finding acts.
- *Oracle*: the true concealed force is subtracted from the measured force of both recordings, the
  baseline is fitted to what is left of the first and predicts what is left of the second with
  nothing refitted; its error is the norm of that residual over the norm of the held-out force as
  measured. *Part of the oracle's reduction*: (before − after)/(before − oracle), of cases where
  the oracle removes {LEAST_REDUCTION:.0%} of the error or more, and not of `disturbance_pulses`,
  which come at other moments in the held-out recording. An effect *shows* where the oracle removes
  as much, or is not asked: else the baseline imitates its force, or the noise hides it. Two effects
  show where the oracle removes as much of what one is left with who knows either of them.
- *Velocity run forward*: the model, driven by the held-out force, is started anew from the
  recorded motion every fifth of the time between reversals; norm of what its velocity is off over
  norm of the velocity. Of cases where something was found and both models can run: not presliding,
  faults of the actuator or delays.
- *Parameters*: those of rightly named effects that have the same name in truth and finding; error
  relative to the truth; the 95 % intervals are those that the explanation gives.
- A case that has no answer within the time limit, or whose process dies twice, has gone wrong.
- Brackets hold the 95 % interval of a share (Wilson). A case that went wrong counts as a miss."""

DEFINED = """\
The same effect by several definitions of its physics. Those of the half *development* may be looked
at while the library is worked on, those *scored* are counted and nothing else; which is which
follows from the table of definitions. A healthy machine is drawn by how it sticks and is logged."""

AGAIN = """\
`from jaxfric.concealed import draw, record; run = record(draw(SEED, (EFFECTS…), SIZES))` makes the
recordings of a machine again: its seed and effects are in the table, its range of sizes is the
command's."""


def report(
    scores: Sequence[Score],
    command: str,
    pictures: Sequence[str] = (),
    *,
    title: str = "Concealed effects",
    method: str = METHOD,
    again: str | None = None,
    more: Sequence[str] = (),
) -> str:
    """The report of scored cases, made by a command.

    **Arguments:** `pictures`: files beside the report; `title`, and `method`: how the cases were
    made and judged; `again`: how one is made again; `more`: further parts, before the cases that
    were missed.
    """
    parts = [
        f"# {title}: {len(scores)} cases",
        f"`{command}`",
        _code(scores),
        table(("", "share or value", "cases"), _short(scores)),
        *(f"![{name.partition('.')[0]}]({name})" for name in pictures),
        "## Power: one effect, by size",
        _power(counted.binned(scores)),
        "## One effect, by effect",
        _power(_by_effect(scores)),
        *_definitions(scores),
        "## Confusion: true effect by the one named first",
        _confusion(scores),
        "## Parameters of rightly named effects",
        _parameters(counted.parameters(scores)),
        *_of_other_laws(counted.parameters(scores, same=False)),
        "## How sure, and how often true",
        _calibration(scores),
        "## Parameters and reduction of the held-out error, by size",
        _by_size(scores),
        "## Errors on the held-out recording, median",
        _errors(scores),
        "## Seconds a case",
        _seconds(scores),
        *more,
        "## Cases that were missed",
        AGAIN if again is None else again,
        _missed(scores),
        "## How this is done",
        method,
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def short(scores: Sequence[Score]) -> str:
    """The short table, for a terminal."""
    rows = list(_short(scores))
    widths = [max(len(row[i]) for row in rows) for i in range(3)]
    return "\n".join(
        f"{label:{widths[0]}}  {value:{widths[1]}}  {cases:>{widths[2]}}"
        for label, value, cases in rows
    )


def table(head: Sequence[str], rows: Any) -> str:
    """A table in Markdown; what is not there is a dash."""
    lines = ["| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows)]
    return "\n".join(lines)


def _short(scores: Sequence[Score]):
    """Rows of the short table: of what there are cases."""
    for label, value in counted.summary(scores).items():
        if isinstance(value, Rate) and value.total:
            yield label, share(value), f"{value.hits}/{value.total}"
        elif isinstance(value, float):
            yield label, _number(value), ""


def share(value: Rate) -> str:
    """A rate as percents, with its interval."""
    if value.share is None:
        return "-"
    low, high = value.interval
    return f"{value.share:.1%} [{low:.0%}, {high:.0%}]"


def _number(value: float | None, form: str = ".3g") -> str:
    return "-" if value is None else format(value, form)


def _code(scores: Sequence[Score]) -> str:
    states = sorted({s.code for s in scores if s.code})
    if len(states) < 2:
        return f"Source of the package: {', '.join(states)}."
    return (
        f"**The answers are of {len(states)} states of the package's source "
        f"({', '.join(states)}); a proof should be of one.**"
    )


def _power(groups) -> str:
    head = ("", "cases", "exactly", "named first", "among", "within the class", "place")
    return table(head, [(name, str(len(some)), *rates(some)) for name, some in groups])


def rates(some: Sequence[Score]) -> list[str]:
    """Of some cases: exactly, first, among, within the class, place."""
    return [
        share(rate(some, holds))
        for holds in (
            lambda s: s.exact,
            lambda s: s.named[:1] == s.effects,
            lambda s: s.among,
            lambda s: s.within,
            counted.located,
        )
    ]


def _by_effect(scores: Sequence[Score]) -> list[tuple[str, list[Score]]]:
    single = of_kind(scores, "single")
    found = {name: [s for s in single if s.effects == (name,)] for name in names()}
    return [(name, some) for name, some in found.items() if some]


def _definitions(scores: Sequence[Score]) -> list[str]:
    """Effect by definition, where definitions were asked for or drawn in more than one way."""
    rows = [
        (r["half"], r["of"], r["definition"], str(r["cases"]), str(r["exact"]), str(r["within"]),
         ", ".join(f"{verdict} {n}" for verdict, n in r["verdicts"].items()),
         ", ".join(r["otherwise"]) or "-")
        for r in defining.by_definition(scores)
    ]  # fmt: skip
    if sum(row[2] != "all" for row in rows) < 2:
        return []
    head = ("half", "effect, or what of the machine", "definition", "cases", "exactly",
            "within the class", "verdicts", "said where not exactly")  # fmt: skip
    return ["## By physical definition", DEFINED, table(head, rows)]


def _calibration(scores: Sequence[Score]) -> str:
    found = [
        (r["of"], str(r["findings"]), share(Rate(r["true"], r["findings"])),
         share(Rate(r["within"], r["findings"])))
        for r in calibration.reliability(scores)
    ]  # fmt: skip
    if not found:
        return "Nothing was found."
    held = [
        (r["effect"], str(r["intervals"]), share(Rate(r["held"], r["intervals"])),
         _number(r["median_error"], ".1%"))
        for r in calibration.coverage(scores)
    ]  # fmt: skip
    parts = [table(("findings by", "findings", "true", "true or declared confusable"), found)]
    if held:
        head = ("effect", "parameters", "95 % interval held the truth", "median error")
        parts.append(table(head, held))
    return "\n\n".join(parts)


def _confusion(scores: Sequence[Score]) -> str:
    """Rows that are not on the diagonal, in words: the whole matrix is wider than a page."""
    true, named, counts = counted.confusion(scores)
    rows = []
    for effect, row in zip(true, counts, strict=True):
        cells = sorted(zip(named, row, strict=True), key=lambda cell: -cell[1])
        text = ", ".join(f"{name} {n}" for name, n in cells if n and name != effect)
        right = dict(cells).get(effect, 0)
        rows.append((effect, str(sum(row)), str(right), text or "-"))
    return table(("true", "cases", "named so", "named otherwise"), rows)


def _parameters(found: Sequence[Parameter]) -> str:
    groups: dict[tuple[str, str], list[Parameter]] = {}
    for p in found:
        groups.setdefault((p.effect, p.name), []).append(p)
    rows = [(*key, *_errors_of(some)) for key, some in sorted(groups.items())]
    rows.append(("all", "", *_errors_of(found)))
    head = ("effect", "parameter", "cases", "median error", "95 % interval held it")
    return table(head, rows)


def _of_other_laws(found: Sequence[Parameter]) -> list[str]:
    """Numbers that mean something else in the machine than in the law."""
    if not found:
        return []
    text = (
        "Of definitions whose law is another, so that the parameter has no true value, not counted:"
    )
    return [text, _parameters(found)]


def _errors_of(some: Sequence[Parameter]) -> tuple[str, str, str]:
    error = middle(p.error for p in some)
    return str(len(some)), _number(error, ".1%"), share(counted.covered(some))


def _by_size(scores: Sequence[Score]) -> str:
    rows = []
    for name, some in counted.binned(scores):
        reached = [s.reached for s in some if s.reached is not None]
        rows.append(
            (name, *_errors_of(counted.parameters(some)), _number(middle(reached), ".1%"),
             str(len(reached)))
        )  # fmt: skip
    head = ("one effect", "parameters", "median error", "95 % interval held it",
            "part of the oracle's reduction, median", "of cases")  # fmt: skip
    return table(head, rows)


def _seconds(scores: Sequence[Score]) -> str:
    rows = []
    for kind in KINDS.values():
        times = sorted(s.seconds for s in of_kind(scores, kind) if s.seconds is not None)
        if times:
            late = times[min(int(0.9 * len(times)), len(times) - 1)]
            rows.append((kind, *(f"{t:.1f}" for t in (middle(times), late, times[-1]))))
    return table(("", "median", "nine of ten below", "longest"), rows)


def _errors(scores: Sequence[Score]) -> str:
    rows = []
    for kind in KINDS.values():
        some = [s for s in of_kind(scores, kind) if s.error is None]
        if some:
            values = [middle(getattr(s, what) for s in some) for what in _WHAT]
            count = str(sum(s.reached is not None for s in some))
            both = [s for s in some if counted.quieted(s) is not None]
            run = [middle(getattr(s, what) for s in both) for what in ("run_before", "run_after")]
            cells = (*(_number(v, ".2%") for v in values), count)
            rows.append((kind, *cells, *(_number(v, ".2%") for v in run), str(len(both))))
    head = ("", "force before", "after", "oracle", "part of the oracle's reduction", "of cases",
            "velocity run forward, before", "after", "of cases")  # fmt: skip
    return table(head, rows)


_WHAT = ("before", "after", "oracle", "reached")


def _missed(scores: Sequence[Score]) -> str:
    rows = []
    for s in scores:
        if s.exact or (s.kind == "outside" and s.error is None):
            continue
        truth = [f"{e} {z:.1%}" for e, z in zip(s.effects, s.sizes or _unknown(s), strict=True)]
        named = ", ".join(s.named) or "nothing"
        said = s.error or f"{s.verdict}: {named}"
        if s.error is None and not s.among and s.within:
            said += " (declared confusable)"
        rows.append((s.name, str(s.seed), " + ".join(truth) or "nothing", said.replace("|", "/")))
    return table(("case", "machine's seed", "true", "said"), rows) if rows else "None."


def _unknown(score: Score) -> tuple[float, ...]:
    return (float("nan"),) * len(score.effects)
