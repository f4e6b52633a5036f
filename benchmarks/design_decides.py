"""Whether the experiment that `jaxfric design` proposes decides between confusable effects.

    python benchmarks/design_decides.py --cases 50 --seed 11 --out decides.json

Axes are drawn with one effect and recorded along an unlucky motion: part of the stroke, one speed.
Where this recording does not tell the true effect from others (`decide`), that is a case. Then the
axis is recorded once more: along the motion of `separation.separate`, along a plain sine within
the same limits, and along the first motion again, with the noise of the first recording, three
and ten times it; `decide` says which effect each speaks for.
"""

import argparse
import json
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import jaxfric as jf
from jaxfric.identification.deciding import decide, shapes
from jaxfric.identification.motion import Limits, multisine, sine
from jaxfric.identification.separation import separate
from jaxfric.terms.effects import EFFECTS as CATALOGUE

jax.config.update("jax_enable_x64", True)
LIMITS = Limits(0.1, 0.15, 2.0, 60.0, 12.0, 0.004)
MASS, BANDWIDTH = 4.0, 60.0
# White noise of the force, parts of its own spread: of the first recording, and of the second.
NOISE, NOISES = 0.02, (0.02, 0.06, 0.2)
KINDS = ("designed", "sine", "repeated")
FRESH = 12
EFFECTS = (
    "spring", "hardening_spring", "gravity_unbalance", "cogging", "periodic_disturbance",
    "position_dependent_friction", "sticky_spot", "end_stop",
)  # fmt: skip


def machine(rng, effect):
    """An axis with one effect of 10 to 40 % of the Coulomb level, in Newton."""
    level = rng.uniform(8, 20)
    base = {"inertia": MASS}
    for sign in "+-":
        base |= {f"coulomb{sign}": level * rng.uniform(0.9, 1.1)}
        base |= {f"viscous{sign}": level / LIMITS.velocity * rng.uniform(0.1, 0.5)}
    size, reach = level * rng.uniform(0.1, 0.4), LIMITS.position
    angle = rng.uniform(0, 2 * np.pi)
    terms = jf.terms
    drawn = {
        "spring": lambda: (terms.Spring(0.0), [size / reach * 1.7]),
        "hardening_spring": lambda: (terms.HardeningSpring(), [2.6 * size / reach**3]),
        "gravity_unbalance": lambda: (terms.GravityUnbalance(), wave(size, angle)),
        "cogging": lambda: (terms.Cogging(), wave(size, angle)),
        "periodic_disturbance": lambda: (terms.PeriodicDisturbance(), wave(size, angle)),
        "position_dependent_friction": lambda: (
            terms.PositionDependentFriction(),
            wave(size, angle),
        ),
        "sticky_spot": lambda: (terms.StickySpot(), [2 * size]),
        "end_stop": lambda: (terms.EndStop(), [8 * size / reach]),
    }  # fmt: skip
    term, alpha = drawn[effect]()
    bent = {
        "hardening_spring": [0.0],
        "gravity_unbalance": [rng.uniform(3, 6) * reach],
        "cogging": [rng.uniform(0.005, 0.02)],
        "periodic_disturbance": [rng.uniform(3.0, 8.0)],
        "position_dependent_friction": [rng.uniform(1.0, 4.0) * reach],
        "sticky_spot": [rng.uniform(-0.3, 0.3) * reach, rng.uniform(0.1, 0.2) * reach],
        "end_stop": [rng.uniform(0.2, 0.5) * reach],
    }.get(effect, [])
    model = jf.models.coulomb_viscous() + term
    affine = [p.name for p in term.affine]
    nonlinear = [p.name for p in term.nonlinear]
    values = base | dict(zip(affine, alpha, strict=True)) | dict(zip(nonlinear, bent, strict=True))
    return jf.models.from_parameters(model, values)


def wave(size, angle):
    """Sine and cosine of a wave of that root mean square."""
    return [2**0.5 * size * np.sin(angle), 2**0.5 * size * np.cos(angle)]


def unlucky(rng, effect):
    """The first motion: one speed for what is a line, part of the stroke for what is a shape."""
    t = np.arange(round(LIMITS.duration / LIMITS.interval) + 1) * LIMITS.interval
    reach = LIMITS.position * rng.uniform(0.2, 0.5)
    if effect in ("cogging", "periodic_disturbance"):
        period = 4 * reach / (LIMITS.velocity * rng.uniform(0.3, 0.6))
        phase = (t / period) % 1.0
        # One speed, and reversals rounded over a tenth of the stroke's time.
        x = reach * (1 - np.abs(4 * ((phase + 0.25) % 1.0) - 2))
        width = max(int(0.05 * period / LIMITS.interval), 3)
        kernel = np.hanning(width + 2)[1:-1]
        padded = np.pad(x, width, mode="edge")
        x = np.convolve(padded, kernel / kernel.sum(), "same")[width:-width]
    else:
        speed = LIMITS.velocity * rng.uniform(0.3, 0.6)
        rate = speed / reach
        x = reach * np.sin(rate * t)
    return jf.Recording(t, 0 * t, position=x)


def recorded(model, reference, seed, noises=(NOISE,)):
    """The axis in closed loop with an encoder, once for each noise of the force, which is centred
    on its sample.
    """
    loop = jf.PD(kp=MASS * BANDWIDTH**2, kd=2 * MASS * BANDWIDTH)
    run = jf.simulate(
        model, reference, loop, encoder=jf.Encoder(2e-7), substeps=2, key=jax.random.key(seed)
    )
    force = np.asarray(run.force)
    centred = 0.5 * (force + np.concatenate([force[:1], force[:-1]]))
    white = np.std(force) * np.random.default_rng(seed).normal(size=force.size)
    # What the loop needs to settle is left out.
    kept = slice(25, None)
    return [
        jf.Recording(
            run.time[kept], jnp.asarray(centred + noise * white)[kept], position=run.position[kept]
        )
        for noise in noises
    ]


def along(motion):
    """A designed motion as a set-point."""
    return jf.Recording(motion.time, 0 * motion.time, position=motion.position)


def case(seed, effects=EFFECTS):
    """One drawn axis; no case where nothing is confusable or the truth is not among it."""
    rng = np.random.default_rng(seed)
    effect = effects[int(rng.integers(len(effects)))]
    model = machine(rng, effect)
    first = unlucky(rng, effect)
    (log,) = recorded(model, first, seed)
    scales = jf.signals.scales(jf.signals.prepare(log))
    others = [r for r in CATALOGUE[effect].confusable_with if shapes(r, scales)]
    improved = jf.models.coulomb_viscous() + shapes(effect, scales)[0]
    # As `explain` would: the effect that leaves least, and those that it is not told from.
    said = decide(jf.identify(improved, log).model, effect, others, log)
    rivals = list(said.alike)
    found = {"seed": seed, "true": effect, "named": said.effect, "rivals": rivals}
    if not rivals or effect not in (said.effect, *rivals):
        return found | {"case": False}
    found["case"] = True
    term = jf.models.coulomb_viscous() + shapes(said.effect, scales)[0]
    told = jf.identify(term, log).model
    start = time.perf_counter()
    plan = separate(told, {said.effect: rivals}, LIMITS)
    found["design_seconds"] = time.perf_counter() - start
    found["enough"] = plan.enough
    found["apart"] = [each._asdict() for each in plan.apart if effect in (each.true, each.other)]
    motions = {
        "designed": along(plan.motion),
        "sine": along(multisine(sine(LIMITS), LIMITS)),
        "repeated": first,
    }
    for number, (kind, reference) in enumerate(motions.items()):
        noises = NOISES[:1] if kind == "repeated" else NOISES
        logs = recorded(model, reference, seed + 1_000_003 * (number + 1), noises)
        found[kind] = [said_of(decide(told, said.effect, rivals, log), effect) for log in logs]
    return found


def said_of(verdict, effect):
    """A decision as plain data; how far the best of the wrong effects is from the best of all."""
    wrong = [each.above for each in verdict.standings if each.effect != effect]
    return {
        "effect": verdict.effect, "decided": verdict.decided, "right": verdict.effect == effect,
        "margin": min(wrong),
        "above": {each.effect: round(each.above, 1) for each in verdict.standings},
    }  # fmt: skip


def summary(cases):
    """For each noise and motion: counts over the cases, and quartiles of the margin."""
    return {f"noise {noise:.0%}": {
        kind: _counts([case[kind][i] for case in cases if i < len(case[kind])])
        for kind in KINDS
        if any(i < len(case[kind]) for case in cases)
    } for i, noise in enumerate(NOISES)}  # fmt: skip


def _counts(said):
    margins = [s["margin"] if s["right"] else 0.0 for s in said] or [0.0]
    return {
        "decided rightly": sum(s["decided"] and s["right"] for s in said),
        "decided wrongly": sum(s["decided"] and not s["right"] for s in said),
        "not decided": sum(not s["decided"] for s in said),
        "least error right": sum(s["right"] for s in said),
        "margin": [round(float(x), 1) for x in np.percentile(margins, (25, 50, 75))],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--effects", nargs="+", default=EFFECTS, choices=EFFECTS)
    parser.add_argument("--out", type=Path, default=Path("decides.json"))
    arguments = parser.parse_args()
    # What an interrupted run has written stays.
    seen = json.loads(arguments.out.read_text())["cases"] if arguments.out.exists() else []
    seed = 10_000 * arguments.seed + len(seen)
    while sum(c["case"] for c in seen) < arguments.cases:
        if seed % FRESH == 0:  # each structure is a program: the process runs out of memory maps
            jax.clear_caches()
        try:
            one = case(seed, arguments.effects)
        except ValueError as error:
            one = {"seed": seed, "case": False, "error": str(error)}
        seen.append(one)
        seed += 1
        short = {k: v for k, v in one.items() if k in ("seed", "true", "named", "rivals", "error")}
        ways = {
            k: [(said["effect"], said["decided"], round(said["margin"], 1)) for said in one[k]]
            for k in KINDS
            if k in one
        }
        print(json.dumps(short | ways), flush=True)
        cases = [c for c in seen if c["case"] and "designed" in c]
        arguments.out.write_text(json.dumps({"summary": summary(cases), "cases": seen}, indent=1))
    print(f"{len(seen)} axes drawn, {len(cases)} confusable cases")
    for noise, rows in summary(cases).items():
        print(noise)
        for kind, row in rows.items():
            print(f"  {kind:9}", row)


if __name__ == "__main__":
    main()
