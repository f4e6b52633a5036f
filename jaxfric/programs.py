"""How functions are compiled, and jax's own cache of what was compiled."""

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, wraps
from pathlib import Path
from typing import Any

import equinox as eqx
import jax

# XLA's newer way to emit loops takes 1.3 (optimised) to 2.5 times as long to compile an
# identification and runs no quicker. Its optimisation takes five times as long as it then gains on
# 50,000 samples: what runs hundreds of times is optimised a little, and what has more samples
# wholly. One module of machine code instead of many takes an eighth off the processor's time.
_QUICK: dict[str, Any] = {
    "xla_cpu_use_fusion_emitters": False,
    "xla_cpu_parallel_codegen_split_count": 1,
}
LITTLE = 1
QUICK_SAMPLES = 2**16
# A load that is stepped along the motion is a loop of some three hundred operations on few numbers,
# whose parts XLA calls one by one: in one piece it takes two thirds of the time. (No option of a
# program: XLA reads it once. `xla_cpu_use_multi_output_fusion` beside it halves that again, and
# ends the process on some programs of the older fusions that `_QUICK` chooses.)
_WHOLE = "xla_cpu_small_while_loop_byte_threshold"


def compiled(function: Callable | None = None, *, optimised: int = 0) -> Callable:
    """A function of pytrees compiled as by `equinox.filter_jit`, quickly where samples are few.

    Called with traced arrays, or where there is more than one CPU device, it is an ordinary
    `equinox.filter_jit`, since options of the compiler belong to whole programs.

    **Arguments:** `optimised`, how much XLA optimises programs of few samples: they take longer to
    compile than to run a hundred times.
    """
    if function is None:
        return lambda function: compiled(function, optimised=optimised)

    @wraps(function)
    def exactly(*arguments):
        # A graphics processor multiplies matrices of float32 with ten bits else.
        with jax.default_matmul_precision("highest"):
            return function(*arguments)

    plain = eqx.filter_jit(exactly)

    @cache
    def quick(level: int | None) -> Callable:
        options: dict[str, Any] = {"compiler_options": quick_options(level)}
        return eqx.filter_jit(exactly, **options)

    @wraps(function)
    def call(*arguments):
        leaves = jax.tree.leaves(arguments)
        if not _alone(leaves):
            return plain(*arguments)
        return quick(optimised if _few(leaves) else None)(*arguments)

    return call


@cache
def quick_options(optimised: int | None = 0) -> dict[str, Any]:
    """Options of XLA that compile quickly what is run a few times; those that this jaxlib knows.

    `optimised`: how much, `None` for wholly.
    """
    level = {} if optimised is None else {"xla_backend_optimization_level": optimised}
    return {name: value for name, value in (_QUICK | level).items() if _known(name, value)}


@cache
def _known(name: str, value: Any) -> bool:
    with suppress(jax.errors.JaxRuntimeError):
        _nothing().compile({name: value})
        return True
    return False


@cache
def _nothing() -> Any:
    return jax.jit(lambda: 0).lower()


def _few(leaves: list) -> bool:
    return max((leaf.size for leaf in filter(eqx.is_array, leaves)), default=0) <= QUICK_SAMPLES


def _alone(leaves: list) -> bool:
    """Whether nothing is traced and there is one device, a CPU."""
    traced = any(isinstance(leaf, jax.core.Tracer) for leaf in leaves)
    return not traced and jax.default_backend() == "cpu" and jax.device_count() == 1


def use_quick_loops() -> None:
    """Let XLA compile each loop in one piece, if nothing has been computed yet.

    This adds to the environment variable XLA_FLAGS, which XLA reads before its first program: for
    all that the process compiles, on CPUs, and the processes that it starts.
    """
    given = os.environ.get("XLA_FLAGS", "")
    if _WHOLE not in given:
        os.environ["XLA_FLAGS"] = f"{given} --xla_backend_extra_options={_WHOLE}={2**30}".strip()


def use_cache(folder: str | os.PathLike | None = None) -> Path | None:
    """Let jax keep compiled programs in a folder, so that the next process need not compile them.

    This sets jax's own persistent compilation cache, for all that the process compiles from here
    on. A program in the folder is trusted as an installed one is, so it must be the user's own.

    **Arguments:** `folder`, by default the one that the command uses: that of the environment
    variable `JAXFRIC_CACHE`, else `jaxfric` in the platform's folder for caches.

    **Returns:** the folder; `None`, and nothing has changed, where `JAXFRIC_CACHE` is `off` or the
    folder cannot be made.
    """
    chosen = cache_folder() if folder is None else Path(folder)
    if chosen is None:
        return None
    try:
        chosen.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None  # every process compiles anew, and is no worse
    jax.config.update("jax_compilation_cache_dir", str(chosen))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    return chosen


def cache_folder() -> Path | None:
    """Where JAXFRIC_CACHE says, else the platform's folder for caches; `None` for "off"."""
    chosen = os.environ.get("JAXFRIC_CACHE", "")
    if chosen:
        return None if chosen == "off" else Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME")
    if not base and sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA")
    if not base and sys.platform == "darwin":
        base = str(Path.home() / "Library" / "Caches")
    return Path(base or Path.home() / ".cache") / "jaxfric"
