"""A force on another clock than the motion, by a baseline that is fitted to the log.

A force whose clock runs faster is later and later. Whatever is fitted then makes up for that: tones
beside each of the motion's, loads and gains that change. The force is put back by Gauss-Newton.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from ...checks import Remark
from ...identification.uncertainty import Estimate
from ...terms import TransportDelay
from ...terms.effects.late import CLOCK
from ..evidence import Evidence, gather
from ..fewest import SURE
from ..least_squares import orthonormal
from ..motion import Motion
from ..predictions import with_predictions
from ..problem import Problem
from ..quantities import quantity
from ..regression import Fit, fit
from ..significance import blocks
from .faults import DRIFT, LEAVES, OFFSET, Faults, put_right
from .rows import Stack, estimate
from .shifts import FARTHEST, HALVED

# Rounds of Gauss and Newton, and the step, in parts of a sample, that ends them.
ROUNDS, CLOSE = 8, 0.01
# Of what drifts of all values leave it takes so much at first order, or is not looked at further:
# it has to take half of that in the end, of which the first step is most where a delay is a small
# part of the motion's fastest period.
SUSPECT = 0.2


class _Late(NamedTuple):
    """How late the force is: `clock` `(2,)`, s in the middle of the record and s more each second,
    with its standard `errors`; the `energy` that is left, N²; and that where all values of the
    baseline drift as well, `drifting`.
    """

    clock: np.ndarray
    errors: np.ndarray
    energy: float
    drifting: float


def drifting(motion: Motion, problem: Problem) -> Remark | None:
    """What is said of a force that is ever later than the motion; `None` where it is not, or where
    the log is in pieces: each begins a clock anew.

    It has to leave a quarter of what one delay leaves, and half of what is left where all values of
    the baseline drift as well: a load that grows looks like it where the motion is of few tones.
    """
    evidence, recording = problem.evidence, motion.recording
    if recording.num_segments != 1 or not evidence.clock:
        return None
    rows = _Columns(evidence, problem.base)
    if not rows.gain() > SUSPECT:
        return None
    plain, drift = (_late(motion, problem, count) for count in (1, 2))
    sample, half = evidence.limits.interval, 0.5 * evidence.limits.duration
    rate, error = drift.clock[1], drift.errors[1]
    if not (abs(rate) > SURE * error and abs(rate) * half > sample):
        return None
    if not (drift.energy < LEAVES * plain.energy and drift.energy < HALVED * plain.drifting):
        return None
    time = np.asarray(recording.time, float)
    late, more = (
        quantity(Estimate(np.float64(abs(value)), np.float64(error), "s"))
        for value, error in zip(drift.clock, drift.errors, strict=True)
    )
    ways = ["late" if value > 0 else "early" for value in drift.clock]
    text = (
        f"The force has another clock than the motion: it is {late} {ways[0]} in the middle of the "
        f"log, and {more} {'later' if rate > 0 else 'earlier'} each second. Log both by one clock, "
        f"or take the force at t {drift.clock[0]:+.6g} s {rate:+.6g} (t − {time.mean():.6g} s). "
        "Until that is put right, nothing is named."
    )
    return Remark(CLOCK.name, text, True)


class _Columns:
    """A fit's rows; and `late`, `(J, 2)`, what they change by if the force is late, N/s, and ever
    later, N; `drifts`, a basis of all that drifts of the fit's values make, `(J, r)`, and what that
    leaves, `drifting`, N, `(J,)`.
    """

    def __init__(self, evidence: Evidence, current: Fit):
        seen = with_predictions(evidence, current)
        # A force that acts late is early in the log.
        late = -seen.columns(TransportDelay(), np.zeros((1, 0)))[0, :, 0]
        elapsed = evidence.elapsed[evidence.centre]
        away = elapsed - 0.5 * (evidence.elapsed.min() + evidence.elapsed.max())
        self.late = np.stack([late, away * late], axis=1)
        self.current, self.basis = current, current.basis()
        self.block = blocks(elapsed, evidence.reach)
        values = away[:, None] * current.jacobian
        every = orthonormal(np.concatenate([self.basis, self.late[:, :1], values], axis=1))
        self.drifts, self.drifting = every, current.residual - every @ (every.T @ current.residual)

    def gain(self) -> float:
        """The part of what is left where all values drift that a drift of the clock takes off."""
        alone, left = orthonormal(self.late[:, 1:], self.drifts), self.drifting
        return float(np.sum((alone.T @ left) ** 2) / max(float(left @ left), 1e-300))

    def step(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """By how much later the force is, the first `count` of its numbers, and their errors."""
        own = self.late[:, :count] - self.basis @ (self.basis.T @ self.late[:, :count])
        names = [OFFSET, DRIFT][:count]
        known = estimate(Stack(self.current.residual, own, names, self.block), names)
        value, error = np.array([known[name] for name in names]).T
        return value, error


def _late(motion: Motion, problem: Problem, count: int) -> _Late:
    """How late the force is by a delay alone (1), or by another clock (2)."""
    clock, errors, base = np.zeros(2), np.full(2, np.inf), problem.base
    for _ in range(ROUNDS):
        there = gather(_put_back(motion, clock), problem.evidence.width)
        base = fit(base.terms, there, base.betas)
        rows = _Columns(there, base)
        step, errors[:count] = rows.step(count)
        away = np.array([1.0, 0.5 * there.limits.duration])
        if np.all(np.abs(step) * away[:count] < CLOSE * there.limits.interval):
            break
        clock[:count] += step
        if not np.abs(clock) @ away < there.limits.duration / FARTHEST:
            return _Late(clock, errors, np.inf, np.inf)
    return _Late(clock, errors, base.energy, float(rows.drifting @ rows.drifting))


def _put_back(motion: Motion, clock: np.ndarray) -> Motion:
    """The motion with its force put back."""
    log = put_right(motion.recording, Faults(late=float(clock[0]), drift=float(clock[1])))
    there = motion.forced(log.force)
    mask = np.zeros(there.padded.num_samples, bool)
    mask[: log.num_samples] = np.asarray(log.mask)
    return there._replace(
        recording=dataclasses.replace(there.recording, mask=log.mask),
        padded=dataclasses.replace(there.padded, mask=mask),
    )
