"""Compiled programs kept in a folder, so that the next process neither traces nor compiles them.

jax's own compilation cache spares the compiling; but before it can look there it traces and lowers
the whole program again, which for an identification takes several times as long as running it.
"""

import hashlib
import os
import pickle
import platform
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import cache, wraps
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

import equinox as eqx
import jax

# Bytes of programs in the folder, from 0.1 MB for a term's columns to 2 MB for an identification;
# of more the one that was not used for longest goes.
MOST = 128 * 2**20
# XLA's newer way to emit loops takes 1.3 (optimised) to 2.5 times as long to compile an
# identification and runs no quicker. Its optimisation takes five times as long as it then gains on
# 50,000 samples: what runs hundreds of times is optimised a little, and what has more samples
# wholly.
_QUICK: dict[str, Any] = {"xla_cpu_use_fusion_emitters": False}
LITTLE = 1
QUICK_SAMPLES = 2**16


class _Store(NamedTuple):
    """A folder of programs, and what has been taken from it or put there."""

    folder: Path
    at_hand: dict[Any, list["_Program"]]


_store: _Store | None = None
# jax's threshold before each thread that is in [`_unshared`][].
_thresholds: list[float] = []
_lock = Lock()


@contextmanager
def kept_in(folder: Path | None) -> Iterator[None]:
    """Inside, functions marked by [`kept`][] take their programs from a folder and put them there.

    The folder must be the user's own: a program in it is trusted as an installed one is. `None`
    changes nothing.
    """
    global _store
    before, _store = _store, None if folder is None else _Store(folder, {})
    try:
        yield
    finally:
        _store = before


def kept(*steps: Callable, optimised: int = 0) -> Callable:
    """A function of pytrees compiled as by `equinox.filter_jit`, and kept where [`kept_in`][] says.

    Of several steps each takes what the one before returned, then the arguments; while the
    program of one compiles, the next is traced, and compiles beside it. `optimised`: how much XLA
    optimises programs of few samples: they take longer to compile than to run a hundred times.

    Only calls with concrete arrays on a single CPU device are kept; any other is as without.
    """
    plain = [eqx.filter_jit(step) for step in steps]

    @cache
    def quick(level):
        options = quick_options(level)
        return [eqx.filter_jit(step, compiler_options=options) for step in steps]

    @wraps(steps[-1])
    def call(*arguments):
        if not _simple(arguments):
            return _in_turn(plain, arguments)
        if _store is not None:
            return _in_turn(_programs(steps, arguments, optimised, _store), arguments)
        return _in_turn(quick(optimised if _few(arguments) else None), arguments)

    return call


def _in_turn(steps, arguments):
    before: tuple = ()
    for step in steps:
        before = (step(*before, *arguments),)
    return before[0]


@cache
def quick_options(optimised: int | None = 0) -> dict[str, Any]:
    """Options of XLA that compile quickly what is run a few times; those that this jaxlib knows.

    `optimised`: how much, `None` for wholly.
    """
    level = {} if optimised is None else {"xla_backend_optimization_level": optimised}
    options = _QUICK | level

    def known(name: str) -> bool:
        with suppress(jax.errors.JaxRuntimeError):
            jax.jit(lambda: 0).lower().compile({name: options[name]})
            return True
        return False

    return {name: value for name, value in options.items() if known(name)}


def _few(arguments) -> bool:
    return max((leaf.size for leaf in _arrays(arguments)), default=0) <= QUICK_SAMPLES


def _simple(arguments) -> bool:
    traced = any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(arguments))
    return not traced and jax.default_backend() == "cpu" and jax.device_count() == 1


def _programs(steps, arguments, optimised: int, store: _Store) -> list["_Program"]:
    """The steps' programs, from the folder or made now."""
    key = steps, _form(arguments)
    if key not in store.at_hand:
        found: list[_Program] = []
        with _unshared(), ThreadPoolExecutor() as pool:
            for step in steps:
                before = tuple(program.template for program in found[-1:])
                given = (*before, *arguments)
                found.append(_Program(step, given, optimised, store.folder, pool))
        for program in found:
            program.save()
        store.at_hand[key] = found
    return store.at_hand[key]


class _Program:
    """A function of pytrees of given shapes as a program, out of a folder or soon compiled.

    `template`: what it returns, with shapes in place of arrays.
    """

    def __init__(self, function, arguments, optimised: int, folder: Path, pool: Executor):
        name = f"{function.__module__}.{function.__qualname__}"
        self.path = folder / f"{name}-{_key(name, _form(arguments))}.program"
        found = _load(self.path, len(_arrays(arguments)))
        self.known = found is not None
        if found is None:
            lowered, self.template = _lower(function, arguments)
            options = quick_options(optimised if _few(arguments) else None)
            self.binary = pool.submit(lowered.compile, options)
        else:
            binary, self.template = found
            self.binary = Future()
            self.binary.set_result(binary)

    def __call__(self, *arguments):
        values = self.binary.result()(_arrays(arguments))
        return jax.tree.unflatten(jax.tree.structure(self.template), values)

    def save(self) -> None:
        """Put a program that was not there into the folder."""
        if not self.known:
            _save(self.path, self.binary.result(), self.template)


def _is_array(leaf) -> bool:
    return eqx.is_array(leaf) or isinstance(leaf, jax.ShapeDtypeStruct)


def _arrays(arguments) -> list:
    return [leaf for leaf in jax.tree.leaves(arguments) if _is_array(leaf)]


def _form(arguments) -> tuple:
    """All of the arguments but the arrays' values."""
    leaves, tree = jax.tree.flatten(arguments)
    return tree, tuple((x.shape, str(x.dtype)) if _is_array(x) else x for x in leaves)


def _key(name: str, form: tuple) -> str:
    """What a program depends on: its source, its static arguments, shapes, jax, and the machine."""
    settings = (jax.config.values["jax_enable_x64"], os.environ.get("XLA_FLAGS", ""))
    facts = (name, *map(repr, form), settings, _source(), _host())
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:32]


@cache
def _source() -> tuple:
    """The library's files as make would judge them, by size and time."""
    top = Path(__file__).parent
    files = sorted(top.rglob("*.py"))
    return tuple((str(f.relative_to(top)), f.stat().st_size, f.stat().st_mtime_ns) for f in files)


@cache
def _host() -> tuple[str, ...]:
    """Versions, and the processor with its instruction sets: a home folder can be shared."""
    import jaxlib

    facts = [platform.python_version(), jax.__version__, jaxlib.__version__]
    facts += [platform.system(), platform.machine(), platform.processor()]
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        kinds = ("model name", "flags", "Features", "CPU part")
        facts += sorted({line for line in lines if line.startswith(kinds)})
    return tuple(facts)


def _lower(function, arguments):
    """The program from arrays to arrays before it is compiled, and its output's template."""
    leaves, tree = jax.tree.flatten(arguments)
    places = [i for i, leaf in enumerate(leaves) if _is_array(leaf)]
    structure: list[Any] = []

    def flat(arrays):
        traced = list(leaves)
        for i, array in zip(places, arrays, strict=True):
            traced[i] = array
        result, made = jax.tree.flatten(function(*jax.tree.unflatten(tree, traced)))
        structure.append(made)
        return result

    lowered = jax.jit(flat).lower([leaves[i] for i in places])
    shapes = [jax.ShapeDtypeStruct(info.shape, info.dtype) for info in lowered.out_info]
    return lowered, jax.tree.unflatten(structure[-1], shapes)


@contextmanager
def _unshared() -> Iterator[None]:
    """Inside, jax's own cache takes no program: one out of it cannot be written a second time."""
    name = "jax_persistent_cache_min_compile_time_secs"
    with _lock:
        _thresholds.append(jax.config.values[name])
        jax.config.update(name, float("inf"))
    try:
        yield
    finally:
        with _lock:
            before = _thresholds.pop()
            if not _thresholds:
                jax.config.update(name, before)


def _load(path: Path, count: int):
    """A kept program and the template of its output, or `None` if there is none that works."""
    from jax.experimental import serialize_executable

    # Whatever is wrong with the file, compiling again is right.
    with suppress(Exception):
        binary, template = pickle.loads(path.read_bytes())
        inputs = jax.tree.structure((([0] * count,), {}))
        outputs = jax.tree.structure([0] * len(jax.tree.leaves(template)))
        program = serialize_executable.deserialize_and_load(binary, inputs, outputs)
        os.utime(path)
        return program, template
    return None


def _save(path: Path, program, template) -> None:
    from jax.experimental import serialize_executable

    # A full or read-only disk, a backend that cannot: slower next time, and no worse.
    with suppress(Exception):
        binary = serialize_executable.serialize(program)[0]
        path.parent.mkdir(parents=True, exist_ok=True)
        # Whole or not at all: another process may be reading, or writing the same.
        whole = path.with_suffix(f".{os.getpid()}")
        whole.write_bytes(pickle.dumps((binary, template)))
        whole.replace(path)
        files = sorted(path.parent.glob("*.program"), key=lambda f: -f.stat().st_mtime)
        room = MOST
        for file in files:
            room -= file.stat().st_size
            if room < 0:
                file.unlink()
