"""Work beside other work: compiling and arithmetic on arrays leave Python to another thread."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from threading import Lock
from typing import Any, TypeVar

import jax

_Item = TypeVar("_Item")
_Made = TypeVar("_Made")

# What is waited for goes first come, first served, so that a task may wait for an earlier one. Two
# threads use both cores of a small machine; of more, Python itself lets only one go on at a time.
_pool = ThreadPoolExecutor(2, "jaxfric")
# Whoever is in [`single`][], and what the first of them has changed.
_lock = Lock()
_inside = 0
_limits: Any = None


@contextmanager
def single() -> Iterator[None]:
    """Inside, BLAS starts no threads of its own: of small matrices they wait more than they work.

    Needs threadpoolctl (extra: `threads`); without it nothing changes but the time.
    """
    global _inside, _limits
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        yield
        return
    with _lock:
        if not _inside:
            _limits = threadpool_limits(1, "blas")
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if not _inside:
                _limits.restore_original_limits()


def begin(function: Callable[[_Item], _Made], item: _Item) -> "Future[_Made]":
    """Start a call that the caller does not wait for yet."""
    return _pool.submit(_double, function, item)


def each(function: Callable[[_Item], _Made], items: Iterable[_Item]) -> list[_Made]:
    """A function of each item, of several at once; not from inside such a function."""
    started = [begin(function, item) for item in items]
    try:
        return [made.result() for made in started]
    finally:
        for made in started:
            made.cancel()  # what has not begun when one fails


def _double(function: Callable[[_Item], _Made], item: _Item) -> _Made:
    """A call in double precision, which holds for one thread only."""
    with jax.enable_x64(True):
        return function(item)
