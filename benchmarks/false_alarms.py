"""False alarms of change detection over simulated months of an axis that does not change.

    python benchmarks/false_alarms.py --days 60

Each axis moves to and fro for `--days`, a stroke a second, 50 samples of it with white noise of the
force; the generated C of `jaxfric watch --c` follows it (the same as Python to 1e-9,
`tests/test_online_c.py`). Counted are the alarms beside those that the stated rate allows; then,
with friction that rises by 1 % once a day, how soon that is told.
"""

import argparse
import ctypes
import subprocess
import tempfile
from pathlib import Path

from jaxfric import online

RATE, NOISE, SPEED = 50.0, 0.5, 0.15
LOOP = """
#include <stdint.h>
static uint64_t seed;
static double uniform(void)
{
    seed ^= seed << 13; seed ^= seed >> 7; seed ^= seed << 17;
    return ((seed >> 11) + 0.5) / 9007199254740992.0;
}
/* Alarms; `daily`: the growth of friction at noon, gone at midnight; `late`: strokes until told. */
long axis_follow(long begun, long count, double rate, double noise, double daily, double *late)
{
    static axis_state s;
    axis_change change;
    long changes = 0, day = -1;
    seed = 88172645463325252ULL + 2654435761ULL * (uint64_t)begun;
    axis_start(&s);
    *late = 0.0;
    for (long i = 0; i < count; i++) {
        double t = i / rate, hours = fmod(t, 86400.0);
        double w = 3.14159265358979, v = SPEED * sin(w * t);
        double size = hours > 43200.0 ? 1.0 + daily : 1.0;
        double white = sqrt(-2.0 * log(uniform())) * cos(2.0 * w * uniform());
        double slip = v > 0 ? 20.0 + 60.0 * v : -18.0 + 80.0 * v;
        double u = 5.0 * SPEED * w * cos(w * t) + size * slip;
        if (axis_add(&s, t, v, u + noise * white, &change)) {
            changes++;
            if (daily > 0.0 && hours > 43200.0 && (long)(t / 86400.0) != day) {
                day = (long)(t / 86400.0);
                *late += hours - 43200.0;
            }
        }
    }
    return changes;
}
"""


def compiled(rate: float):
    """The update for that rate of false alarms a stroke, with the loop around it."""
    folder = Path(tempfile.mkdtemp())
    source, library = folder / "axis.c", folder / "axis.so"
    text = online.c_source(1e-3, 0.2, name="axis", false_alarms=rate)
    loop = LOOP.replace("SPEED", str(SPEED))
    source.write_text(text + loop, encoding="utf-8")
    command = ["cc", "-std=c99", "-O2", "-shared", "-fPIC", "-o", library, source, "-lm"]
    subprocess.run(command, check=True)
    follow = ctypes.CDLL(str(library)).axis_follow
    follow.restype = ctypes.c_long
    follow.argtypes = [ctypes.c_long, ctypes.c_long, *3 * [ctypes.c_double], ctypes.c_void_p]
    return follow


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--days", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    strokes = round(arguments.days * 86400)
    for rate in (1e-3, 1e-4, 1e-5):
        follow, late = compiled(rate), ctypes.c_double()
        count = round(strokes * RATE)
        alarms = follow(arguments.seed, count, RATE, NOISE, 0.0, ctypes.byref(late))
        print(
            f"stated {rate:g} a stroke: {alarms} alarms in {arguments.days:g} days, {strokes} "
            f"strokes; {alarms / strokes / rate:.2f} of what is stated",
            flush=True,
        )
    days = min(arguments.days, 10)
    told = follow(arguments.seed, round(days * 86400 * RATE), RATE, NOISE, 0.01, ctypes.byref(late))
    print(f"1 % more friction at noon of {days:g} days: {told} alarms, told after "
          f"{late.value / days:.0f} s in the mean")  # fmt: skip


if __name__ == "__main__":
    main()
