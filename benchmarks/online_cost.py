"""What following costs: microseconds a sample, and a closed stroke, in Python, lax.scan and C.

    python benchmarks/online_cost.py

Streams of one length with strokes of 1 s and of 50 ms, at 2 kHz: time = samples · a + strokes · b,
a and b by the two. Minima of processor time of five runs. C by `cc -O2` where there is one.
"""

import ctypes
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jaxfric import online

RATE, COUNT, ROUNDS = 2000.0, 40_000, 5
SPEEDS = {"slowest": 1e-3, "fastest": 0.2}
LOOP = """
long axis_run(axis_state *s, const double *rows, long count)
{
    axis_change change;
    long changes = 0;
    for (long i = 0; i < count; i++)
        changes += axis_add(s, rows[3 * i], rows[3 * i + 1], rows[3 * i + 2], &change);
    return changes;
}
long axis_size(void) { return sizeof(axis_state); }
"""


def stream(stroke):
    """Time, velocity and force, `(N, 3)`, and the number of strokes."""
    t = np.arange(COUNT) / RATE
    v = 0.15 * np.sin(np.pi * t / stroke)
    force = 20 * np.sign(v) + 60 * v + np.random.default_rng(0).normal(size=t.size)
    return np.stack([t, v, force], axis=1), t[-1] / stroke


def python(rows):
    """The object of a control loop."""
    values = rows.tolist()

    def run():
        follower = online.Follower(**SPEEDS)
        begin = time.process_time()
        for row in values:
            follower.add(*row)
        return time.process_time() - begin

    return run


def scan(rows):
    """The pure update in `jax.lax.scan`."""
    values, state = jnp.asarray(rows), online.start(**SPEEDS)
    loop = jax.jit(lambda s, x: jax.lax.scan(online.update, s, x)[0])
    jax.block_until_ready(loop(state, values))

    def run():
        begin = time.process_time()
        jax.block_until_ready(loop(state, values))
        return time.process_time() - begin

    return run


def compiled(rows):
    """The generated C."""
    folder = tempfile.mkdtemp()
    source, library = (str(Path(folder) / name) for name in ("axis.c", "axis.so"))
    Path(source).write_text(online.c_source(**SPEEDS, name="axis") + LOOP, encoding="utf-8")
    command = ["cc", "-std=c99", "-O2", "-shared", "-fPIC", "-o", library, source, "-lm"]
    subprocess.run(command, check=True)
    c = ctypes.CDLL(library)
    state = ctypes.create_string_buffer(c.axis_size())
    values = np.ascontiguousarray(rows)
    pointer = values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))

    def run():
        c.axis_start(state)
        begin = time.process_time()
        c.axis_run(state, pointer, ctypes.c_long(len(values)))
        return time.process_time() - begin

    return run


def main():
    jax.config.update("jax_enable_x64", True)
    ways = {"Python object": python, "lax.scan": scan}
    if shutil.which("cc"):
        ways["C, cc -O2"] = compiled
    streams = [stream(1.0), stream(0.05)]
    print(f"{'microseconds':16}{'a sample':>12}{'a closed stroke':>18}")
    for name, way in ways.items():
        spent = [min(run() for _ in range(ROUNDS)) for run in (way(rows) for rows, _ in streams)]
        strokes = [count for _, count in streams]
        stroke = (spent[1] - spent[0]) / (strokes[1] - strokes[0])
        sample = (spent[0] - strokes[0] * stroke) / COUNT
        print(f"{name:16}{1e6 * sample:12.3f}{1e6 * stroke:18.1f}")


if __name__ == "__main__":
    main()
