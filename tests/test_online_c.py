"""The update in C does what the object in Python does, on one stream."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

from jaxfric import online
from jaxfric.cli import main
from tests.test_online import samples, write

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler here")
NODES = 128


class Change(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_double) for name in ("time", "excess", "share")),
        *((name, ctypes.c_int) for name in ("side", "strokes")),
    ]


class Follower:
    """The compiled text behind the verbs of the one in Python."""

    def __init__(self, source, library):
        flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2"]
        command = [COMPILER, *flags, "-shared", "-fPIC", "-o", library, source, "-lm"]
        subprocess.run(command, check=True)
        self._c, self._state = ctypes.CDLL(library), ctypes.create_string_buffer(80 * NODES + 8192)
        self._c.axis_start(self._state)

    def add(self, *sample):
        change = Change()
        values = [ctypes.c_double(x) for x in sample]
        if self._c.axis_add(self._state, *values, ctypes.byref(change)):
            return online.Change(
                change.time, 1 - 2 * change.side, change.strokes, change.excess, change.share
            )
        return None

    def parameters(self):
        pairs = [(ctypes.c_double * 2)() for _ in range(2)]
        assert all(self._c.axis_solve(self._state, side, pairs[side]) for side in (0, 1))
        return np.array([list(pair) for pair in pairs])


@pytest.mark.parametrize("fastest", [0.2, 0.02])  # as expected, and a tenth of what comes
def test_the_generated_c_follows_as_python_does(tmp_path, fastest):
    how = {"keep": 20.0, "nodes": NODES}
    source, library = tmp_path / "axis.c", tmp_path / "axis.so"
    source.write_text(online.c_source(1e-3, fastest, name="axis", **how), encoding="utf-8")
    c, python = (
        Follower(str(source), str(library)),
        online.Follower(slowest=1e-3, fastest=fastest, **how),
    )
    rows = np.array(samples(120.0, size=lambda t: np.where(t > 60, 1.15, 1.0)))
    rows[2000, 2] = np.nan  # a missing sample, and a gap
    rows = np.delete(rows, slice(5000, 5100), axis=0).tolist()
    changes = [[each for row in rows if (each := one.add(*row))] for one in (c, python)]
    assert len(changes[0]) == len(changes[1]) >= 1
    np.testing.assert_allclose(changes[0], changes[1], rtol=1e-9)
    found = python.solution().model.parameters
    wanted = [[float(found[f"{name}{sign}"]) for name in ("coulomb", "viscous")] for sign in "+-"]
    np.testing.assert_allclose(c.parameters(), wanted, rtol=1e-9)


@pytest.mark.slow
def test_watch_writes_it_for_a_stream(tmp_path, capsys):
    path, out = tmp_path / "axis.csv", tmp_path / "axis.c"
    write(path, 6.0)
    assert main(["watch", str(path), "--once", "--c", str(out)]) == 0
    assert "C99" in capsys.readouterr().out and "@" not in out.read_text(encoding="utf-8")
    assert main(["watch", str(path), "--model", "gaussian", "--c", str(out)]) == 2
    assert "leave out --model" in capsys.readouterr().err


def test_misuse_is_said():
    with pytest.raises(ValueError, match="name in C"):
        online.c_source(1e-3, 0.2, name="1st")
    with pytest.raises(ValueError, match="0 < slowest < fastest"):
        online.c_source(0.2, 1e-3)
