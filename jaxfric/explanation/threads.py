"""Work beside other work: compiling and arithmetic on arrays leave Python to another thread."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from threading import Lock
from typing import Any, TypeVar

import jax

_Item = TypeVar("_Item")
_Made = TypeVar("_Made")

# Both cores of a small machine; of more threads, Python itself lets only one go on at a time.
THREADS = 2
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


def begin(function: Callable[[_Item], _Made], items: Iterable[_Item]) -> "list[Future[_Made]]":
    """Start a function of each item, of several at once, that the caller does not wait for yet."""
    pool = ThreadPoolExecutor(THREADS, "jaxfric")
    started = [pool.submit(_double, function, item) for item in items]
    pool.shutdown(wait=False)  # its threads end with the last item
    return started


def each(function: Callable[[_Item], _Made], items: Iterable[_Item]) -> list[_Made]:
    """A function of each item, of several at once."""
    started = begin(function, items)
    try:
        return [made.result() for made in started]
    finally:
        for made in started:
            made.cancel()  # what has not begun when one fails


def _double(function: Callable[[_Item], _Made], item: _Item) -> _Made:
    """A call in double precision, which holds for one thread only."""
    with jax.enable_x64(True):
        return function(item)
