"""A place that the axis does not pass: there it stands, pressed harder than friction holds."""

import dataclasses
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ... import signals
from ...data.recording import Recording
from ...identification.uncertainty import Estimate
from ...simulation.errors import in_motion
from ...terms import KNOWN_FORCE
from ..significance import FEWEST

# Break-away is seldom more than twice what friction resists in slip: half of what the force differs
# by between both directions, since gravity and inertia are the same in both. Nor is less than twice
# the usual force asked about, nor a force inwards, as inertia asks for where a motion ends.
HOLDS = 2.0
# A stop is met at the end of the stroke; what lies before that is the axis elsewhere.
END = 0.25
# So many times as steep as a spring over the stroke: what rises slower is looked for as a spring.
STEEP = 20.0
# A start or a blow may ask for as much elsewhere, for so much of the time.
STRAY = 0.05


class Contact(NamedTuple):
    """Where something blocks the axis.

    `place`: from where on, m or rad; `edge`: where it was felt first; `upper`: at the upper end of
    the stroke, else at the lower; `held`: the most that it holds beside what the motion needs, N;
    `unit` of that; `samples` beyond the place; `share`: the part of the mismatch's power in these.
    """

    place: Estimate
    edge: float
    upper: bool
    held: float
    unit: str
    samples: int
    share: float

    def beyond(self, recording: Recording) -> Bool[np.ndarray, " N"]:
        """The samples beyond the place, `(N,)`, and those whose acceleration these are part of."""
        at = np.asarray(recording.position, float)
        beyond = at >= self.edge if self.upper else at <= self.edge
        width = 2 * signals.choose(recording, order=2).half_width
        near = np.convolve(beyond, np.ones(2 * width + 1), "same")
        return near > 0.5

    def without(self, recording: Recording) -> Recording:
        """The recording without these samples."""
        mask = np.asarray(recording.mask) & ~self.beyond(recording)
        return dataclasses.replace(recording, mask=jnp.asarray(mask))


def contacts(recording: Recording) -> list[Contact]:
    """What blocks the axis at either end, in a recording with its simulator's force beside it."""
    if recording.position is None:
        return []
    found = (_at_end(recording, upper) for upper in (True, False))
    return [contact for contact in found if contact is not None]


def _at_end(recording: Recording, upper: bool) -> Contact | None:
    side = 1.0 if upper else -1.0
    force = np.asarray(recording.force, float)
    outward = side * np.asarray(recording.position, float)
    valid = np.asarray(recording.mask) & np.isfinite(force)
    known = _known(recording)
    if np.count_nonzero(valid) < FEWEST or known is None:
        return None
    excess = side * (force - known)
    far, near = np.max(outward[valid]), np.min(outward[valid])
    end = far - END * (far - near)
    inner = in_motion(recording) & (outward < end) & valid
    if not inner.any():
        return None
    most = HOLDS * max(float(np.median(np.abs(force[inner]))), _friction(recording, force, inner))
    pressed = np.flatnonzero(valid & (np.minimum(excess, side * force) > most))
    elsewhere = int(np.count_nonzero(outward[pressed] < end))
    pressed = pressed[outward[pressed] >= end]
    if len(pressed) < FEWEST or elsewhere > STRAY * len(pressed):
        return None
    gradual = _gradual(recording, outward, excess, valid, (far - near) / STEEP, pressed)
    if np.count_nonzero(excess[pressed] > most + gradual) < FEWEST:
        return None
    rise = 1 - most / excess[pressed].max()
    if not rise * (far - near) > STEEP * 2 * (far - outward[pressed].min()):
        return None
    # What blocks the axis is not passed at other times, as far in as it was pressed half the time.
    deep = np.median(outward[pressed])
    free = np.count_nonzero(valid & (outward >= deep) & (excess < most / HOLDS))
    if free > 0.5 * np.count_nonzero(outward[pressed] >= deep):
        return None
    visits = 1 + int(np.count_nonzero(np.diff(pressed) > 1))
    place = _place(outward[pressed], excess[pressed], visits)
    unit = recording.unit_names
    estimate = place._replace(value=np.float64(side * place.value), unit=unit["position"])
    edge = side * min(float(place.value), float(outward[pressed].min()))
    contact = Contact(estimate, edge, upper, float(excess[pressed].max()), unit["force"], 0, 0.0)
    beyond = contact.beyond(recording) & valid
    if np.mean(beyond[valid]) > 0.5:
        return None
    power = float(np.sum(excess[beyond] ** 2) / np.sum(excess[valid] ** 2))
    return contact._replace(samples=int(np.count_nonzero(beyond)), share=power)


def _gradual(
    recording: Recording, outward: np.ndarray, excess: np.ndarray, valid: np.ndarray, width: float,
    pressed: np.ndarray,
) -> float:  # fmt: skip
    """What a force that rises on the way there is at the place, N, by a straight line over the last
    `width`, m, in slip: a bumper on which the axis stands is no block.
    """
    edge = outward[pressed].min()
    slips = valid & in_motion(recording) & (np.gradient(outward) > 0)
    slips &= (outward > edge - width) & (outward < edge)
    if np.count_nonzero(slips) < FEWEST:
        return 0.0
    columns = np.stack([np.ones(np.count_nonzero(slips)), outward[slips] - edge], axis=1)
    there, slope = np.linalg.lstsq(columns, excess[slips], rcond=None)[0]
    return max(float(there), 0.0) if slope > 0 else 0.0


def _friction(recording: Recording, force: np.ndarray, where: np.ndarray) -> float:
    """Half of what the usual force differs by between both directions, N."""
    forward = np.gradient(np.asarray(recording.position, float)) > 0
    ways = (where & forward, where & ~forward)
    if not all(way.any() for way in ways):
        return 0.0
    there, back = (float(np.median(force[way])) for way in ways)
    return max(there - back, 0.0) / 2


def _known(recording: Recording) -> np.ndarray | None:
    """The simulator's force; while it sticks, and so may have any, between before and after."""
    known, time = (
        np.asarray(values, float) for values in (recording.channels[KNOWN_FORCE], recording.time)
    )
    there = np.isfinite(known)
    return np.interp(time, time[there], known[there]) if there.any() else None


def _place(at: np.ndarray, force: np.ndarray, visits: int) -> Estimate:
    """Where the force begins: the straight line of position over force, at none."""
    scale = float(np.max(force))
    columns = np.stack([np.ones_like(force), force / scale], axis=1)
    value, slope = np.linalg.lstsq(columns, at, rcond=None)[0]
    if not slope > 0:  # as stiff as the encoder sees
        value, slope = np.mean(at), 0.0
    left = at - value - slope * columns[:, 1]
    inverse = np.linalg.pinv(columns.T @ columns)[0, 0] * len(at)
    error = float(np.std(left)) * np.sqrt(inverse / visits)
    # No stop is quite a straight line, nor is it felt before some force.
    return Estimate(np.float64(value), np.float64(np.hypot(error, np.ptp(at) / 2)), "")
