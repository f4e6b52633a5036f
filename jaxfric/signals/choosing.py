"""The local polynomial whose derivative of a signal is most accurate, from the signal itself.

On the host, in numpy: done once a recording, nothing is compiled. Inside `jax.jit` the local
parabola of [`parabolas`][jaxfric.signals.parabolas] takes its place.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..data.excerpt import cut, excerpt, pieces
from ..data.recording import Recording
from .noise import COLOURED
from .polynomial import BLOCKS, DEGREES, HALF_WIDTHS, WIDE, Choice, weights
from .sampled import CENTRES, SampledSignal

# The bias of a degree is at most ten times what the next degree takes off it.
SLOWEST = 0.9
# The mean squares at neighbouring centres are alike, so that risks are known to a quarter; of those
# within it the narrowest takes least off the motion.
ALIKE = 1.25
# Beyond this the square of a number is none.
LARGEST = 1e150
# Centres at least: their mean square is known to a quarter.
FEWEST = 32
# Numbers in the windows of one rung, 2 MB; of the narrower half-widths, up to NARROW, these are
# eight times as many centres as of the others.
NUMBERS, NARROW = 2**18, 32


class _Level(NamedTuple):
    """Candidates at common centres: `keys` (degree, half-width in samples), whether each may be
    chosen, the power of the difference to its pilot, by how much its bias exceeds that difference
    (zero where the pilot is of the next degree), the moment that makes its bias, and what noise of
    unit variance has of both: |k|² and |k − k_pilot|². All `(C,)`.
    """

    keys: list[tuple[int, int]]
    eligible: np.ndarray
    apart: np.ndarray
    share: np.ndarray
    moments: np.ndarray
    rough: np.ndarray
    rough_apart: np.ndarray

    def bias(self, noise: float, factor: float) -> np.ndarray:
        """The squared bias of each, beyond `factor` times the power of the noise, `(C,)`."""
        shown = np.maximum(self.apart - factor * noise**2 * self.rough_apart, 0.0)
        share = np.where(self.share > 0, self.share, 1.0)
        # What the next degree still lacks follows from how quickly the degrees approach: at a
        # corner of the velocity hardly, and the difference to the next is but a part of the bias.
        first = np.flatnonzero(self.share == 0)
        for i, here in enumerate(first):
            low, high = (here, first[i + 1]) if i + 1 < len(first) else (first[i - 1], here)
            if low != high and shown[low] > 0:
                share[here] = 1 / (1 - min(np.sqrt(shown[high] / shown[low]), SLOWEST))
        return share**2 * shown


def choose(recording: Recording, signal: np.ndarray | None = None, order: int = 1) -> Choice:
    """The local polynomial whose derivative of a signal is most accurate.

    It minimises an estimate of the mean-square error, bias² + σ² |k|², with k the weights and σ the
    white noise of the signal. The bias of a width shows in the difference to the slope of a pilot
    of half the width (for the narrowest, of the next degree), less the noise of that difference.
    What differs between two narrower widths by more than any noise could is bias of every wider
    one too: two widths that both swallow a motion agree with each other. The bias of a narrow one,
    which the noise of its pilot hides, is at least what follows from wider ones as if the motion
    were slow: at no frequency does it fall more steeply.

    **Arguments:** `signal`, `(N,)`, by default the position; `order` of the derivative, 1 or 2.
    """
    whole = np.asarray(recording.position if signal is None else signal)
    spread = pieces(np.asarray(recording.mask))
    if len(spread) > 1:
        whole, recording = cut(whole, spread), excerpt(recording)
    log = SampledSignal.of(recording, whole).trimmed()
    noise = min(log.noise(), LARGEST)
    levels = [_level(log, rung, order) for rung in _ladder(log.longest)]
    tried = _risks([level for level in levels if level is not None], noise)
    if not tried or not log.step > 0:  # too short, or a clock that stands
        return Choice(DEGREES[0], HALF_WIDTHS[0], noise=noise)
    risk = min(tried)[0]
    narrow = min(trial[3] for trial in tried if trial[0] <= ALIKE * risk)
    risk, bias, degree, width = min(trial for trial in tried if trial[3] == narrow)
    scale = log.step**order
    return Choice(degree, width, float(np.sqrt(risk)) / scale, float(np.sqrt(bias)) / scale, noise)


def _risks(levels: list[_Level], noise: float) -> list[tuple[float, float, int, int]]:
    """Risk, bias², degree and half-width of each candidate, the narrower levels first."""
    found: dict[int, list[tuple[float, ...]]] = {degree: [] for degree in DEGREES}
    for level in levels:
        own, sure = (level.bias(noise, factor) for factor in (1.0, COLOURED))
        rough, slow = noise**2 * level.rough, level.moments**2
        for i in np.flatnonzero(level.eligible):
            degree, width = level.keys[i]
            found[degree].append((width, rough[i], own[i], sure[i], slow[i]))
    tried = []
    for degree, rows in found.items():
        widths, roughs, own, sure, slow = np.array(rows).reshape(-1, 5).T
        sure = slow * np.maximum.accumulate((sure / slow)[::-1])[::-1]
        bias = np.maximum(own, np.maximum.accumulate(sure))
        risks = zip((bias + roughs).tolist(), bias.tolist(), widths.tolist(), strict=True)
        tried += [(risk, lost, degree, int(half)) for risk, lost, half in risks]
    return tried


class _Rung(NamedTuple):
    """Half-widths `widths` in blocks of so many samples that are compared at common centres; those
    from `least` on may be chosen, the others are their pilots.
    """

    block: int
    widths: list[int]
    least: int


def _ladder(longest: int) -> list[_Rung]:
    """The rungs for a run of so many samples: half-widths of an eighth of it at most."""
    most = max(HALF_WIDTHS[0], longest // 8)
    narrow = _Rung(1, [k for k in HALF_WIDTHS if k <= min(most, NARROW)], HALF_WIDTHS[0])
    over = [k for k in HALF_WIDTHS if NARROW // 2 < k <= most]
    rungs = [_Rung(1, over, NARROW + 1)]
    rungs += [_Rung(b, [k for k in (64, 96, *WIDE) if k * b <= most], WIDE[0]) for b in BLOCKS]
    return [narrow, *(each for each in rungs if max(each.widths, default=0) >= each.least)]


class _Shapes(NamedTuple):
    """The weights of candidates on an even clock, and what follows from them alone.

    `shapes`, `(K, C)`; `pilot`, the index of each one's pilot; the others as in [`_Level`][].
    """

    keys: list[tuple[int, int]]
    shapes: np.ndarray
    pilot: np.ndarray
    share: np.ndarray
    moments: np.ndarray
    rough: np.ndarray
    apart: np.ndarray


@lru_cache(maxsize=64)
def _shapes(widths: tuple[int, ...], order: int) -> _Shapes:
    keys = [(d, k) for d in (*DEGREES, DEGREES[-1] + 2) for k in widths if 2 * k >= d]
    shapes = np.stack([weights(k, d, order, max(widths)) for d, k in keys], axis=1)
    moments = np.array(
        [_moment(shape, d + order) for shape, (d, _) in zip(shapes.T, keys, strict=True)]
    )
    pilot = np.array([_pilot(key, keys) for key in keys])
    same = np.array([keys[p][0] == d for p, (d, _) in zip(pilot, keys, strict=True)])
    ratio = np.abs(moments[pilot] / moments)
    share = np.where(same & (ratio < 1), 1 / (1 - np.where(ratio < 1, ratio, 0.0)), 0.0)
    rough, apart = np.sum(shapes**2, axis=0), np.sum((shapes - shapes[:, pilot]) ** 2, axis=0)
    return _Shapes(keys, shapes, pilot, share, moments, rough, apart)


def _level(log: SampledSignal, rung: _Rung, order: int) -> _Level | None:
    """The candidates of one rung, `None` where no window of the widest is whole."""
    block, widths, least = rung
    fitting = _fitting(log, block, widths)
    uneven = not fitting
    if max(fitting, default=0) < least and (block > 1 or fitting):
        return None
    widths = fitting or widths
    keys, shapes, pilot, share, moments, rough, apart = _shapes(tuple(widths), order)
    reach = max(widths)
    if not uneven:
        # A bias is that of the few corners of a motion, so that its mean square is known the better
        # the more of them are seen.
        many = max(CENTRES, NUMBERS // (2 * reach + 1))
        centres = log.centres(block * reach + block // 2, many)
        slopes = log.windows(centres, block, reach) @ shapes
        # A block's mean has less noise.
        rough, apart = rough / block, apart / block
    else:
        found = log.exact_slopes(keys, reach, order)
        if found is None:
            return None
        slopes, rough, apart = found[0], found[1], found[2](pilot)
    power = np.mean((slopes - slopes[:, pilot]) ** 2, axis=0)
    scale = block**order
    offered = np.array([d <= DEGREES[-1] and k >= least for d, k in keys])
    moments = moments * np.array([float(block) ** d for d, _ in keys])
    return _Level(
        [(d, k * block) for d, k in keys],
        offered, power / scale**2, share, moments, rough / scale**2, apart / scale**2,
    )  # fmt: skip


def _fitting(log: SampledSignal, block: int, widths: list[int]) -> list[int]:
    """Those of the widths that most samples have all their neighbours for, between the gaps."""
    half = np.count_nonzero(log.valid) // 2
    for count in range(len(widths), 0, -1):
        reach = block * widths[count - 1] + block // 2
        if len(log.whole(reach)) >= half and len(log.centres(reach)) >= FEWEST:
            return widths[:count]
    return []


def _moment(shape: np.ndarray, power: int) -> float:
    """The moment of that power: of the degree and the order, the lowest that the weights do not
    annul, which makes their bias.
    """
    return float(shape @ (np.arange(len(shape)) - len(shape) // 2.0) ** power)


def _pilot(key: tuple[int, int], keys: list[tuple[int, int]]) -> int:
    """The candidate by which the bias of another shows: half as wide, or of the next degree."""
    degree, width = key
    half = [k for d, k in keys if d == degree and 2 * k <= width]
    if half:
        return keys.index((degree, max(half)))
    above = [k for d, k in keys if d == degree + 2]
    return keys.index((degree + 2, min(above))) if above else keys.index(key)
