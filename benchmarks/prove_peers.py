"""What simpler methods make of the cases of `jaxfric prove`, on the same rows.

    jaxfric prove --cases 240 --seed 1 --out proof
    python benchmarks/prove_peers.py proof

- *stepwise*: forward selection by BIC out of a library of polynomials and Fourier terms in
  position, velocity and time. The number of observations is that of rows that share no samples.
- *stlsq*: sequentially thresholded least squares over the same library, as in SINDy (Brunton,
  Proctor & Kutz 2016), columns and residual scaled to unit mean square, threshold 0.1.
- *raw ranking*: the term of jaxfric's own library with the largest R², without any correction for
  chance. It always names something.

The first two name columns, not physics. They are given the benefit of every doubt: a column counts
as naming any effect that it could stand for, and the largest one as the one named first.
"""

import argparse
import dataclasses
import json
import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from jaxfric import concealed, models
from jaxfric.cli import _configure
from jaxfric.explanation.candidates import Field
from jaxfric.explanation.contest import contest
from jaxfric.explanation.evidence import NODES
from jaxfric.explanation.predictions import with_predictions
from jaxfric.explanation.question import ask
from jaxfric.proof.counting import rate
from jaxfric.proof.planning import PATTERN
from jaxfric.proof.writing import share, table

HARMONICS = 20
MOST = 30
THRESHOLD = 0.1
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
METHODS = ("stepwise", "stlsq", "raw ranking")


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


def stepwise(base, columns, target):
    """Numbers of the columns that BIC selects one after the other, behind the baseline's."""
    count = len(target) * 3 / (2 * NODES)  # every third node has a row of 2 NODES of them
    basis = np.linalg.qr(base)[0]
    rest, left = columns - basis @ (basis.T @ columns), target - basis @ (basis.T @ target)
    size, taken = np.linalg.norm(rest, axis=0), []
    for _ in range(MOST):
        norm = np.linalg.norm(rest, axis=0)
        # What the columns before leave of it is rounding.
        gain = np.where(norm > 1e-6 * size, left @ rest / np.maximum(norm, 1e-300), 0.0)
        best, energy = int(np.argmax(np.abs(gain))), left @ left
        if -count * np.log1p(-min(gain[best] ** 2 / energy, 1 - 1e-12)) < np.log(count):
            break
        taken.append(best)
        unit = rest[:, best] / norm[best]
        left, rest = left - unit * gain[best], rest - np.outer(unit, unit @ rest)
    return taken


def stlsq(base, columns, target):
    """Numbers of the columns whose coefficients stay over the threshold."""
    basis = np.linalg.qr(base)[0]
    rest, left = columns - basis @ (basis.T @ columns), target - basis @ (basis.T @ target)
    scale = np.maximum(np.linalg.norm(rest, axis=0), 1e-300) / np.linalg.norm(left)
    kept = np.arange(columns.shape[1])
    while kept.size:
        weights = np.linalg.lstsq(rest[:, kept] / scale[kept], left, rcond=None)[0]
        large = np.abs(weights) > THRESHOLD
        if large.all():
            return kept[np.argsort(-np.abs(weights))].tolist()
        kept = kept[large]
    return []


def judge(sealed):
    """What each method says of one case: effects it could mean, the first first; errors."""
    machine = concealed.draw(sealed["seed"], sealed["effects"], tuple(sealed["size"]))
    run = concealed.record(machine)
    structure = models.named(machine.baseline)
    recording, holdout = (dataclasses.replace(r, source="") for r in (run.recording, run.holdout))
    asked = ask(recording, holdout, structure)
    x, t = np.asarray(recording.position), np.asarray(recording.time)
    scales = x.min(), np.ptp(x), t[0], np.ptp(t)
    views = asked.evidence, asked.held
    bases = [
        np.concatenate(
            [
                with_predictions(view, asked.base).columns(term, beta[None])[0]
                for term, beta in zip(asked.base.terms, asked.base.betas, strict=True)
            ],
            axis=1,
        )
        for view in views
    ]
    (families, columns), (_, held) = (library(view, *scales) for view in views)
    found = {}
    for name, method in (("stepwise", stepwise), ("stlsq", stlsq)):
        taken = method(bases[0], columns, views[0].target)
        design = np.hstack([bases[0], columns[:, taken]])
        weights = np.linalg.lstsq(design, views[0].target, rcond=None)[0]
        left = views[1].target - np.hstack([bases[1], held[:, taken]]) @ weights
        error = float(np.linalg.norm(left) / np.linalg.norm(views[1].target))
        found[name] = {"named": [FAMILIES[families[i]] for i in taken], "after": error}
    seen = with_predictions(asked.evidence, asked.base)
    trials = contest(seen, asked.base, Field(seen, structure)).trials
    best = max(trials, key=lambda trial: trial.gain).candidate.effect.name
    found["raw ranking"] = {"named": [[best]], "after": None}
    return found


def rows(cases):
    """The table: each method's rates over the cases; those of jaxfric are in the proof's report."""
    kinds = {kind: [c for c in cases if c["kind"] == kind] for kind in ("healthy", "single")}
    for method in METHODS:

        def said(case, method=method):
            return case["peers"][method]["named"]

        first = rate(kinds["single"], lambda c, s=said: bool(s(c)) and c["effects"][0] in s(c)[0])
        some = rate(
            kinds["single"], lambda c, s=said: any(c["effects"][0] in names for names in s(c))
        )
        silent = rate(kinds["healthy"], lambda c, s=said: not s(c))
        count = np.median([len(said(c)) for c in kinds["single"]]) if kinds["single"] else 0
        errors = [c["peers"][method]["after"] for c in kinds["single"]]
        error = "-" if not errors or None in errors else f"{np.median(errors):.2%}"
        yield method, share(silent), share(first), share(some), f"{count:g}", error


def main() -> None:
    """Do what is left, and write FOLDER/peers.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="of a proof that has been run")
    parser.add_argument("--cases", type=int, default=None, help="only so many, the first ones")
    arguments = parser.parse_args()
    _configure()
    out, cases = arguments.folder / "peers", []
    out.mkdir(exist_ok=True)
    for file in sorted((arguments.folder / "sealed").glob("*.json"))[: arguments.cases]:
        case = json.loads(file.read_text(encoding="utf-8"))
        there = out / file.name
        if not there.is_file():
            there.write_text(json.dumps(judge(case)), encoding="utf-8")
        cases.append(case | {"peers": json.loads(there.read_text(encoding="utf-8"))})
    head = ("", "healthy: silent", "one effect: largest column could mean it",
            "any column could", "columns, median", "held-out error, median")  # fmt: skip
    text = table(head, rows(cases))
    (arguments.folder / "peers.md").write_text(
        f"# Simpler methods on {len(cases)} cases (of every {len(PATTERN)}, 8 healthy, 12 single)"
        f"\n\n{text}\n",
        encoding="utf-8",
    )
    print(text)


if __name__ == "__main__":
    main()
