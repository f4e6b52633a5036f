"""Scoring: the sealed truth of each case against its answer."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ...terms.effects import EFFECTS
from ...terms.effects.actuator_saturation import ACTUATOR_SATURATION
from ...terms.effects.force_limit import FORCE_LIMIT
from ..concealed.definitions import unlike
from .planning import Case
from .trials import ANSWERS, REMEDY, SEALED, path, read

# What an oracle that knows the truth removes of the error must be more than the chance of a
# held-out recording, for the part of it that was reached to be a number of any meaning.
LEAST_REDUCTION = 0.1

# What has another name where it is looked at before any physics: a saturation beyond which nothing
# arrives.
CALLED = {FORCE_LIMIT.name: ACTUATOR_SATURATION.name}


class Parameter(NamedTuple):
    """A parameter of a rightly named effect: both values, and whether the 95 % interval held it.

    `held` is `None` where no standard error was given. `same`: whether it means the same in the
    machine's definition of the effect and in the law of the library.
    """

    effect: str
    name: str
    true: float
    found: float
    held: bool | None
    same: bool = True

    @property
    def error(self) -> float:
        """Relative to the true value."""
        return abs(self.found - self.true) / abs(self.true)


class Belief(NamedTuple):
    """One finding: its `effect`, how sure it is, and whether it is `true`.

    `p`: its p-value; `share`: of the residual; `confirmed` by the held-out recording, `None` where
    that cannot say; `alike`: how many other names it declares; `within`: the truth is among those.
    """

    effect: str
    p: float | None
    share: float | None
    confirmed: bool | None
    alike: int
    true: bool
    within: bool


class Score(NamedTuple):
    """One case, scored.

    - `name`, `kind`, `seed`, `effects` as planned; `sizes`: of each effect, in parts of Coulomb.
    - `error`: why there is no answer; what follows from one is then empty.
    - `verdict`; `named`: the findings, strongest first; `alike`: all that they are said to be
      confusable with.
    - `exact`: the findings are the truth and nothing else; `among`: the truth is among them;
      `within`: each true effect is named, or declared confusable with a named one.
    - `located`: one of the coordinates that the catalogue gives each true effect is among those
      on which structure was found or a finding acts; `None` for effects outside the library.
    - `before`, `after`, `oracle`: held-out force errors; `without`: the oracle's, of several
      effects, if it knows all but one; `run_before`, `run_after`: held-out velocity errors of the
      models run forward.
    - `parameters` that the truth and the strongest finding of the effect both have; `seconds` that
      `explain` took; `code`.
    - `definitions`: of each effect, or of how it sticks and is logged, what it is of and its name;
      `beliefs`: every finding with how sure it is.
    """

    name: str
    kind: str
    seed: int
    effects: tuple[str, ...]
    sizes: tuple[float, ...] = ()
    error: str | None = None
    verdict: str = ""
    named: tuple[str, ...] = ()
    alike: tuple[str, ...] = ()
    exact: bool = False
    among: bool = False
    within: bool = False
    located: bool | None = None
    before: float | None = None
    after: float | None = None
    oracle: float | None = None
    without: tuple[float | None, ...] = ()
    run_before: float | None = None
    run_after: float | None = None
    parameters: tuple[Parameter, ...] = ()
    seconds: float | None = None
    code: str | None = None
    definitions: tuple[tuple[str, str], ...] = ()
    beliefs: tuple[Belief, ...] = ()

    @property
    def reached(self) -> float | None:
        """Part of the oracle's reduction of the held-out error; `None` where that is too small."""
        if None in (self.before, self.after, self.oracle):
            return None
        if not _removes(self.oracle, self.before):
            return None
        return (self.before - self.after) / (self.before - self.oracle)

    @property
    def shows(self) -> bool:
        """Whether knowing the truth lowers the held-out error, of several effects that of each:
        else the baseline imitates it, or it is within the noise. Nobody knows of one without an
        oracle: then it does.
        """
        return all(_removes(self.oracle, error) for error in self.without or (self.before,))

    @property
    def hits(self) -> int:
        """How many of the true effects are named."""
        return len(set(self.effects) & set(self.named))


def scores(folder: Path, cases: Sequence[Case]) -> list[Score]:
    """Open what was sealed, and score every case that has an answer.

    **Raises:** `ValueError` that names a file which is damaged or no part of a proof.
    """
    found = []
    for case in cases:
        file = path(folder, ANSWERS, case)
        if file.is_file():
            truth = path(folder, SEALED, case)
            sealed, answer = read(truth) if truth.is_file() else None, read(file)
            try:
                found.append(score(case, sealed, answer))
            except (KeyError, TypeError, AttributeError) as error:
                raise ValueError(
                    f"{file}: is no answer to {truth}, {error!r} is missing or misplaced: {REMEDY}"
                ) from error
    return found


def score(case: Case, sealed: Mapping[str, Any] | None, answer: Mapping[str, Any]) -> Score:
    """One case; `sealed` is `None` where its machine could not be drawn."""
    first = Score(case.name, case.kind, case.seed, case.effects, code=answer.get("code"))
    first = first._replace(seconds=answer["seconds"])
    if sealed is None:
        return first._replace(error=answer["error"] or "the sealed truth is not there")
    truth = sealed["truth"]
    first = first._replace(sizes=tuple(truth[name]["size"] for name in case.effects))
    drawn = tuple((of, truth[of]["definition"]) for of in truth if "definition" in truth[of])
    first = first._replace(definitions=drawn or case.definitions)
    if answer["error"] is not None:
        return first._replace(error=answer["error"])
    findings = answer["findings"]
    named = tuple(_effect(finding) for finding in findings)
    alike = tuple({name: 0 for finding in findings for name in finding["confusable_with"]})
    run = answer.get("run") or {}
    wanted, held = set(case.effects), held_out(answer["fit"]) or {}
    return first._replace(
        verdict=answer["verdict"],
        named=named,
        alike=alike,
        # The same effect named twice, with two harmonics for one, is the same name.
        exact=set(named) == wanted and (bool(wanted) or answer["verdict"] == "consistent"),
        among=wanted <= set(named),
        within=wanted <= {*named, *alike},
        located=_located(case.effects, answer["where"]),
        before=held.get("before"),
        after=held.get("after"),
        oracle=answer["oracle"],
        without=tuple(answer.get("oracle_without", {}).values()),
        run_before=run.get("before"),
        run_after=run.get("after"),
        parameters=tuple(p for finding in _firsts(findings) for p in _parameters(finding, truth)),
        beliefs=tuple(_belief(finding, wanted) for finding in findings),
    )


def _firsts(findings: Sequence[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    """The strongest finding of each effect: a second one is a harmonic with other numbers."""
    seen: set[str] = set()
    for finding in findings:
        if finding["effect"] not in seen:
            yield finding
        seen.add(finding["effect"])


def _effect(finding: Mapping[str, Any]) -> str:
    return CALLED.get(finding["effect"], finding["effect"])


def _belief(finding: Mapping[str, Any], wanted: set[str]) -> Belief:
    effect, alike = _effect(finding), set(finding["confusable_with"])
    return Belief(
        effect,
        finding.get("p_value"),
        finding.get("share"),
        finding.get("confirmed"),
        len(alike),
        effect in wanted,
        bool({effect, *alike} & wanted),
    )


def held_out(fit: Mapping[str, Any]) -> Mapping[str, float] | None:
    """The held-out force errors through the kernel of `explain`, as the oracle's are.

    In answers from before there was another figure they have its name.
    """
    return fit.get("filtered_holdout_force_error") or fit["holdout_force_error"]


def _removes(oracle: float | None, error: float | None) -> bool:
    """Whether the oracle's error is smaller by the least part; where there is none, yes."""
    return None in (oracle, error) or error - oracle >= LEAST_REDUCTION * error


def _located(effects: Sequence[str], where: Sequence[Mapping[str, Any]]) -> bool | None:
    if not effects or any(name not in EFFECTS for name in effects):
        return None
    found = {place["coordinate"] for place in where}
    return all(
        found & {name.removesuffix("_lines") for name in EFFECTS[effect].coordinates}
        for effect in effects
    )


def _parameters(finding: Mapping[str, Any], truth: Mapping[str, Any]) -> Iterator[Parameter]:
    """Those whose names coincide; `name+` and `name-` are both compared with a common `name`."""
    effect = finding["effect"]
    values = truth.get(effect, {})
    for name, estimate in finding["parameters"].items():
        true = values.get(name, values.get(name.rstrip("+-")))
        if not isinstance(true, int | float) or true == 0 or name.endswith("phase"):
            continue
        found = estimate.get("value")
        if found is None or not math.isfinite(found):
            continue
        low, high = _ends(estimate)
        held = None if low is None else bool(low <= true <= high)
        same = name.rstrip("+-") not in unlike(effect, values.get("definition", ""))
        yield Parameter(effect, name, float(true), float(found), held, same)


def _ends(estimate: Mapping[str, Any]) -> tuple[float, float] | tuple[None, None]:
    """The 95 % interval, where there is one."""
    low, high = estimate.get("interval") or (None, None)
    return low, high
