"""Whether `jaxfric select` chooses the right friction shape, and says when none can be told.

    python benchmarks/select_shapes.py --each 20 --seed 5

Drawn axes of four shapes, asymmetric; Stribeck velocities of 10 to 20 mm/s and bumps of 5 to 10 N
beside 10 to 25 N of Coulomb friction. Slow motion resolves the bump; the same twenty times faster
has hardly a sample on it. All ten models compete.
"""

import argparse
import json
from collections import Counter

import jax
import numpy as np

import jaxfric as jf

KINDS = ("coulomb-viscous", "gaussian", "lorentzian", "exponential")
NOISE, RATE = 0.3, 1000.0


def machine(kind, rng):
    """An axis of that shape."""
    values = {"inertia": rng.uniform(2, 8)}
    for sign in "+-":
        values |= {f"coulomb{sign}": rng.uniform(10, 25), f"viscous{sign}": rng.uniform(30, 90)}
        if kind != "coulomb-viscous":
            values[f"stribeck_force{sign}"] = rng.uniform(5, 10)
            values[f"stribeck_velocity{sign}"] = rng.uniform(0.01, 0.02)
    return jf.models.from_parameters(jf.models.named(kind), values)


def recorded(model, rng, faster=1.0):
    """Three sines, 16 s."""
    t = np.arange(round(16 * RATE) + 1) / RATE
    w = 2 * np.pi / rng.uniform(3, 5)
    waves = ((0.03, 1, 0.0), (0.02, 3, rng.uniform(0, 6)), (0.005, 7, rng.uniform(0, 6)))
    x, v, a = (
        faster * sum(s * (n * w) ** k * np.sin(n * w * t + p + k * np.pi / 2) for s, n, p in waves)
        for k in range(3)
    )
    mass = float(model.parameters["inertia"])
    force = np.asarray(model.friction(v)) + mass * a + NOISE * rng.normal(size=t.size)
    return jf.Recording(t, force, position=x, velocity=v)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=20)
    parser.add_argument("--seed", type=int, default=5)
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    for name, faster in (("slow", 1.0), ("fast", 20.0)):
        right = told = 0
        chosen = {kind: Counter() for kind in KINDS}
        for number in range(arguments.each):
            for place, kind in enumerate(KINDS):
                rng = np.random.default_rng([arguments.seed, number, place])
                found = jf.select(recorded(machine(kind, rng), rng, faster))
                chosen[kind][found.name] += 1
                right += found.name == kind
                told += bool(found.reason)
        count = arguments.each * len(KINDS)
        print(f"{name}: {right} of {count} right; cannot be told apart, and why: {told}")
        print(json.dumps(chosen), flush=True)


if __name__ == "__main__":
    main()
