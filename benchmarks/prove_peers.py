"""What simpler methods make of the cases of `jaxfric prove`, on the same rows.

    jaxfric prove --cases 240 --seed 1 --out proof
    pip install "jaxfric[peers]"
    python benchmarks/prove_peers.py proof

- *stepwise*: forward selection by BIC out of a library of polynomials and Fourier terms in
  position, velocity and time. The number of observations is that of rows that share no samples.
- *stlsq*: sequentially thresholded least squares over the same library, as in SINDy (Brunton,
  Proctor & Kutz 2016), columns and residual scaled to unit mean square, threshold 0.1.
- *pysindy*: the same library in the package pysindy: STLSQ with its default ridge, bagged.
- *raw ranking*: the term of jaxfric's own library with the largest R², without any correction for
  chance. It always names something.
- *boosted trees*, *Gaussian process* (scikit-learn): predict what the baseline leaves from
  position, velocity, acceleration, time, direction and predicted force, and name nothing.

Those that select name columns, not physics. They are given the benefit of every doubt: a column
counts as naming any effect that it could stand for, and the largest one as the one named first.
All are judged on the held-out recording beside `explain` and the oracle of the proof.
"""

import argparse
import dataclasses
import importlib.util
import json
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import peer_methods as methods

from jaxfric import models
from jaxfric.cli import _configure
from jaxfric.data.io import write_text
from jaxfric.explanation import verification
from jaxfric.explanation.contest import contest
from jaxfric.explanation.predictions import with_predictions
from jaxfric.explanation.problem import across_reversals, problem_of, with_holdout
from jaxfric.validation import concealed
from jaxfric.validation.proof.counting import middle, rate
from jaxfric.validation.proof.planning import PATTERN
from jaxfric.validation.proof.scoring import LEAST_REDUCTION, held_out
from jaxfric.validation.proof.writing import share, table

HARMONICS = 20
# What a column of each family could stand for.
FAMILIES = {
    "curve": ("viscous_nonlinearity", "stribeck", "frictional_lag", "presliding"),
    "asymmetry": ("asymmetric_friction", "gain_asymmetry"),
    "stroke": ("spring", "hardening_spring", "end_stop", "gravity_unbalance"),
    "wave": ("cogging", "gravity_unbalance"),
    "place": ("position_dependent_friction", "sticky_spot"),
    "slow": ("load_drift",),
    "tone": ("periodic_disturbance", "disturbance_pulses", "cross_axis"),
    "warming": ("thermal_drift", "friction_step"),
}
RANKING = "raw ranking"


def library(evidence, low, stroke, start, duration):
    """Families and columns, `(J, n)`, of rows; positions and times by the first recording's."""
    motion = evidence.motion
    v, x, t = (np.asarray(a) for a in (motion.velocity, motion.position, motion.time))
    way, top = np.sign(v), float(evidence.limits.fastest)
    u, s, w = 2 * (x - low) / stroke - 1, 2 * (t - start) / duration - 1, v / top
    found = [("curve", c) for c in (w * np.abs(w), w**3, way * np.sqrt(np.abs(w)))]
    found += [("asymmetry", c) for c in (np.abs(w), w**2)]
    found += [("stroke", u**k) for k in (1, 2, 3)] + [("place", way * u**k) for k in (1, 2)]
    found += [("slow", s**k) for k in (1, 2, 3)] + [("warming", c) for c in (way * s, w * s)]
    for k in range(1, HARMONICS + 1):
        for wave in (np.sin, np.cos):
            found += [("wave", wave(np.pi * k * u)), ("tone", wave(np.pi * k * s))]
            if k <= 5:
                found.append(("place", way * wave(np.pi * k * u)))
    return [name for name, _ in found], evidence.project(np.array([c for _, c in found])).T


def there():
    """The methods whose packages are installed."""
    found = [*methods.SELECTING, RANKING, *methods.PREDICTING]
    return [m for m in found if importlib.util.find_spec(methods.NEEDS.get(m, "numpy")) is not None]


def judge(sealed, wanted):
    """What each method says of one case: effects it could mean, the first first; errors."""
    machine = concealed.draw(sealed["seed"], sealed["effects"], tuple(sealed["size"]))
    run = concealed.record(machine)
    structure = models.named(machine.baseline)
    recording, holdout = (dataclasses.replace(r, source="") for r in (run.recording, run.holdout))
    problem = problem_of(recording, structure)
    problem = with_holdout(across_reversals(recording, problem) or problem, holdout)
    found = {}
    if set(wanted) & set(methods.SELECTING):
        found |= select(problem, recording, [m for m in wanted if m in methods.SELECTING])
    if RANKING in wanted:
        seen = with_predictions(problem.evidence, problem.base)
        trials = contest(seen, problem.base, problem.candidate_set).trials
        best = max(trials, key=lambda trial: trial.gain).candidate.effect.name
        found[RANKING] = {"named": [[best]], "after": None}
    return found | predict(problem, [m for m in wanted if m in methods.PREDICTING])


def select(problem, recording, wanted):
    """What the methods that select columns take, and what a refit with it leaves when held out."""
    x, t = np.asarray(recording.position), np.asarray(recording.time)
    scales = x.min(), np.ptp(x), t[0], np.ptp(t)
    views = problem.evidence, problem.held
    bases = [
        np.concatenate(
            [
                with_predictions(view, problem.base).columns(term, beta[None])[0]
                for term, beta in zip(problem.base.terms, problem.base.betas, strict=True)
            ],
            axis=1,
        )
        for view in views
    ]
    (families, columns), (_, held) = (library(view, *scales) for view in views)
    found = {}
    for name in wanted:
        taken = methods.SELECTING[name](bases[0], columns, views[0].target)
        design = np.hstack([bases[0], columns[:, taken]])
        weights = np.linalg.lstsq(design, views[0].target, rcond=None)[0]
        left = views[1].target - np.hstack([bases[1], held[:, taken]]) @ weights
        found[name] = {
            "named": [FAMILIES[families[i]] for i in taken], "after": relative(left, views[1])
        }  # fmt: skip
    return found


def predict(problem, wanted):
    """What the methods that name nothing leave when held out."""
    lefts = [verification.residual(problem.base, view) for view in (problem.evidence, problem.held)]
    seen, held = (
        methods.signals(view, view.target - left)
        for view, left in zip((problem.evidence, problem.held), lefts, strict=True)
    )
    found = {}
    for name in wanted:
        rest = lefts[1] - methods.PREDICTING[name](seen, lefts[0], held)
        found[name] = {"named": None, "after": relative(rest, problem.held)}
    return found


def relative(left, view) -> float:
    """norm(left)/norm(force) over the held-out rows."""
    return float(np.linalg.norm(left) / np.linalg.norm(view.target))


def rows(cases, wanted):
    """The table: each method's rates over the cases, and those of `explain` in the same measure."""
    kinds = {kind: [c for c in cases if c["kind"] == kind] for kind in ("healthy", "single")}
    for method in ("explain", *wanted):

        def said(case, method=method):
            return case["said"][method]["named"]

        named = any(said(c) is not None for c in cases)
        cells = ["-"] * 4
        if named:
            first = rate(
                kinds["single"], lambda c, s=said: bool(s(c)) and c["effects"][0] in s(c)[0]
            )
            some = rate(
                kinds["single"], lambda c, s=said: any(c["effects"][0] in names for names in s(c))
            )
            count = np.median([len(said(c)) for c in kinds["single"]]) if kinds["single"] else 0
            alarms = rate(kinds["healthy"], lambda c, s=said: bool(s(c)))
            cells = [share(alarms), share(first), share(some), f"{count:g}"]
        errors = [c["said"][method]["after"] for c in kinds["single"]]
        error, part = middle(errors), middle(reached(c, method) for c in kinds["single"])
        worse = rate(kinds["healthy"], lambda c, m=method: worsened(c, m))
        yield (
            method, *cells, "-" if error is None else f"{error:.2%}",
            "-" if part is None else f"{part:.1%}", share(worse),
        )  # fmt: skip


def reached(case, method) -> float | None:
    """Part of the oracle's reduction of the held-out error, as in the proof's report."""
    before, oracle, after = case["before"], case["oracle"], case["said"][method]["after"]
    if None in (before, oracle, after) or before - oracle < LEAST_REDUCTION * before:
        return None
    return (before - after) / (before - oracle)


def worsened(case, method) -> bool | None:
    """Whether the held-out error of a healthy machine has grown by a hundredth or more."""
    after = case["said"][method]["after"]
    return None if None in (after, case["before"]) else after > 1.01 * case["before"]


def explained(answer):
    """What `explain` said, in the form of the others; `None` where it has no answer."""
    if answer["error"] is not None:
        return None
    held = held_out(answer["fit"])
    named = [[finding["effect"]] for finding in answer["findings"]]
    return {"named": named, "after": held["after"]}


def main() -> None:
    """Do what is left, and write FOLDER/peers.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="of a proof that has been run")
    parser.add_argument("--cases", type=int, default=None, help="only so many, the first ones")
    arguments = parser.parse_args()
    wanted = there()
    lacking = sorted({*methods.SELECTING, *methods.PREDICTING} - {*wanted})
    if lacking:
        print(f'{", ".join(lacking)} left out: pip install "jaxfric[peers]"', file=sys.stderr)
    _configure()
    cases = []
    for file in sorted((arguments.folder / "sealed").glob("*.json"))[: arguments.cases]:
        case = collected(arguments.folder, file, wanted)
        if case is not None:
            cases.append(case)
    head = ("", "healthy: something named", "one effect: largest column could mean it",
            "any column could", "columns, median", "held-out error, median",
            "part of the oracle's reduction, median",
            "healthy: held-out error 1 % worse")  # fmt: skip
    text = table(head, rows(cases, wanted))
    write_text(
        arguments.folder / "peers.md",
        f"# Simpler methods on {len(cases)} cases (of every {len(PATTERN)}, 8 healthy, 12 single)"
        f"\n\n{text}\n",
    )
    print(text)


def collected(folder, file, wanted):
    """A case with what each method said of it, asked now where it has not been; `None` where
    `explain` has no answer.
    """
    case = json.loads(file.read_text(encoding="utf-8"))
    answer = json.loads((folder / "answers" / file.name).read_text(encoding="utf-8"))
    ours = explained(answer)
    if ours is None:
        return None
    kept = folder / "peers" / file.name
    kept.parent.mkdir(exist_ok=True)
    said = json.loads(kept.read_text(encoding="utf-8")) if kept.is_file() else {}
    open_ = [method for method in wanted if method not in said]
    if open_:
        said |= judge(case, open_)
        write_text(kept, json.dumps(said))
    before = held_out(answer["fit"])["before"]
    measures = {"before": before, "oracle": answer["oracle"]}
    return case | measures | {"said": said | {"explain": ours}}


if __name__ == "__main__":
    main()
