"""Processes that do one task after the other, of which any may hang or die without the others."""

import gc
import math
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, NamedTuple

# So many processes in a row that end before they are ready are no accident.
STILLBORN = 3
# A process closes its pipe a moment before its exit status is there, s.
LAST_WORDS = 5.0
# Every compiled program takes some of the 65 530 memory maps that Linux gives a process by
# default; the next compilation after the last of them aborts the process.
MOST_MAPS = 20_000


class Done(NamedTuple):
    """A task, why there is nothing to show for it (`None`: it was done), and the seconds it had."""

    task: Any
    reason: str | None
    seconds: float
    died: bool = False


def work(
    tasks: Sequence[Any],
    do: Callable[[Any], object],
    jobs: int,
    limit: float = math.inf,
    prepare: Callable[[], object] | None = None,
) -> Iterator[Done]:
    """Do each task in one of several processes; yields them in the order in which they end.

    A task that is not done after `limit` seconds is given up, and its process killed; one whose
    process dies (killed for memory, aborted by a library) has a second try at the end, alone, since
    it may have been another's memory. Processes are spawned: jax does not survive a fork.

    **Arguments:** `do` and `prepare`, called first in each process, must be importable by name.

    **Raises:** `ValueError` if no process starts.
    """
    crew = _Crew(do, prepare, limit)
    try:
        again = []
        for done in crew.through(list(tasks), jobs):
            if done.died:
                again.append(done.task)
            else:
                yield done
        yield from crew.through(again, 1)
    finally:
        crew.dismiss()


_STARTING, _IDLE = object(), object()


class _Worker:
    """One process, with what it is at and since when; `task` is `_STARTING` until it is ready."""

    def __init__(self, do, prepare):
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs, do, prepare), daemon=True)
        self.process.start()
        theirs.close()  # so that the process' end is the end of the pipe
        self.task, self.since = _STARTING, time.monotonic()

    def give(self, task) -> None:
        self.task, self.since = task, time.monotonic()
        self.pipe.send(task)

    def end(self, patience: float = 0.0) -> int | None:
        """Kill it where it still runs after so many seconds; its exit code."""
        self.process.join(patience)
        self.process.kill()
        self.process.join()
        self.pipe.close()
        return self.process.exitcode


class _Crew:
    """The processes, and how each task ends."""

    def __init__(self, do, prepare, limit):
        self.how, self.limit = (do, prepare), limit
        self.workers: list[_Worker] = []
        self.stillborn = 0

    def through(self, tasks: list[Any], jobs: int) -> Iterator[Done]:
        """Every task once."""
        left, out = list(reversed(tasks)), len(tasks)
        while out:
            busy = [w for w in self.workers if w.task is not _IDLE]
            wanted = min(jobs, out)
            if not busy or (left and len(self.workers) < wanted):
                while len(self.workers) < wanted:
                    self.workers.append(_hire(*self.how))
            for worker in self.workers[:wanted]:
                if worker.task is _IDLE and left:
                    self._give(worker, left)
            for done in self._listen():
                out -= 1
                yield done

    def _give(self, worker: _Worker, left: list[Any]) -> None:
        try:
            worker.give(left[-1])
        except OSError:  # it died while it had nothing to do
            self._lose(worker)
        else:
            left.pop()

    def _listen(self) -> list[Done]:
        """What has ended by the time that anything ends."""
        found: list[Done] = []
        busy = {w.pipe: w for w in self.workers if w.task is not _IDLE}
        if not busy:
            return found
        ends = [w.since + self.limit for w in busy.values() if w.task is not _STARTING]
        pause = max(min(ends, default=math.inf) - time.monotonic(), 0.0)
        for pipe in wait(list(busy), None if pause == math.inf else pause):
            found += self._heard(busy.pop(pipe))
        for worker in busy.values():
            spent = time.monotonic() - worker.since
            if worker.task is not _STARTING and spent >= self.limit:
                self._lose(worker)
                found.append(Done(worker.task, f"no answer within {self.limit:g} s", spent))
        return found

    def _heard(self, worker: _Worker) -> list[Done]:
        """A process is ready, or has done its task, or is no more."""
        task, spent = worker.task, time.monotonic() - worker.since
        try:
            worker.pipe.recv()
        except (EOFError, OSError):
            code = self._lose(worker, LAST_WORDS)
            if task is _STARTING:
                self._bury(code)
                return []
            return [Done(task, f"the process died{_cause(code)}", spent, died=True)]
        worker.task, self.stillborn = _IDLE, 0
        return [] if task is _STARTING else [Done(task, None, spent)]

    def _bury(self, code: int | None) -> None:
        self.stillborn += 1
        if self.stillborn == STILLBORN:
            raise ValueError(
                f"{STILLBORN} processes in a row ended before they were ready{_cause(code)}; what "
                "they printed says why. Called from a script, this must stand under "
                'if __name__ == "__main__".'
            )

    def _lose(self, worker: _Worker, patience: float = 0.0) -> int | None:
        self.workers.remove(worker)
        return worker.end(patience)

    def dismiss(self) -> None:
        """End all."""
        while self.workers:
            self._lose(self.workers[-1])


def _hire(do, prepare) -> _Worker:
    # Read when a process imports numpy: many small matrices, where threads wait for each other.
    before = os.environ.get("OPENBLAS_NUM_THREADS")
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    try:
        return _Worker(do, prepare)
    finally:
        if before is None:
            del os.environ["OPENBLAS_NUM_THREADS"]
        else:
            os.environ["OPENBLAS_NUM_THREADS"] = before


def _cause(code: int | None) -> str:
    """An exit code in words."""
    if code is None or code >= 0:
        return f" with status {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f" of {name}" + (" (short of memory?)" if name == "SIGKILL" else "")


def _serve(pipe: Connection, do, prepare) -> None:
    """In a process: tasks from the pipe, until it closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who started it ends it
    if prepare is not None:
        prepare()
    try:
        pipe.send(True)
        while True:
            do(pipe.recv())
            pipe.send(True)
            _let_go()
    except (EOFError, BrokenPipeError):  # the starter is no more
        return


def _let_go() -> None:
    """Compiled programs, where there are too many."""
    maps = Path("/proc/self/maps")
    if maps.exists() and len(maps.read_bytes().splitlines()) > MOST_MAPS:
        import jax

        jax.clear_caches()
        gc.collect()
