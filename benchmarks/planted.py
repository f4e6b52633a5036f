"""Known effects planted in a real recording, and what `explain` calls them.

Adding a known force of the recorded motion to the recorded force makes exactly the recording of a
machine with that physics at the same motion. Each term of the library is drawn at a random place
where the recording can tell it from the baseline, its force a given share of the Coulomb level.

    python benchmarks/planted.py FILE --columns force=vir,position=qm --scale force=35.15 \\
        --coulomb 20 --sizes 0.05,0.1,0.2
"""

import argparse
import dataclasses
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax
import jax.numpy as jnp
import numpy as np

import jaxfric as jf
from jaxfric.cli import options
from jaxfric.explanation import explain
from jaxfric.explanation.candidates import candidates, scaled
from jaxfric.explanation.chance import Judge
from jaxfric.explanation.predictions import with_predictions
from jaxfric.explanation.question import ask

# A place where more than this part of the force is new to the baseline: elsewhere there is nothing
# to be found.
VISIBLE = 0.3


def main() -> None:
    """Print a row for each term and size, and the totals."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file")
    parser.add_argument("--columns", type=options.names, default={})
    parser.add_argument("--scale", type=options.factors, default={})
    parser.add_argument("--coulomb", type=float, required=True, help="in the unit of the force")
    parser.add_argument("--sizes", default="0.05,0.1,0.2")
    parser.add_argument("--baseline", default="coulomb-viscous")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    recording = jf.read(arguments.file, columns=arguments.columns, scale=arguments.scale)
    recording = dataclasses.replace(recording, velocity=None)
    there = {f.effect for f in explain(recording, arguments.baseline).findings}
    print(f"in the recording itself: {', '.join(sorted(there)) or 'nothing'}\n")
    sizes = [float(size) for size in arguments.sizes.split(",")]
    totals: dict[float, list[tuple[bool, bool, bool]]] = {size: [] for size in sizes}
    for effect, force in _planted(recording, arguments.baseline, arguments.seed):
        row = []
        for size in sizes:
            added = jnp.asarray(size * arguments.coulomb * force)
            found = explain(
                dataclasses.replace(recording, force=recording.force + added), arguments.baseline
            ).findings
            names = [f.effect for f in found]
            alike = {name for f in found for name in f.confusable_with}
            totals[size].append(
                (names[:1] == [effect], effect in names, effect in {*names, *alike})
            )
            row.append("first" if names[:1] == [effect] else "named" if effect in names else
                       "class" if effect in alike else "-")  # fmt: skip
        print(f"{effect:30}" + "".join(f"{cell:>8}" for cell in row), flush=True)
    for size, rows in totals.items():
        first, named, alike = np.mean(rows, axis=0)
        print(f"{size:.0%} of Coulomb: first {first:.0%}, named {named:.0%}, in class {alike:.0%}")


def _planted(recording, baseline, seed):
    """Every term at a random place: effect, and force at the samples, unit mean square in slip."""
    draw = np.random.default_rng(seed)
    asked = ask(recording, None, jf.models.named(baseline))
    seen = with_predictions(asked.evidence, asked.base)
    judge = Judge(asked.base, asked.block)
    prepared = jf.signals.prepare(recording)
    time = np.asarray(prepared.time)
    nodes = np.asarray(seen.motion.time)[: seen.nodes]
    channels = {
        name: jnp.asarray(np.interp(time, nodes, np.asarray(values)[: seen.nodes]))
        for name, values in seen.motion.channels.items()
    }
    motion = dataclasses.replace(prepared, channels=channels)
    slips = np.abs(np.asarray(prepared.velocity)) > asked.evidence.limits.slowest
    for candidate in candidates(seen, jf.models.named(baseline)):
        raw = scaled(candidate.columns(seen))
        new = np.array([_new(judge, raw[i : i + 1]) for i in range(len(raw))])
        places = np.flatnonzero(new > max(VISIBLE * new.max(), 0.02))
        if not len(places):
            continue
        place, term = candidate.betas[draw.choice(places)], candidate.term
        alpha = draw.normal(size=raw.shape[1])
        alpha = np.abs(alpha) if candidate.effect.positive else alpha
        term = term.with_beta(jnp.asarray(place)) if len(place) else term
        force = np.asarray(term.columns(motion)) @ alpha
        if term.inertial:
            force = force + np.gradient(np.asarray(term.momentum(motion)) @ alpha, time)
        yield candidate.effect.name, force / np.sqrt(np.mean(force[slips] ** 2))


def _new(judge, raw) -> float:
    own, _ = judge.fresh(raw)
    whole = float(np.sum(raw**2))
    inside = np.einsum("gkj,glj->gkl", raw, own)
    return float(np.sqrt(np.sum(inside**2) / whole)) if whole > 0 else 0.0


if __name__ == "__main__":
    main()
