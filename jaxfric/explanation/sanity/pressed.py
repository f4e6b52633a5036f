"""A hard end stop in a log by itself: there the axis stands, pressed harder than friction holds.

Rows lie in slip, and no row shows what is pressed at rest. The balance of force and momentum over a
kernel holds at rest too: what the baseline does not need there is friction, or something else.
"""

import dataclasses
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from ... import signals
from ...data.recording import Recording
from ...identification.uncertainty import Estimate
from ...models import Model
from ...terms import KNOWN
from ...terms.base import summands
from ...terms.presliding import AbstractMemory
from .. import parameters as spelled, verification
from ..evaluation import PAIR, evaluate
from ..evidence import Evidence
from ..motion import Motion
from ..nodes import stride
from ..problem import Problem, with_holdout
from ..regression import Fit
from .contact import END, HOLDS, STEEP, Contact

# What is wrong with the baseline where a stop is looked for shows in slip beside it. Between a row
# and the end it may grow: twice the most that is left there is what the baseline does not know.
UNKNOWN = 2.0
# Kernels at rest under more than friction holds: one may be of a single odd sample.
LEAST = 2
# The speed, in parts of the slowest that is told from rest, at which friction is that of rest.
AT_REST = 1e-3
# Speeds between which dry friction is asked for: of the usual range, a hundredfold, each is twice
# the last, as over a bump's flank (`checks/misfit.py`).
SPEEDS = 8


class Stop(NamedTuple):
    """A stop that a log shows, and what another log says of it.

    `contact`: where it is; `yields`: by how much it gives way, m; `visits`: how often the axis
    stands there; `stiffness`: its least, N/m; `confirmed`: whether the held-out recording is
    stopped there too, `None` where it does not come as far.
    """

    contact: Contact
    yields: float
    visits: int
    stiffness: float
    confirmed: bool | None = None


class Stopped(NamedTuple):
    """The stops of a log; the baseline with them, and what it leaves of the force through the
    kernel, on the held-out recording too; `leans`: whether the axis rests at an end under more than
    slip friction, where a stop may be that is not told from friction at rest.
    """

    stops: list[Stop]
    baseline: Model
    filtered: float
    filtered_held: float | None
    leans: bool

    def without(self, recording: Recording) -> Recording:
        """A recording without the samples in contact and beside it."""
        for stop in self.stops:
            recording = stop.contact.without(recording)
        return recording


class _Standing(NamedTuple):
    """The balance in every kernel, `(R,)`, or of the slip rows, `(J,)`.

    `time` of the middle, s; `position`, m, and `velocity` there, m/s; `force`, N; `beyond`: the
    force beyond inertia and what does not depend on the direction, N; `slip`: the friction of the
    slowest slip, or the dry one of a faster one where that is more, and `holds`: the most that
    friction may hold, N; `rests`: whether the axis rests in all of it.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    force: np.ndarray
    beyond: np.ndarray
    slip: np.ndarray
    holds: np.ndarray
    rests: np.ndarray

    def pressed(self, side: float) -> np.ndarray:
        """How hard the axis is pressed to a side at rest, N, `(R,)`; elsewhere none.

        The actuator itself has to press: a closed brake holds a weight without it.
        """
        return np.where(self.rests, np.minimum(side * self.force, side * self.beyond), -np.inf)


def stopped(motion: Motion, problem: Problem, held: Motion | None = None) -> Stopped | None:
    """The hard stops of a log, by its baseline; `None` where none can be looked for.

    `held`: the held-out recording, which confirms them or not.
    """
    rows = problem.evidence
    if not rows.located or not _plain(problem):
        return None
    seen = _standing(rows, problem.base)
    there = None if held is None else with_holdout(problem, held).held
    found, leans = [], False
    for side in (1.0, -1.0):
        stop, near = _at_end(motion.recording, problem, seen, side)
        leans |= near
        if stop is not None:
            found.append(_confirmed(stop, held, there, problem, side))
    baseline = spelled.model(problem.base, motion.recording.units, problem.delay)
    here = verification.error(problem.base, rows)
    elsewhere = None if there is None else verification.error(problem.base, there)
    return Stopped(found, baseline, here, elsewhere, leans)


def _plain(problem: Problem) -> bool:
    """Whether the force of the baseline is a function of the motion at an instant, both ways."""
    parts = summands(problem.structure)
    known = any(name.startswith(KNOWN) for part in parts for name in part.coordinates)
    memory = any(isinstance(part, AbstractMemory) for part in parts)
    return problem.evidence.both_ways and not known and not memory


def _standing(rows: Evidence, base: Fit) -> _Standing:
    """The balance of force and momentum in all kernels of a log, at rest too."""
    count, step = len(rows.average), stride(rows.half)
    centre = rows.half + step * np.arange(count)
    run = np.asarray(rows.motion.segment)
    whole = run[centre - rows.half] == run[np.minimum(centre + rows.half, len(run) - 1)]
    every = rows._replace(rows=np.arange(count))
    speed = np.asarray(rows.motion.velocity, float)
    slowest = rows.limits.slowest
    fast = (np.abs(speed) > slowest).astype(float)
    around = np.lib.stride_tricks.sliding_window_view(fast, 2 * rows.half + 1)
    rests = whole & (around[centre - rows.half].max(axis=1) == 0)

    def at_speed(velocity: float) -> np.ndarray:
        steady = dataclasses.replace(rows.motion, velocity=jnp.full_like(speed, velocity))
        return every.project(_force(base, steady)[0])

    def friction(speed: float) -> np.ndarray:
        return (at_speed(speed) - at_speed(-speed)) / 2

    # A curve that falls towards rest, as one bent to what the baseline lacks, is none of an axis:
    # friction holds at least what is dry of it in slip at any speed, a chord's value at zero.
    speeds = np.geomspace(slowest, max(rows.limits.fastest, 2 * slowest), SPEEDS)
    curve = np.array([friction(speed) for speed in speeds])
    slopes = np.diff(curve, axis=0) / np.diff(speeds)[:, None]
    dry = curve[:-1] - slopes * speeds[:-1, None]
    slip = np.maximum(np.max([curve[0], *dry], axis=0), 0.0)
    even = (at_speed(slowest) + at_speed(-slowest)) / 2
    momentum = _force(base, rows.motion)[1]
    force = every.project(np.asarray(rows.motion.force, float))
    beyond = force - every.project(np.zeros_like(speed), momentum) - even
    return _Standing(
        np.asarray(rows.motion.time, float)[centre],
        every.project(np.asarray(rows.motion.position, float)),
        speed[centre],
        force,
        beyond,
        slip,
        np.maximum(HOLDS * slip, friction(AT_REST * slowest)),
        rests,
    )


def _force(base: Fit, motion: Recording) -> tuple[np.ndarray, np.ndarray]:
    """What the baseline needs at the nodes without inertia, N, and its momentum, N·s, `(M,)`."""
    plain, momentum = np.zeros(len(motion.time)), np.zeros(len(motion.time))
    for term, beta, alpha in zip(base.terms, base.betas, base.alphas, strict=True):
        rest, moving = evaluate(term, np.repeat(beta[None], PAIR, axis=0), motion)
        plain += alpha @ np.asarray(rest)[0]
        momentum += 0.0 if moving is None else alpha @ np.asarray(moving)[0]
    return plain, momentum


def _at_end(
    recording: Recording, problem: Problem, seen: _Standing, side: float
) -> tuple[Stop | None, bool]:
    """The stop at one end, and whether the axis rests there under more than slip friction."""
    outward = side * np.asarray(recording.position, float)
    valid = np.asarray(recording.mask) & np.isfinite(outward)
    far, near = outward[valid].max(), outward[valid].min()
    stroke = far - near
    zone = stroke / (2 * STEEP)  # of what rises too slowly for a stop
    at = side * seen.position
    pressing = seen.pressed(side)
    end = seen.rests & (at > far - zone)
    if not end.any():
        return None, False
    left = UNKNOWN * _left(problem, side, far, stroke, zone)
    leans = bool((end & (pressing > seen.slip + left)).any())
    most = np.maximum(seen.holds + left, _held_elsewhere(seen, zone, side, far, near))
    pressed = np.flatnonzero(end & (pressing > most))
    if len(pressed) < LEAST:
        return None, leans
    strongest = pressed[np.argmax(pressing[pressed])]
    held = float(pressing[strongest])
    rise = 1 - float(seen.slip[strongest]) / held
    first = float(at[pressed].min())
    if not rise * stroke > STEEP * 2 * (far - first):
        return None, leans
    share = float(np.sum(pressing[pressed] ** 2))
    share /= share + problem.base.energy
    away = side * seen.velocity > problem.evidence.limits.slowest
    free = np.flatnonzero(away & (side * seen.beyond < most) & (at < first))
    begins = _begins(recording, problem, seen, side, pressed, free, first - zone)
    # A load that is put on at once bends a spring by twice what it does at rest, and a blow by
    # more: after a blow the axis stands no deeper than it had got beyond that.
    begins = min(begins, 2 * first - far)
    stop = _stop(recording, side, (begins, first, far), held, share)
    beyond = stop.contact.beyond(recording) & valid
    if np.mean(beyond[valid]) > 0.5:
        return None, leans
    contact = stop.contact._replace(samples=int(np.count_nonzero(beyond)))
    visits = 1 + int(np.count_nonzero(np.diff(pressed) > 2 * problem.evidence.half))
    least = max(held - float(seen.slip[strongest]), 0.0) / stop.yields
    return stop._replace(contact=contact, visits=visits, stiffness=least), leans


def _left(problem: Problem, side: float, far: float, stroke: float, zone: float) -> float:
    """The most that the baseline leaves of a slip row at that end of the stroke, N.

    But for rows that hold what happens at the end itself, as a blow.
    """
    rows = problem.evidence
    at = side * np.asarray(rows.motion.position, float)[: rows.nodes]
    blown = np.convolve(at > far - zone, np.ones(4 * rows.half + 1), "same") > 0.5
    there = (at[rows.centre] > far - END * stroke) & ~blown[rows.centre]
    return float(np.max(np.abs(problem.base.residual[there]), initial=0.0))


def _held_elsewhere(seen: _Standing, zone: float, side: float, far: float, near: float) -> float:
    """The most that the axis bears at rest without a stop, N: what holds it there is no stop."""
    at = side * seen.position
    inner = (at < far - zone) & (at > near + zone)
    ends = ((at >= far - zone, -side), (at <= near + zone, side))
    every = [np.where(inner, seen.pressed(way), 0.0) for way in (1.0, -1.0)]
    every += [np.where(where, seen.pressed(way), 0.0) for where, way in ends]
    return float(np.max(every, initial=0.0))


# On its way into a stop an axis slows down by a tenth within 0.1 of the depth that it gets to where
# damping brakes it, and within 0.44 where a spring does. A drive that pushes on by a tenth of the
# friction more, of a whole one at least in the end, adds 0.1: the depth is below 2.2 of the rest.
FREE, PUSHES, DEEPER = 0.9, 0.1, 2.5
# Noise of the position moves a speed by a twentieth, half of that tenth.
STEADY = 0.05


def _begins(
    recording: Recording, problem: Problem, seen: _Standing, side: float, pressed: np.ndarray,
    free: np.ndarray, lowest: float,
) -> float:  # fmt: skip
    """From where on at least the stop is, m outwards, by how the axis arrives at it.

    **Arguments:** `pressed`, numbers of kernels in which it stands there; `free`, of those in which
    it moves outwards, and nothing stops it; `lowest`, what is known without a look.
    """
    time, outward = np.asarray(recording.time, float), side * np.asarray(recording.position, float)
    force = side * np.asarray(recording.force, float)
    interval, noise = problem.evidence.limits.interval, signals.choose(recording).noise
    begins = pressed[np.diff(pressed, prepend=-np.inf) > 2 * problem.evidence.half]
    found = [lowest]
    for visit in begins if problem.evidence.clock else ():
        before = free[free < visit]
        if not len(before):
            continue
        arrives = side * seen.velocity[before[-1]]
        over = 1 + int(np.sqrt(2) * noise / (STEADY * arrives * interval))
        first, last = np.searchsorted(time, (seen.time[before[-1]], seen.time[visit]))
        way, push = (x[max(first - over, 0) : last + 1] for x in (outward, force))
        speed = (way[over:] - way[:-over]) / (over * interval)
        more = np.convolve(push - push[over], np.ones(over) / over, "valid")[: len(speed)]
        fast = np.flatnonzero((speed >= FREE * arrives) & (more <= PUSHES * seen.slip[visit]))
        if len(fast):  # free at the beginning of what this speed is of
            there, most = way[fast[-1]], float(way.max())
            found.append(most - DEEPER * (most - float(there)))
    return max(found)


def _stop(
    recording: Recording, side: float, reach: tuple[float, float, float], held: float, share: float
) -> Stop:
    """The stop, outwards: from where on it may be, and where the axis stands pressed first, and how
    far it has come, m.
    """
    begins, first, far = reach
    steps = np.diff(np.unique(np.asarray(recording.position, float)))
    begins = min(begins, first - float(steps.min()))
    units, middle = recording.unit_names, (begins + first) / 2
    # Anywhere in the interval, which is two standard errors to either side.
    error = np.float64((first - begins) / 4)
    value = Estimate(np.float64(side * middle), error, units["position"])
    contact = Contact(value, side * begins, side > 0, held, units["force"], 0, share)
    return Stop(contact, far - begins, 0, 0.0)


def _confirmed(
    stop: Stop, held: Motion | None, rows: Evidence | None, problem: Problem, side: float
) -> Stop:
    """With what the held-out recording says: is the axis stopped there, or does it pass?"""
    if held is None or rows is None or not rows.located:
        return stop
    at, place = side * np.asarray(held.recording.position, float), side * stop.contact.edge
    inside = np.asarray(held.recording.mask)
    if np.max(at[inside]) > place + 2 * stop.yields:
        return stop._replace(confirmed=False)
    seen = _standing(rows, problem.base)
    pressing = seen.pressed(side)
    there = (side * seen.position > place) & (pressing > seen.holds)
    return stop._replace(confirmed=True if there.any() else None)
