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

# Resolution cells on either side whose median is the noise about a line: thousands would take in
# the noise's own colour, and of a few the line itself is too many.
NEIGHBOURS = 32


def fast_tone(evidence: Evidence, now: Fit) -> list[Candidate]:
    """The strongest tone above those scanned for, if it stands out of a residual's spectrum.

    Up to where it has a period in the kernel's half: beyond, rows cannot tell it from a slower one.
    """
    scanned = line_frequencies(evidence, "time")[-1]
    top = 1 / evidence.reach
    if not evidence.clock or scanned >= top:
        return []
    time = np.asarray(evidence.motion.time)[evidence.centre]
    place = np.round((time - time[0]) * 2 * top).astype(int)
    series = np.zeros(OVERSAMPLING * (int(place[-1]) + 1))
    series[place] = now.residual
    power = np.abs(np.fft.rfft(series)) ** 2
    tones = np.fft.rfftfreq(len(series), 0.5 / top)
    near = OVERSAMPLING * NEIGHBOURS
    above = tones > scanned
    if np.sum(above) < 2 * near:
        return []
    around = np.lib.stride_tricks.sliding_window_view(np.pad(power, near, "reflect"), 2 * near + 1)
    ratio = power[above] / np.maximum(np.median(around[above], axis=1) / np.log(2), 1e-300)
    best = int(np.argmax(ratio))
    tone = tones[above][best]
    if np.exp(-ratio[best]) * len(ratio) > LEVEL or shared(np.array([tone]), evidence)[0] >= OWN:
        return []
    places = tone + tones[1] * np.arange(-2, 3)
    effect, lines = EFFECTS["periodic_disturbance"], Lines("time", False)
    return [Candidate(effect, laws.PeriodicDisturbance(), places[:, None], lines)]
