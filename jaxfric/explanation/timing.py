"""A dead time or a lag: the same to first order, told apart by undoing each exactly.

A column T dû/dt cannot tell u = f(t + τ) from u = f + T df/dt. But the recorded force can be put
back: taken τ earlier, or passed through the lag 1/(1 + T s). The one that leaves less is the
better account, by how much noise of the force each of them would leave on its own.
"""

import dataclasses
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np

from .. import terms as laws
from ..effects import EFFECTS
from ..recording import Recording
from .candidates import Candidate
from .evidence import gather
from .naming import RIVAL, Named, Taken
from .predictions import with_predictions
from .question import Question, from_position
from .regression import fit

LATE = (laws.TransportDelay, laws.ActuatorLag)
# Times tried, in parts of the first-order estimate, which errs by its own second order.
TRIED = np.geomspace(0.6, 1.7, 9)


def settled(recording: Recording, asked: Question, found: Named) -> Named:
    """The findings with a delay or lag under its right name, if the recording tells them apart."""
    start = len(found.last.terms) - len(found.taken)
    places = [i for i, term in enumerate(found.last.terms) if isinstance(term, LATE)]
    if len(places) != 1 or places[0] < start:
        return found
    place = places[0]
    guess = float(found.last.alphas[place][0])
    if guess <= 0:
        return found
    motion = from_position(recording)
    shares = {}
    for name, undo in (("transport_delay", _earlier), ("actuator_lag", _lagged)):
        shares[name] = _least(undo, motion, asked, found, place, guess)
    size = found.left.size
    gap = 0.5 * size * np.log(shares["actuator_lag"][0] / shares["transport_delay"][0])
    best = "transport_delay" if gap > 0 else "actuator_lag"
    other = ({"transport_delay", "actuator_lag"} - {best}).pop()
    taken = found.taken[place - start]
    rivals = tuple(r for r in taken.rivals if r not in ("transport_delay", "actuator_lag"))
    if abs(gap) < RIVAL:
        rivals = (other, *rivals)
    return _renamed(found, place, best, shares[best][1], taken._replace(rivals=rivals))


def _least(undo: Callable, motion, asked, found, place, guess) -> tuple[float, float]:
    """The least energy over the times tried, per unit of force noise, and the time there."""
    energies = [_energy(undo, motion, asked, found, place, guess * part) for part in TRIED]
    i = int(np.clip(np.argmin(energies), 1, len(TRIED) - 2))
    bend = np.polyfit(np.log(TRIED[i - 1 : i + 2]), np.log(energies[i - 1 : i + 2]), 2)
    if bend[0] <= 0:
        return float(np.min(energies)), float(guess * TRIED[np.argmin(energies)])
    at = np.clip(-bend[1] / (2 * bend[0]), *np.log(TRIED[[i - 1, i + 1]]))
    return float(np.exp(np.polyval(bend, at))), float(guess * np.exp(at))


def _energy(undo, motion, asked: Question, found: Named, place: int, time: float) -> float:
    keep = [i for i in range(len(found.last.terms)) if i != place]
    width = asked.evidence.width
    view = gather(undo(motion, time), width, asked.delay)
    terms, betas = [found.last.terms[i] for i in keep], [found.last.betas[i] for i in keep]
    now = fit(terms, with_predictions(view, found.last), betas, 3)
    noise = np.random.default_rng(0).normal(size=motion.num_samples)
    hiss = gather(undo(dataclasses.replace(motion, force=jnp.asarray(noise)), time), width)
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


def _renamed(found: Named, place: int, name: str, time: float, taken: Taken) -> Named:
    kind = laws.TransportDelay if name == "transport_delay" else laws.ActuatorLag
    terms, alphas = list(found.last.terms), list(found.last.alphas)
    terms[place], alphas[place] = kind(), np.array([time])
    candidate = Candidate(EFFECTS[name], kind(), taken.trial.candidate.betas)
    taken = taken._replace(trial=taken.trial._replace(candidate=candidate))
    number = place - (len(found.last.terms) - len(found.taken))
    all_taken = [taken if i == number else t for i, t in enumerate(found.taken)]
    last = found.last._replace(terms=tuple(terms), alphas=tuple(alphas))
    return found._replace(last=last, taken=all_taken)
