"""Samples from lines of text as they come, and their velocity with a fixed delay."""

import csv
import time as clock
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple, TextIO

import numpy as np

from .. import checks, signals
from ..data import columns as names
from ..data.per_second import per_second
from ..data.recording import Recording
from .moments import ABOVE

# Samples that tell the noise, the fastest motion and so the slowest slip.
HEAD = 2000
# Fewer say nothing of a motion.
LEAST = 100
# Between two looks at a file that grows, s.
LOOK = 0.2


class Sample(NamedTuple):
    """Time, s; position, m, and velocity, m/s, NaN where not read; force, N."""

    time: float
    position: float
    velocity: float
    force: float


class Moving(NamedTuple):
    """A sample with velocity: time, s, velocity, m/s, force, N."""

    time: float
    velocity: float
    force: float


def growing(file: TextIO, once: bool) -> Iterator[str]:
    """The lines of a file; without `once`, waiting for more at its end."""
    part = ""
    while True:
        line = file.readline()
        part += line
        if part.endswith("\n"):
            yield part
            part = ""
        elif not line:
            if once:
                if part:
                    yield part
                return
            clock.sleep(LOOK)


class Clock:
    """Steps of a stream's clock that do not go forward.

    `stalled`, how many in all; `first`, the row and the times, s, of the first one since
    [`Clock.told`][].
    """

    def __init__(self, source: str):
        self._source, self._last = source, float("nan")
        self._steps, self._wrong, self._row = 0, 0, 0
        self.stalled = 0
        self.first: tuple[int, float, float] | None = None

    def add(self, row: int, time: float) -> None:
        """The time of a row; raises `ValueError` as [`check`][] does after each [`HEAD`][] rows."""
        last, self._last = self._last, time
        if not np.isfinite(time - last):
            return
        self._steps += 1
        if time <= last:
            self._row = row if self._wrong == 0 else self._row
            self._wrong += 1
            self.stalled += 1
            self.first = self.first or (row, last, time)
        if self._steps == HEAD:
            self.check()
            self._steps = self._wrong = 0

    def check(self) -> None:
        """Raises `ValueError` unless most stamps are later than the one before."""
        if self._steps and not self._wrong <= 0.5 * self._steps:
            raise ValueError(
                f"{self._source}: row {self._row}: time does not increase, here and at "
                f"{self._wrong - 1} of the next {self._steps - 1} steps, so most samples have no "
                "time of their own. Give another column: --columns time=NAME, or log the time with "
                "more digits."
            )

    def told(self) -> tuple[int, float, float] | None:
        """The first step since the last call that did not go forward."""
        first, self.first = self.first, None
        return first


class Feed:
    """Samples from the lines of a CSV whose first line names the columns.

    **Arguments:** `lines`; `columns`, role to column name, and `scale`, factors by role, as for
    [`read`][jaxfric.read]; `source`, for messages.

    **Raises:** `ValueError` for columns that are not recognised.
    """

    def __init__(
        self,
        lines: Iterable[str],
        columns: Mapping[str, str | None] | None = None,
        scale: Mapping[str, float] | None = None,
        units: Mapping[str, str] | None = None,
        source: str = "standard input",
    ):
        self._lines = (line for line in lines if line.strip() and not line.startswith("#"))
        head = next(self._lines, None)
        if head is None:
            raise ValueError(f"{source}: no line came; the first one names the columns.")
        self._delimiter = max(",;\t|", key=head.count)
        header = [cell.strip() for cell in self._split(head)]
        chosen, scale = names.assign(header, columns, source), dict(scale or {})
        implied, named = per_second(chosen, scale, units or {}, source)
        self.units = names.units(chosen, scale, named)
        doubts = names.unknown_units(chosen, scale, units) + names.commanded(chosen, columns)
        scale = implied | scale
        self.served = " ".join([names.served(chosen, scale, self.units, header), *doubts])
        self._source, self._width = source, len(header)
        self._index = {
            role: (header.index(chosen[role]), scale.get(role, 1.0))
            for role in ("time", "position", "velocity", "force")
            if role in chosen
        }
        self.has_velocity = "velocity" in self._index
        self.clock = Clock(source)

    def _split(self, line: str) -> list[str]:
        if self._delimiter not in line:
            return line.split()
        return next(csv.reader([line.strip()], delimiter=self._delimiter), [])

    def __iter__(self) -> Iterator[Sample]:
        for number, line in enumerate(self._lines, 2):
            cells = self._split(line)
            if len(cells) != self._width:
                raise ValueError(
                    f"{self._source}: row {number} has {len(cells)} cells, the header has "
                    f"{self._width}. A line holds one sample."
                )
            sample = Sample(*(self._value(role, cells, number) for role in Sample._fields))
            self.clock.add(number, sample.time)
            yield sample
        self.clock.check()

    def _value(self, role: str, cells: list[str], number: int) -> float:
        if role not in self._index:
            return float("nan")
        place, factor = self._index[role]
        try:
            return factor * float(cells[place] or "nan")
        except ValueError:
            raise ValueError(
                f"{self._source}: row {number} has {cells[place]!r} as its {role}, which is no "
                "number with a decimal point."
            ) from None


class Derivative:
    """The velocity of a sample from the positions to both sides of it: late, without phase lag.

    The slope of a local parabola with tapered weights, as `signals.local_quadratic` has it on a
    steady clock. **Arguments:** `half_width`, samples to each side; `interval`, s.
    """

    def __init__(self, half_width: int, interval: float):
        offset = np.arange(-half_width, half_width + 1)
        weight = np.asarray(signals.kernel(offset / (half_width + 0.5))) * offset
        self._weights = (weight / (weight @ offset) / interval).tolist()
        self._near: deque[Sample] = deque(maxlen=2 * half_width + 1)
        self._middle, self._longest = half_width, 2 * half_width * interval * 1.5

    def add(self, sample: Sample) -> Moving | None:
        """The sample in the middle of the last ones, with its velocity; `None` across a gap."""
        near = self._near
        near.append(sample)
        if len(near) < near.maxlen or not 0 < near[-1].time - near[0].time < self._longest:
            return None
        slope = sum(w * s.position for w, s in zip(self._weights, near, strict=True))
        middle = near[self._middle]
        return Moving(middle.time, slope, middle.force)


class Start(NamedTuple):
    """What the first samples tell: the samples themselves, with velocity; slowest and fastest
    speed told apart, m/s, the latter with room for a faster motion; the derivative that goes on, if
    there is no velocity column; the sample rate, Hz; the severe remarks on the columns, beside
    which no figure is right.
    """

    samples: list[Moving]
    slowest: float
    fastest: float
    derivative: Derivative | None
    rate: float
    remarks: tuple[checks.Remark, ...] = ()

    @property
    def seen(self) -> float:
        """The fastest speed of the first samples, m/s."""
        return self.fastest / ABOVE


def begin(
    samples: Iterator[Sample],
    has_velocity: bool,
    source: str,
    units: Mapping[str, str] | None = None,
) -> Start:
    """The start of a stream from its first [`HEAD`][] samples.

    **Raises:** `ValueError` for too few samples or no motion.
    """
    head = [s for s, _ in zip(samples, range(HEAD), strict=False)]
    if len(head) < LEAST:
        raise ValueError(f"{source}: {len(head)} samples came; {LEAST} are needed to begin.")
    time, position, velocity, force = (np.array(x, float) for x in zip(*head, strict=True))
    found = _remarks(time, position, velocity, force, units or {})
    derivative = None
    if not has_velocity:
        log = Recording(time, force, position=position)
        width = max(2, int(signals.choose_half_width(log)))
        derivative = Derivative(width, signals.host_interval(log))
        moving = [m for m in map(derivative.add, head) if m is not None]
    else:
        moving = [Moving(s.time, s.velocity, s.force) for s in head]
    if len(moving) < LEAST:
        raise ValueError(f"{source}: the clock has gaps or turns back within the first samples.")
    time, velocity, force = (np.array(x, float) for x in zip(*moving, strict=True))
    log = Recording(time, force, velocity=velocity)
    limits = signals.scales(log)
    slowest, fastest = float(limits.slowest), float(np.nanmax(np.abs(velocity)))
    if not 0 < slowest < fastest:
        raise ValueError(
            f"{source}: the first {len(head)} samples show no motion beyond the noise. Begin when "
            "the axis moves."
        )
    rate = 1 / float(signals.host_interval(log))
    return Start(moving, slowest, ABOVE * fastest, derivative, rate, found)


def _remarks(time, position, velocity, force, units) -> tuple[checks.Remark, ...]:
    """The severe ones of [`checks.inspect`][]; what is rare in the head may come later."""
    signals_read = {"position": position, "velocity": velocity}
    known = {k: v for k, v in signals_read.items() if np.isfinite(v).any()}
    log = Recording(time, force, units=units, **known)
    return tuple(remark for remark in checks.inspect(log) if remark.severe)


def rest(samples: Iterator[Sample], derivative: Derivative | None) -> Iterator[Moving]:
    """The samples after the start, each with its velocity."""
    for sample in samples:
        if derivative is None:
            yield Moving(sample.time, sample.velocity, sample.force)
        elif (moving := derivative.add(sample)) is not None:
            yield moving
