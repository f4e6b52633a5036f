"""Which tones in time to try: those scanned for, and a faster one that the spectrum names.

Scanning a long record for every tone that its rows resolve would take as many columns as rows. The
strongest line of a residual's spectrum is found at once, and tested there: an ordinate of noise
over the mean of its neighbours has an exponential distribution (Fisher 1929).
"""

from collections.abc import Iterator

import numpy as np

from .evidence import Evidence
from .lines import AT_ONCE, OVERSAMPLING, angle, line_frequencies
from .regression import Fit
from .significance import LEVEL

# Part of the motion's variance in a tone's resolution cell from which the tone is the motion's own:
# an unrelated one holds two of some thousand values.
OWN = 0.05
# What the motion drives is in all of its tones or, where it is one wave, in that and its multiples.
# But a force that is all in another one, or in one of many, has a clock of its own.
ITSELF, ALL = 0.5, 0.9
# Resolution cells whose median is the noise about a line: thousands would take in the noise's own
# colour, and of a few the line itself is too many.
NEIGHBOURS = 64
# A record with more gaps than this, as a day between two runs, has a clock but no spectrum.
SPARSE = 16
_NONE = np.zeros(0)


def tones_to_try(evidence: Evidence) -> Iterator[tuple[np.ndarray, float]]:
    """Frequencies, Hz, `(G,)`, and the part of what is left that a force there must take.

    Those that the motion does not have, and those that it has but need not drive.
    """
    tones = line_frequencies(evidence, "time")
    power = shared(tones, evidence)
    own = power >= OWN
    yield tones[~own], 0.0
    if power.max() >= ITSELF:
        lowest = int(np.argmax(power >= ITSELF))
        wave = tones[lowest + int(np.argmax(power[lowest : lowest + OVERSAMPLING]))]
        own &= np.abs(tones - wave * np.round(tones / wave)) > OVERSAMPLING * np.diff(tones[:2])
    yield tones[own], ALL


def shared(tones: np.ndarray, evidence: Evidence) -> np.ndarray:
    """The part of the motion's variance in the cell of each tone: the largest of its signals'."""
    motion, rows = evidence.motion, evidence.centre
    time, velocity = np.asarray(motion.time)[rows], np.asarray(motion.velocity)[rows]
    signals = [velocity, np.abs(velocity), evidence.side]
    if motion.position is not None:
        signals.append(np.asarray(motion.position)[rows])
    series = np.stack([signal - signal.mean() for signal in signals])
    series /= np.maximum(np.linalg.norm(series, axis=1), 1e-300)[:, None]
    power = np.empty(len(tones))
    for some in range(0, len(tones), AT_ONCE):
        turned = angle(tones[some : some + AT_ONCE, None] * (time - time[0]))
        both = (series @ np.stack([np.sin(turned), np.cos(turned)]).transpose(0, 2, 1)) ** 2
        power[some : some + AT_ONCE] = np.max(np.sum(both, axis=0), axis=0) * 2 / len(time)
    return power


def fast_tone(evidence: Evidence, now: Fit) -> np.ndarray:
    """Frequencies about the strongest tone above those scanned for, Hz; none if none stands out.

    By the residual's spectrum, up to where it has a period in the kernel's half: beyond, rows
    cannot tell it from a slower one.
    """
    scanned, top = line_frequencies(evidence, "time")[-1], 1 / evidence.reach
    if not evidence.clock or scanned >= top:
        return _NONE
    time = np.asarray(evidence.motion.time)[evidence.centre]
    place = np.round((time - time[0]) * 2 * top).astype(int)
    if place[-1] > SPARSE * len(place):
        return _NONE
    series = np.zeros(OVERSAMPLING * (int(place[-1]) + 1))
    series[place] = now.residual
    tones = np.fft.rfftfreq(len(series), 0.5 / top)
    above = tones > scanned
    power, tones = np.abs(np.fft.rfft(series)[above]) ** 2, tones[above]
    near = OVERSAMPLING * NEIGHBOURS
    parts = len(power) // near
    if not parts:
        return _NONE
    part = np.minimum(np.arange(len(power)) // near, parts - 1)
    noise = np.median(power[: parts * near].reshape(parts, near), axis=1) / np.log(2)
    ratio = power / np.maximum(noise[part], 1e-300)
    best = int(np.argmax(ratio))
    tone = tones[best]
    if np.exp(-ratio[best]) * len(ratio) > LEVEL or shared(np.array([tone]), evidence)[0] >= OWN:
        return _NONE
    return tone + (tones[1] - tones[0]) * np.arange(-2, 3)
