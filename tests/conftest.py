"""Strict settings for every test: double precision, no implicit promotion, no chance."""

import gc
import os
import subprocess
import sys
import time
from pathlib import Path

# One worker a core: more threads for small matrices would only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax
import pytest
from hypothesis import settings

from jaxfric import programs

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
# Thousands of small programs are lowered: that each operation says which lines it comes from, and a
# search for garbage after each 700 objects, are a fifteenth of the tests' time.
jax.config.update("jax_traceback_in_locations_limit", 0)
gc.set_threshold(100_000, 50, 1000)

# Most of the tests' time is compiling: programs that run once need no optimisation. Benchmarks and
# the documentation's pages compile as users do.
QUICK = (
    "--xla_cpu_use_fusion_emitters=false",
    "--xla_backend_optimization_level=0",
    "--xla_llvm_disable_expensive_passes=true",
    "--xla_cpu_parallel_codegen_split_count=1",
)


def known(options) -> list[str]:
    """The options that this jaxlib knows: of an unknown one XLA ends the process."""

    def starts(some) -> bool:
        script = "import jax; jax.jit(lambda: 0)()"
        environment = os.environ | {"XLA_FLAGS": " ".join(some)}
        run = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True)
        return run.returncode == 0

    return list(options) if starts(options) else [each for each in options if starts([each])]


def pytest_configure(config):
    """Set XLA's options before its first program; processes that tests start inherit them."""
    if "PYTEST_XDIST_WORKER" not in os.environ:
        os.environ["XLA_FLAGS"] = " ".join(
            [*os.environ.get("XLA_FLAGS", "").split(), *known(QUICK)]
        )
        programs.use_quick_loops()


# Compiling takes longer than any deadline, and a test that fails must fail again when it is rerun.
settings.register_profile("jaxfric", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("jaxfric")


# Every compiled program takes some thousand of the 65 530 memory maps that Linux gives a process by
# default; the next compilation after the last of them aborts the process.
MOST_MAPS = 15_000
# Counting the maps takes some 20 ms; a quicker test has compiled next to nothing.
INSTANT = 0.1
BEGAN = pytest.StashKey[float]()


def memory_maps() -> int:
    maps = Path("/proc/self/maps")
    return maps.read_bytes().count(b"\n") if maps.exists() else 0


def pytest_runtest_setup(item):
    """Note when the test began."""
    item.stash[BEGAN] = time.perf_counter()


def pytest_runtest_teardown(item, held=[0]):  # noqa: B006
    """After a test, compiled programs are let go where many have come since the last time."""
    if time.perf_counter() - item.stash.get(BEGAN, 0.0) < INSTANT:
        return
    if memory_maps() > held[0] + MOST_MAPS:
        jax.clear_caches()
        gc.collect()
        held[0] = memory_maps()


@pytest.fixture(scope="session", autouse=True)
def cached_programs(tmp_path_factory, request):
    """What one worker has compiled, the others take from jax's own cache.

    Not in a run of the slow tests, which share few programs: it gains nothing there.
    """
    if request.config.getoption("-m") == "slow":
        return
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    programs.use_cache(shared / "programs")


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder with real recordings, from JAXFRIC_DATA or `../shared/data` beside the project."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("JAXFRIC_DATA", beside))
    if not folder.is_dir():
        pytest.skip("no folder with real recordings: set JAXFRIC_DATA to one")
    return folder
