"""`jaxfric watch`: parameters and changes as data arrive."""

import itertools
import json
import math
import sys
from argparse import Namespace
from collections.abc import Iterator

import numpy as np

from .. import checks
from ..data.io import write_text
from ..identification.identified import Result
from ..identification.uncertainty import Estimate
from ..online import Change, Follower, c_source, feed
from ..units import spell
from .messages import say


def run(arguments: Namespace) -> int:
    """Follow a growing file or standard input until it ends or is interrupted."""
    if arguments.file == "-":
        return _follow(sys.stdin, "standard input", arguments)
    with open(arguments.file, encoding="utf-8-sig") as file:
        try:
            return _follow(feed.growing(file, arguments.once), arguments.file, arguments)
        except UnicodeDecodeError as error:
            raise ValueError(
                f"{arguments.file}: byte {error.start} is no text. watch follows CSV line by line; "
                "a log of another format that is complete: jaxfric identify."
            ) from error


def _follow(lines, source: str, arguments: Namespace) -> int:
    stream = feed.Feed(lines, arguments.columns, arguments.scale, arguments.units, source)
    samples = iter(stream)
    start = feed.begin(samples, stream.has_velocity, source, stream.units)
    if arguments.c:
        return _generated(start, source, arguments)
    follower = Follower(
        arguments.model,
        slowest=start.slowest,
        fastest=start.fastest,
        keep=arguments.keep,
        window=arguments.window,
        false_alarms=arguments.false_alarms,
    )
    told = _Told(follower, stream.units, arguments.json_lines)
    told.begin(start, stream, source)
    for remark in start.remarks:
        told.remark(*remark)
    moving: Iterator[feed.Moving] = itertools.chain(
        start.samples, feed.rest(samples, start.derivative)
    )
    following, last = -math.inf, math.nan
    for sample in moving:
        last = sample.time
        change = follower.add(*sample)
        told.speeds(last, sample.velocity)
        if change:
            told.change(change)
        if following == -math.inf:
            following = sample.time + arguments.every
        if sample.time >= following:
            told.clock(sample.time, stream.clock)
            told.parameters(sample.time)
            following = sample.time + arguments.every
    told.speeds(last, 0.0)
    told.clock(last, stream.clock)
    told.parameters(last)
    if arguments.once:
        told.end(source)
    return 0


def _generated(start: feed.Start, source: str, arguments: Namespace) -> int:
    """The update for the speeds of the stream's beginning, as C."""
    if arguments.model != "coulomb-viscous" or arguments.window:
        raise ValueError(
            "--c writes Coulomb and viscous friction that fades (--keep): leave out --model and "
            "--window."
        )
    options = {"keep": arguments.keep, "false_alarms": arguments.false_alarms}
    write_text(arguments.c, c_source(start.slowest, start.fastest, **options))
    say(
        f"{arguments.c}: C99 for slip from {start.slowest:.3g} on and speeds up to "
        f"{start.fastest:.3g} to begin with; {source} begins with up to {start.seen:.3g}."
    )
    return 0


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


class _Told:
    """What is printed: lines for a person, or one JSON document a line."""

    def __init__(self, follower: Follower, units: dict[str, str], plain: bool):
        self._follower, self._json, self._fastest = follower, plain, follower.fastest
        self._remarked: set[str] = set()
        self._from: tuple[int, int] | None = None
        self._units = {"force": "N", "position": "m"} | units
        term = follower.term
        self._spelled = {
            p.name: spell(p.dimension, self._units) for p in (*term.affine, *term.nonlinear)
        }

    def _put(self, document: dict, text: str) -> None:
        if self._json:
            clean = {k: None if isinstance(v, float) and not math.isfinite(v) else v
                     for k, v in document.items()}  # fmt: skip
            print(json.dumps(clean, ensure_ascii=False), flush=True)
        else:
            say(text)
            sys.stdout.flush()

    def begin(self, start: feed.Start, stream: feed.Feed, source: str) -> None:
        position, force = self._units["position"], self._units["force"]
        speed = f"{position}/s"
        event = {
            "event": "start",
            "source": source,
            "sample_rate": start.rate,
            "slowest": start.slowest,
            "fastest": start.fastest,
            "fastest_seen": start.seen,
            "units": self._units,
        }
        self._put(
            event,
            f"{source}: {start.rate:.6g} Hz, force in {force}, position in {position}\n"
            f"  {stream.served}\n"
            f"slip from {start.slowest:.3g} {speed} on, speeds up to {start.seen:.3g} {speed} so "
            f"far; up to {start.fastest:.3g} {speed} are told apart",
        )

    def speeds(self, time: float, velocity: float) -> None:
        """That the axis moves faster than it did at first, once it is slower again."""
        fastest = self._follower.fastest
        if fastest == self._fastest or not abs(velocity) <= self._fastest:
            return
        self._fastest = fastest
        self._put(
            {"event": "faster", "time": time, "fastest": fastest},
            f"{time:10.3f} s  faster than before: speeds up to {fastest:.3g} "
            f"{self._units['position']}/s are told apart now",
        )

    def clock(self, time: float, clock: feed.Clock) -> None:
        """Where the clock did not go forward, the first place since this was last called."""
        if (first := clock.told()) is None:
            return
        row, before, after = first
        document = {"event": "clock", "time": time, "row": row, "from": before, "to": after,
                    "steps": clock.stalled}  # fmt: skip
        self._put(
            document,
            f"{time:10.3f} s  row {row}: the clock goes from {before:.6g} to {after:.6g} s; "
            f"{clock.stalled} such steps so far, at each of which a stroke is left out",
        )

    def remark(self, name: str, text: str, severe: bool, time: float | None = None) -> None:
        """A fault of the columns or of what they give, once."""
        if name in self._remarked:
            return
        self._remarked.add(name)
        when = "" if time is None else f"{time:10.3f} s  "
        self._put(
            {"event": "remark", "time": time, "name": name, "severe": severe, "text": text},
            f"{when}Warning: {text}",
        )

    def parameters(self, time: float) -> None:
        forward, backward = self._follower.strokes
        if not min(forward, backward):
            text = f"{time:10.3f} s  no whole stroke in both directions yet"
            self._put({"event": "waiting", "time": time}, text)
            return
        found, known = self._follower.solution(), self._follower.assess()
        shown = "  ".join(self._parameter(n, e) for n, e in known.parameters.items())
        document = {
            "event": "parameters",
            "time": time,
            "strokes": [forward, backward],
            "settled": bool(np.asarray(found.settled)),
            "parameters": {n: float(e.value) for n, e in known.parameters.items()},
            "standard_errors": {
                n: _finite(float(e.standard_error)) for n, e in known.parameters.items()
            },
            "learning": self._follower.learning,
            "changes_from": list(self._follower.changes_from),
        }
        text = f"{time:10.3f} s  {forward}+{backward} strokes  {shown}"
        self._put(document, text + self._learning())
        for remark in checks.remarks(checks.places(known.faults), self._units):
            self.remark(remark.name, remark.text, remark.severe, time)
        if not known.passive:
            text = str(Result[Result.not_passive])
            self.remark("not_passive", text, True, time)

    def _parameter(self, name: str, found: Estimate) -> str:
        """A value with half its 95 % interval, or that it is not known yet."""
        half = float(found.half_width())
        if not math.isfinite(half):
            return f"{name} not known yet"
        return f"{name} {float(found.value):.5g} ± {half:.2g} {self._spelled[name]}"

    def _learning(self) -> str:
        """From when on changes are told, where that is new."""
        before, self._from = self._from, self._follower.changes_from
        if not self._follower.learning or before == self._from:
            return ""
        large, small = self._from
        return (
            f"\n              learning: large changes are told from stroke {large} of a direction "
            f"on, small ones from stroke {small} on"
        )

    def end(self, source: str) -> None:
        """What finds more than the sums that a stream leaves."""
        if not self._json:
            say(
                f"± is half the 95 % interval. All checks of a whole log: jaxfric identify {source}"
            )

    def change(self, change: Change) -> None:
        way = "forward" if change.direction > 0 else "backward"
        more = "more" if change.excess > 0 else "less"
        share = f" ({abs(change.share):.1%})" if math.isfinite(change.share) else ""
        size = f"{abs(change.excess):.3g} {self._units['force']}{share}"
        self._put(
            {"event": "change", **change._asdict()},
            f"{change.time:10.3f} s  CHANGE: {size} {more} friction {way}, for "
            f"{change.strokes} strokes; identifying anew",
        )
        self._from = None
