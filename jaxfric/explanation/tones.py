"""A tone faster than those that are scanned for: a candidate that the residual's spectrum names.

Scanning a long record for every tone that its rows resolve would take as many columns as rows. The
strongest line of the spectrum is found at once, and tested there: an ordinate of noise over the
mean of its neighbours has an exponential distribution (Fisher 1929).
"""

import numpy as np

from .. import terms as laws
from ..effects import EFFECTS
from .candidates import OVERSAMPLING, OWN, Candidate, Lines, line_frequencies, shared
from .chance import LEVEL
from .evidence import Evidence
from .regression import Fit

# Resolution cells whose median is the noise about a line: thousands would take in the noise's own
# colour, and of a few the line itself is too many.
NEIGHBOURS = 64
# A record with more gaps than this, as a day between two runs, has a clock but no spectrum.
SPARSE = 16


def fast_tone(evidence: Evidence, now: Fit) -> list[Candidate]:
    """The strongest tone above those scanned for, if it stands out of a residual's spectrum.

    Up to where it has a period in the kernel's half: beyond, rows cannot tell it from a slower one.
    """
    scanned, top = line_frequencies(evidence, "time")[-1], 1 / evidence.reach
    if not evidence.clock or scanned >= top:
        return []
    time = np.asarray(evidence.motion.time)[evidence.centre]
    place = np.round((time - time[0]) * 2 * top).astype(int)
    if place[-1] > SPARSE * len(place):
        return []
    series = np.zeros(OVERSAMPLING * (int(place[-1]) + 1))
    series[place] = now.residual
    tones = np.fft.rfftfreq(len(series), 0.5 / top)
    above = tones > scanned
    power, tones = np.abs(np.fft.rfft(series)[above]) ** 2, tones[above]
    near = OVERSAMPLING * NEIGHBOURS
    parts = len(power) // near
    if not parts:
        return []
    part = np.minimum(np.arange(len(power)) // near, parts - 1)
    noise = np.median(power[: parts * near].reshape(parts, near), axis=1) / np.log(2)
    ratio = power / np.maximum(noise[part], 1e-300)
    best = int(np.argmax(ratio))
    tone = tones[best]
    if np.exp(-ratio[best]) * len(ratio) > LEVEL or shared(np.array([tone]), evidence)[0] >= OWN:
        return []
    places = tone + (tones[1] - tones[0]) * np.arange(-2, 3)
    effect, lines = EFFECTS["periodic_disturbance"], Lines("time", False)
    return [Candidate(effect, laws.PeriodicDisturbance(), places[:, None], lines)]
