"""Following friction: sums over closed strokes beside recursive least squares on one stream.

    python benchmarks/online.py

The stream: an axis of 5 kg with asymmetric Coulomb, viscous and Lorentzian friction, 500 Hz, a
stroke a second, force noise 0.5 N, an encoder. Both see the same velocity, derived
with a fixed delay. Recursive least squares (RLS, which forgets) fits inertia, Coulomb and
viscous friction of each direction to the force and the differentiated velocity; it cannot fit the
bump, whose velocity is not linear. Printed: the root mean square error of the friction curve over
0.01 to 0.14 m/s, N, in the last fifth of each stream, and microseconds.
"""

import argparse
import time

import jax
import jax.numpy as jnp
import numpy as np

from jaxfric import online
from jaxfric.online import feed, solving

RATE, PERIOD, SECONDS, MASS = 500.0, 2.0, 200.0, 5.0
SPEEDS = np.concatenate([np.linspace(0.01, 0.14, 60), -np.linspace(0.01, 0.14, 60)])
KEEP = 10.0


def friction(v, size=1.0, bump=1.0):
    """The axis, N."""
    forward = 20 + bump * 8 / (1 + (v / 0.02) ** 2) + 60 * v
    backward = -18 - bump * 10 / (1 + (v / 0.03) ** 2) + 80 * v
    return size * np.where(v > 0, forward, backward)


def stream(size, resolution, bump, seed=0):
    """Time, encoder's position, force."""
    t = np.arange(round(SECONDS * RATE)) / RATE
    w = 2 * np.pi / PERIOD
    x = -0.1 / w * np.cos(w * t) - 0.05 / (3 * w) * np.cos(3 * w * t + 0.3)
    v = 0.1 * np.sin(w * t) + 0.05 * np.sin(3 * w * t + 0.3)
    a = 0.1 * w * np.cos(w * t) + 0.15 * w * np.cos(3 * w * t + 0.3)
    noise = 0.5 * np.random.default_rng(seed).normal(size=t.size)
    seen = x if resolution is None else resolution * np.round(x / resolution)
    return t, seen, MASS * a + friction(v, size(t), bump) + noise


class Recursive:
    """RLS on [dv/dt, 1(v>0), 1(v<0), v 1(v>0), v 1(v<0)] (Ljung 1999, eq. 11.12)."""

    def __init__(self, slowest, forget):
        self.slowest, self.forget = slowest, forget
        self.theta, self.matrix = np.zeros(5), 1e6 * np.eye(5)
        self.before, self.last = None, None

    def add(self, moving):
        """A sample: the acceleration of the one before by a central difference."""
        before, last, self.before, self.last = self.before, self.last, self.last, moving
        if before is None or last is None or abs(last.velocity) < self.slowest:
            return
        slope = (moving.velocity - before.velocity) / (moving.time - before.time)
        v = last.velocity
        row = np.array([slope, v > 0, -1.0 * (v < 0), v * (v > 0), v * (v < 0)], float)
        turned = self.matrix @ row
        gain = turned / (self.forget + row @ turned)
        self.theta = self.theta + gain * (last.force - row @ self.theta)
        self.matrix = (self.matrix - np.outer(gain, turned)) / self.forget

    def friction(self, v):
        """The curve, N."""
        _, up, down, rise, fall = self.theta
        return np.where(v > 0, up + rise * v, -down + fall * v)


def compare(size, resolution, bump):
    """Curve errors of RLS and of sums with two models, and microseconds a sample."""
    t, x, u = stream(size, resolution, bump)
    rows = iter([feed.Sample(a, b, float("nan"), c) for a, b, c in zip(t, x, u, strict=True)])
    start = feed.begin(rows, False, "stream")
    moving = [*start.samples, *feed.rest(rows, start.derivative)]
    count = len(moving)
    # The same memory: a stroke slips for nearly all of its time, one direction half of the time.
    methods = {
        "RLS": Recursive(start.slowest, float(np.exp(-1 / (2 * KEEP * RATE)))),
        "coulomb-viscous": online.Follower(
            "coulomb-viscous", slowest=start.slowest, fastest=start.fastest, keep=KEEP
        ),
        "lorentzian": online.Follower(
            "lorentzian", slowest=start.slowest, fastest=start.fastest, keep=KEEP
        ),
    }
    result, alarms = {}, []
    for name, method in methods.items():
        square, looked, spent = 0.0, 0, 0.0
        marks = np.linspace(0.8 * count, count - 1, 6).astype(int)
        for first, last in zip([0, *marks], [*marks, count], strict=True):
            begin = time.process_time()
            for sample in moving[first:last]:
                change = method.add(sample) if name == "RLS" else method.add(*sample)
                if change:
                    alarms.append((name, change.time))
            spent += time.process_time() - begin
            if last < 0.8 * count:
                continue
            curve = method if name == "RLS" else method.solution().model
            truth = friction(SPEEDS, size(moving[last - 1].time), bump)
            square += np.mean((np.asarray(curve.friction(SPEEDS)) - truth) ** 2)
            looked += 1
        result[name] = (np.sqrt(square / looked), 1e6 * spent / count)
    return result, alarms


def times():
    """Microseconds of the pure update in a scan, and of a solution."""
    t, x, u = stream(lambda t: 1.0, None, 1.0)
    v = np.gradient(x, t)
    values = jnp.stack([jnp.asarray(t), jnp.asarray(v), jnp.asarray(u)], axis=1)
    state = online.start(1e-3, 0.2)
    run = jax.jit(lambda s, x: jax.lax.scan(online.update, s, x)[0])
    least = {}
    after = jax.block_until_ready(run(state, values))
    calls = {"update in lax.scan, a sample": (lambda: run(state, values), len(t))}
    for name in ("coulomb-viscous", "lorentzian"):
        term = solving.friction_only(name)
        calls[f"solve {name}, when asked"] = (lambda term=term: online.solve(term, after), 1)
    for name, (call, count) in calls.items():
        jax.block_until_ready(call())
        best = np.inf
        for _ in range(7):
            begin = time.process_time()
            jax.block_until_ready(call())
            best = min(best, time.process_time() - begin)
        least[name] = 1e6 * best / count
    return least


def main():
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    jax.config.update("jax_enable_x64", True)
    sizes = {
        "steady": lambda t: 1.0 + 0 * t,
        "step of 15 % at 100 s": lambda t: np.where(t > 100, 1.15, 1.0),
        "warm-up, 1.5 to 1, 60 s": lambda t: 1 + 0.5 * np.exp(-t / 60),
    }
    print(f"{'stream':46}{'RLS':>14}{'coulomb-viscous':>18}{'lorentzian':>14}")
    for bump in (0.0, 1.0):
        for resolution in (None, 1e-6, 1e-5):
            for name, size in sizes.items():
                result, alarms = compare(size, resolution, bump)
                label = f"{name}, {'bump' if bump else 'no bump'}, encoder {resolution or 'ideal'}"
                cells = "".join(f"{error:>14.3f}" for error, _ in result.values())
                print(f"{label:46}{cells}   {alarms}")
    print("µs a sample in Python:", {k: round(v[1], 1) for k, v in result.items()})
    print("µs:", {k: round(v, 1) for k, v in times().items()})


if __name__ == "__main__":
    main()
