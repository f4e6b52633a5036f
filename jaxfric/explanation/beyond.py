"""Tones that are faster than the kernel of the rows lets through: sought in the samples.

No row shows them, so that a residual which is such a tone would pass for noise.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ..checks import LEFT, Remark
from ..data.excerpt import MOST, SPARE
from .acceptance import LEAST_SHARE, LINEARITY
from .evidence import LONGEST, Evidence
from .locate import Structure
from .nodes import NODES
from .significance import BLOCKS, DRAWS, LEVEL, evenly
from .spectral_lines import NEIGHBOURS, OVERSAMPLING, SPARSE, line_frequencies, standing_out

# A tone has this part of the power of all that stands out within a tenth of its frequency: the
# ringing after every reversal of a periodic motion is a comb of many, as wide as its damping.
ALONE, NEAR = 0.5, 0.1


# A verdict hangs on a tone that has more power than all else that is left sample by sample, noise
# above all, so that the error would be less by three tenths without it, or on one of a tenth of the
# force (`LEFT`). A smaller one hardly changes the error, and most logs have one: what is faster
# than half the sampling rate appears as a slower tone, as do counts of an encoder at steady speed.
MOST_LEFT = 0.5
# The name of the remark on such a tone.
FAST_TONE = "fast_tone"


class Samples(NamedTuple):
    """What a model leaves of the force, at the samples over which a force error is taken, `(C,)`.

    `rest` and `force`, N; `time`, s. Of a long recording the first of them.
    """

    rest: Float[np.ndarray, " C"]
    force: Float[np.ndarray, " C"]
    time: Float[np.ndarray, " C"]

    @classmethod
    def of(cls, rest, force, time, counted: Bool[np.ndarray, " N"]) -> "Samples":
        """From the signals of a recording, `(N,)`, and which samples are counted."""
        some = counted[:MOST]
        return cls(*(values[: len(some)][some] for values in (rest, force, time)))


def without(
    tone: Structure,
    rest: Float[np.ndarray, " N"],
    time: Float[np.ndarray, " N"],
    counted: Bool[np.ndarray, " N"],
) -> Float[np.ndarray, " N"]:
    """What is left, N, `(N,)`, without a tone, by least squares of the counted samples."""
    turned = 2 * np.pi * tone.peak * (time - time[counted][0])
    waves = np.stack([np.sin(turned), np.cos(turned)], axis=1)
    return rest - waves @ np.linalg.lstsq(waves[counted], rest[counted], rcond=None)[0]


def tone_beyond(samples: Samples, evidence: Evidence, seed: int = 0) -> Structure | None:
    """The strongest tone above those that the rows are scanned for, if it counts as structure does.

    It stands out of its neighbours in the spectrum (Fisher 1929), and random signs of the blocks do
    not do as well: what rings or hums now and then is no tone.
    """
    rest, force, time = samples
    if len(rest) < BLOCKS * NEIGHBOURS or not evidence.clock:
        return None
    step = float(np.median(np.diff(time)))
    cell = np.round((time - time[0]) / step).astype(int)
    if cell[-1] > SPARSE * len(cell):
        return None
    series = np.zeros(OVERSAMPLING * (int(cell[-1]) + 1))
    series[cell] = rest
    tones = np.fft.rfftfreq(len(series), step)
    power = np.abs(np.fft.rfft(series)) ** 2
    best = standing_out(tones, power, line_frequencies(evidence, "time")[-1], evidence.repeats)
    if best is None or not _alone(power, best):
        return None
    tone, block = float(tones[best]), evenly(len(rest), BLOCKS)
    waves = rest * np.exp(-2j * np.pi * tone * time)
    scores = np.bincount(block, waves.real, BLOCKS) + 1j * np.bincount(block, waves.imag, BLOCKS)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(DRAWS, BLOCKS))
    p_value = float((1 + np.sum(np.abs(signs @ scores) >= abs(scores.sum()))) / (1 + DRAWS))
    size = float(abs(scores.sum())) * np.sqrt(2) / len(rest)
    share = size**2 / float(np.mean(rest**2))
    if p_value > LEVEL or share < LEAST_SHARE or size < LINEARITY * rms(force):
        return None
    return Structure("time_lines", share, size, p_value, tone, (np.zeros(0), np.zeros(0)))


def matters(tone: Structure, samples: Samples) -> bool:
    """Whether a tone that is left is a reason for a verdict, and not a remark alone."""
    return tone.share >= MOST_LEFT or tone.size >= LEFT * rms(samples.force)


def rms(values: np.ndarray) -> float:
    """The root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def _alone(power: np.ndarray, best: int) -> bool:
    """Whether most of what stands out about a tone is the tone."""
    first = best - int(NEAR * best)
    around = power[first : best + int(NEAR * best) + 1]
    noise = np.median(around) / np.log(2)
    stands = np.where(around > noise * np.log(len(around) / LEVEL), around, 0.0)
    own = slice(best - first - OVERSAMPLING, best - first + OVERSAMPLING + 1)
    return bool(stands[own].sum() >= ALONE * stands.sum())


def half_width(tone: Structure, evidence: Evidence) -> int | None:
    """Half the width, in samples, of a kernel whose rows show a tone; `None` if there is none.

    It takes six samples each way and more, and no more nodes than a search can do with.
    """
    step = int(np.ceil(1 / (tone.peak * float(evidence.limits.interval) * NODES))) - 1
    nodes = evidence.nodes * evidence.width / (NODES * max(step, 1))
    return NODES * step if step >= 1 and nodes <= SPARE * LONGEST else None


def remark(tone: Structure, samples: Samples) -> Remark:
    """That a tone is left which no effect was looked for at."""
    text = (
        f"A tone of {tone.peak:.4g} Hz is left, {tone.size / rms(samples.force):.1%} of the force, "
        "too fast for the search, which named nothing for it: the loop, the drive's supply or "
        "something that turns hums so, or counts of an encoder beat with the samples at a steady "
        "speed. Look for what runs at that frequency, or log at a higher rate."
    )
    return Remark(FAST_TONE, text, False)
