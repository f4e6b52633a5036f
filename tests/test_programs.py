"""How functions are compiled: the same results, a user's law as it stands, and jax's own cache."""

import os
import subprocess
import sys
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric import programs


class Pair(eqx.Module):
    value: jax.Array
    name: str = eqx.field(static=True)


class Traces:
    count = 0


def double(pair, power):
    Traces.count += 1
    return Pair(2 * pair.value**power, pair.name)


@pytest.fixture(autouse=True)
def fresh():
    Traces.count = 0


PAIR = Pair(np.arange(3.0), "a")


def test_it_is_compiled_once_for_what_decides_the_program():
    call = programs.compiled(double)
    np.testing.assert_array_equal(call(PAIR, 2).value, [0.0, 2.0, 8.0])
    call(Pair(np.ones(3), "a"), 2)  # values do not decide
    assert Traces.count == 1
    others = [(Pair(PAIR.value, "b"), 2), (PAIR, 3), (Pair(np.arange(4.0), "a"), 2)]
    assert [call(*arguments).name for arguments in others] == ["b", "a", "a"]
    assert Traces.count == 4


def test_inside_a_trace_it_is_an_ordinary_function():
    """Options of the compiler are for whole programs only."""
    call = programs.compiled(optimised=programs.LITTLE)(double)

    def total(value):
        return jnp.sum(call(Pair(value, "a"), 2).value)

    np.testing.assert_allclose(jax.jit(jax.grad(total))(jnp.arange(3.0)), [0.0, 4.0, 8.0])


LAW = """
from jaxfric.terms import AbstractLaw, Parameter
from jaxfric.units import FORCE

class Drag(AbstractLaw):
    '''Drag that grows with a power of the speed.'''

    affine = (Parameter("drag", FORCE),)

    def law(self, sample):
        return (POWER,)
"""


def test_a_law_that_was_edited_is_identified_as_it_stands():
    """Under the same name in the same place, whatever is cached in this process or in a folder."""
    time = np.arange(600) / 500
    velocity = np.sin(9 * time)
    log = jf.Recording(time, 2 * velocity, None, velocity)

    def found(power):
        module = {"__name__": "laws"}
        exec(LAW.replace("POWER", power), module)
        term = module["Drag"]()
        drag = jf.identify(term, log, projection=jf.WeakForm(8)).parameters["drag"]
        return float(drag.value)

    np.testing.assert_allclose([found("sample.velocity"), found("4 * sample.velocity")], [2, 0.5])


ROOT = Path(__file__).parents[1]


def process(folder, between=""):
    """What a process says that compiles as the command does; `between`: what happens before."""
    code = (
        "import jax, os, sys\n"
        "hits = []\n"
        "jax.monitoring.register_event_listener(lambda e, **_: hits.append(e))\n"
        "from jaxfric.cli import _configure\n"
        f"os.environ['JAXFRIC_CACHE'] = folder = {str(folder)!r}\n"
        f"_configure()\n{between}\n"
        "jax.jit(lambda x: x + 1)(1.0)\n"
        "print(hits.count('/jax/compilation_cache/cache_hits'))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return int(done.stdout)


def test_the_next_process_takes_programs_from_the_folder(tmp_path):
    assert process(tmp_path / "cache") == 0
    assert process(tmp_path / "cache") > 0


def test_a_folder_that_cannot_be_used_does_no_harm(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    before = jax.config.jax_compilation_cache_dir
    assert programs.use_cache(blocked) is None
    assert before == jax.config.jax_compilation_cache_dir
    gone = "os.rmdir(folder); open(folder, 'w').close()"
    assert process(tmp_path / "gone", gone) == 0


def test_where_the_folder_is(monkeypatch, tmp_path):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    assert programs.cache_folder() is None and programs.use_cache() is None
    monkeypatch.setenv("JAXFRIC_CACHE", str(tmp_path / "mine"))
    assert programs.cache_folder() == tmp_path / "mine"
    monkeypatch.delenv("JAXFRIC_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert programs.cache_folder() == tmp_path / "jaxfric"


LOAD = """
import jax
import jax.numpy as jnp
import numpy as np
from jaxfric import Recording
from jaxfric.terms.transmission import load_motion

jax.config.update("jax_enable_x64", True)
time = np.arange(2000) / 1000
log = Recording(time, 0 * time, 0.02 * np.cos(9 * time), -0.18 * np.sin(9 * time))
load = jax.vmap(lambda gap: load_motion(log, jnp.array(300.0), 0.2, jnp.array(1.5), gap))
for numbers in jax.jit(load)(np.array([1e-4, 4e-4])):
    print(*np.asarray(numbers).ravel().astype(str))
"""


def test_quick_loops_give_the_same_numbers(monkeypatch):
    plain = [each for each in os.environ["XLA_FLAGS"].split() if "backend_extra" not in each]
    monkeypatch.setenv("XLA_FLAGS", " ".join([*plain, "--xla_cpu_enable_fast_math=false"]))

    def stepped():
        done = subprocess.run(
            [sys.executable, "-c", LOAD], cwd=ROOT, capture_output=True, text=True, check=True
        )
        return np.array([line.split() for line in done.stdout.splitlines()], float)

    ordinary = stepped()
    programs.use_quick_loops()
    flags = os.environ["XLA_FLAGS"]
    assert flags.startswith(" ".join(plain)) and "fast_math=false" in flags  # the user's own stay
    np.testing.assert_allclose(stepped(), ordinary, rtol=1e-9, atol=1e-12)
    programs.use_quick_loops()
    assert os.environ["XLA_FLAGS"] == flags
