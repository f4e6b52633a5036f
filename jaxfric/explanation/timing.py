"""A dead time or a lag: the same to first order, told apart by undoing each exactly.

A column T dû/dt cannot tell u = f(t + τ) from u = f + T df/dt. But the recorded force can be put
back: taken τ earlier, or passed through the lag 1/(1 + T s). The one that leaves less is the
better account, by how much noise of the force each of them would leave on its own.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from .. import terms as laws
from ..effects import EFFECTS
from ..recording import Recording
from .candidates import Candidate
from .contest import RIVAL
from .evidence import gather
from .naming import Named, Taken, least_gain
from .predictions import with_predictions
from .question import Question, from_position
from .regression import fit, without

LATE = (laws.TransportDelay, laws.ActuatorLag)
# Times tried, in parts of the first-order estimate, which errs by its own second order.
TRIED = np.geomspace(0.6, 1.7, 9)


class Late(NamedTuple):
    """A force that acts late: the effect's name, its time, s, and how to undo it.

    `place`: of its term in the fit; `taken`: what was found, under its right name; `smoothed`:
    what the kernel's smoothing and the sampling make of the time, s.
    """

    time: float
    undo: Callable[[Recording, float], Recording]
    place: int
    taken: Taken
    smoothed: float

    def undone(self, recording: Recording) -> Recording:
        """The recording with its force where it belongs."""
        return self.undo(from_position(recording), self.time)


def late(recording: Recording, asked: Question, found: Named) -> Late | None:
    """The delay or lag among the findings under its right name, where there is one."""
    start = len(found.last.terms) - len(found.taken)
    places = [i for i, term in enumerate(found.last.terms) if isinstance(term, LATE)]
    if len(places) != 1 or places[0] < start:
        return None
    place = places[0]
    guess = float(found.last.alphas[place][0])
    if guess <= 0:
        return None
    motion = from_position(recording)
    ways = {"transport_delay": _earlier, "actuator_lag": _lagged}
    width = asked.evidence.width
    least = {
        name: _least(undo, motion, asked, found, place, guess, width) for name, undo in ways.items()
    }
    size = found.left.size
    gap = 0.5 * size * np.log(least["actuator_lag"][0] / least["transport_delay"][0])
    best = "transport_delay" if gap > 0 else "actuator_lag"
    other = ({"transport_delay", "actuator_lag"} - {best}).pop()
    taken = found.taken[place - start]
    rivals = tuple(r for r in taken.rivals if r not in ways)
    if abs(gap) < RIVAL:
        rivals = (other, *rivals)
    time = least[best][1]
    wide = time
    if asked.wide is not None:
        wide = _least(ways[best], motion, asked, found, place, time, 2 * width)[1]
    # Smoothing errs with the square of the width, so a third of what doubling it changes is left
    # (Richardson 1911); and nobody wrote down when in its period a sample of the force was taken.
    smoothed = float(np.hypot((wide - time) / 3, asked.evidence.limits.interval / np.sqrt(12)))
    return Late(time, ways[best], place, _renamed(taken, best, rivals), smoothed)


def _renamed(taken: Taken, name: str, rivals: tuple[str, ...]) -> Taken:
    kind = laws.TransportDelay if name == "transport_delay" else laws.ActuatorLag
    candidate = Candidate(EFFECTS[name], kind(), taken.trial.candidate.betas)
    return taken._replace(trial=taken.trial._replace(candidate=candidate), rivals=rivals)


def settled(
    found: Named, behind: Named, lateness: Late, asked: Question, there: Question
) -> tuple[Named, Named]:
    """What was found once the force was put back, `behind`, and the delay or lag itself.

    Beside it the same without, on the recording with the force put back, `there`: what that leaves
    is what the findings leave, while a column for the delay keeps its second order.
    """
    others = [t for t in behind.taken if not isinstance(t.trial.candidate.term, LATE)]
    kept = [i for i, term in enumerate(behind.last.terms) if not isinstance(term, LATE)]
    seen = with_predictions(there.evidence, behind.last)
    left = fit([behind.last.terms[i] for i in kept], seen, [behind.last.betas[i] for i in kept], 6)
    known = lateness.taken.trial.candidate
    for number in reversed(range(len(others))):
        place = len(left.terms) - len(others) + number
        less = without(left, seen, place)
        # As for any later term.
        before = [known.effect, *(t.trial.candidate.effect for t in others[:number])]
        effect = others[number].trial.candidate.effect
        least = least_gain(effect, before, found.base.energy, less.energy)
        if less.energy - left.energy < least:
            left, others = less, [t for i, t in enumerate(others) if i != number]
    evidence = with_predictions(asked.evidence, left)
    now = fit((*left.terms, known.term), evidence, [*left.betas, np.zeros(0)], 6)
    now = now._replace(alphas=(*now.alphas[:-1], np.array([lateness.time])))
    rest = behind._replace(last=left, taken=others)
    taken = [*others, lateness.taken]
    found = found._replace(last=now, taken=taken, left=behind.left, smoothed=lateness.smoothed)
    return found, rest


def _least(undo: Callable, motion, asked, found, place, guess, width) -> tuple[float, float]:
    """The least energy over the times tried, per unit of force noise, and the time there."""
    energies = [_energy(undo, motion, asked, found, place, guess * part, width) for part in TRIED]
    i = int(np.clip(np.argmin(energies), 1, len(TRIED) - 2))
    bend = np.polyfit(np.log(TRIED[i - 1 : i + 2]), np.log(energies[i - 1 : i + 2]), 2)
    if bend[0] <= 0:
        return float(np.min(energies)), float(guess * TRIED[np.argmin(energies)])
    at = np.clip(-bend[1] / (2 * bend[0]), *np.log(TRIED[[i - 1, i + 1]]))
    return float(np.exp(np.polyval(bend, at))), float(guess * np.exp(at))


def _energy(undo, motion, asked: Question, found: Named, place: int, time, width) -> float:
    keep = [i for i in range(len(found.last.terms)) if i != place]
    view = gather(undo(motion, time), width, asked.delay, asked.reversals)
    terms, betas = [found.last.terms[i] for i in keep], [found.last.betas[i] for i in keep]
    now = fit(terms, with_predictions(view, found.last), betas, 3)
    noise = np.random.default_rng(0).normal(size=motion.num_samples)
    hiss = dataclasses.replace(motion, force=jnp.asarray(noise))
    hiss = gather(undo(hiss, time), width, reversals=asked.reversals)
    return now.energy / float(np.mean(hiss.target**2))


def _earlier(motion: Recording, delay: float) -> Recording:
    time, force = np.asarray(motion.time), np.asarray(motion.force)
    moved = np.empty_like(force)
    segment = np.asarray(motion.segment)
    for label in np.unique(segment):
        own = segment == label
        moved[own] = np.interp(time[own] - delay, time[own], force[own])
    return dataclasses.replace(motion, force=jnp.asarray(moved))


def _lagged(motion: Recording, lag: float) -> Recording:
    """The force through 1/(1 + T s), exact for straight lines between the samples."""
    time, force = np.asarray(motion.time), np.asarray(motion.force)
    step = np.diff(time, prepend=time[0])
    keep = np.exp(-np.clip(step, 0.0, None) / lag)
    new = np.diff(np.asarray(motion.segment), prepend=-1) != 0
    out, state, before = np.empty_like(force), 0.0, 0.0
    for i, (u, k, h, fresh) in enumerate(zip(force, keep, step, new, strict=True)):
        if fresh or h <= 0:
            state = u
        else:
            slope = (u - before) / h
            state = k * (state - before + slope * lag) + u - slope * lag
        out[i], before = state, u
    return dataclasses.replace(motion, force=jnp.asarray(out))
