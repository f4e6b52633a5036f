"""`jaxfric watch`: parameters and changes as data arrive."""

import itertools
import json
import math
import sys
from argparse import Namespace
from collections.abc import Iterator

import numpy as np

from ..data.io import write_text
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
    start = feed.begin(samples, stream.has_velocity, source)
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
    moving: Iterator[feed.Moving] = itertools.chain(
        start.samples, feed.rest(samples, start.derivative)
    )
    following, last = -math.inf, math.nan
    for sample in moving:
        last = sample.time
        change = follower.add(*sample)
        told.speeds(last)
        if change:
            told.change(change)
        if following == -math.inf:
            following = sample.time + arguments.every
        if sample.time >= following:
            told.parameters(sample.time)
            following = sample.time + arguments.every
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
        f"{start.fastest:.3g} to begin with, as {source} has them."
    )
    return 0


class _Told:
    """What is printed: lines for a person, or one JSON document a line."""

    def __init__(self, follower: Follower, units: dict[str, str], plain: bool):
        self._follower, self._json, self._fastest = follower, plain, follower.fastest
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
            "units": self._units,
        }
        self._put(
            event,
            f"{source}: {start.rate:.6g} Hz, force in {force}, position in {position}\n"
            f"  {stream.served}\n"
            f"slip from {start.slowest:.3g} {speed} on, speeds up to {start.fastest:.3g} {speed}",
        )

    def speeds(self, time: float) -> None:
        """That the axis moves faster than it did at first, once for each widening of the nodes."""
        fastest = self._follower.fastest
        if fastest == self._fastest:
            return
        self._fastest = fastest
        self._put(
            {"event": "faster", "time": time, "fastest": fastest},
            f"{time:10.3f} s  faster than before: speeds up to {fastest:.3g} "
            f"{self._units['position']}/s are told apart now, and changes are compared anew",
        )

    def parameters(self, time: float) -> None:
        forward, backward = self._follower.strokes
        if not min(forward, backward):
            text = f"{time:10.3f} s  no whole stroke in both directions yet"
            self._put({"event": "waiting", "time": time}, text)
            return
        found = self._follower.solution()
        values = {name: float(v) for name, v in found.model.parameters.items()}
        shown = "  ".join(f"{n} {v:.5g} {self._spelled[n]}" for n, v in values.items())
        document = {
            "event": "parameters",
            "time": time,
            "strokes": [forward, backward],
            "settled": bool(np.asarray(found.settled)),
            "parameters": values,
        }
        self._put(document, f"{time:10.3f} s  {forward}+{backward} strokes  {shown}")

    def end(self, source: str) -> None:
        """Where the intervals are, which need more than the sums that a stream leaves."""
        if not self._json:
            say(f"Intervals and checks of a whole log: jaxfric identify {source}")

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
