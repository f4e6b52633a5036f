"""After what time a motion repeats itself to a count of its encoder.

Then the roundings of the position repeat, and so do the controller's answers to them. What they
leave in a residual does not differ from period to period, as noise does: it has lines at multiples
of the motion's frequency, and blocks that see the same motion agree on it.
"""

import numpy as np
from jaxtyping import Float

from ..data.excerpt import MOST
from ..data.recording import Recording

# The motion repeats where most samples that move are in the same count again.
SAME = 0.5
# Of a counted position steps of one count are a hundredth of all at least, about the reversals; of
# one that is not, the smallest of thousands is far below.
ONE, SLOW = 0.5, 0.01
# Lags at which the steps of the position are most like themselves that are looked at: sums of a few
# sines are nearly the same again after many times.
LAGS = 32


def repeated_after(recording: Recording) -> float:
    """The shortest time, s, after which most samples that move are in the same count again.

    Zero where there is none in half of the record, where the samples, `(N,)`, are not equally
    spaced, and where the position is not counted. A count is the smallest change: decimals of a log
    make no two of them quite alike.
    """
    if recording.position is None or not np.asarray(recording.mask)[:MOST].all():
        return 0.0
    position, time = (np.asarray(x, float)[:MOST] for x in (recording.position, recording.time))
    changes, steps = np.abs(np.diff(position)), np.diff(time)
    if not changes.any():
        return 0.0
    count, step = float(changes[changes > 0].min()), float(np.median(steps))
    if count < ONE * np.quantile(changes[changes > 0], SLOW):
        return 0.0
    if np.any(np.abs(steps - step) > 0.5 * step):
        return 0.0
    moving = changes > 0
    for lag in _lags(position):
        same = np.abs(position[1 + lag :] - position[1:-lag]) < 0.5 * count
        if np.count_nonzero(same & moving[lag:]) > SAME * np.count_nonzero(moving[lag:]):
            return float(lag * step)
    return 0.0


def _lags(position: Float[np.ndarray, " N"]) -> list[int]:
    """Lags, in samples, after which the steps differ least, the shortest first, once the position
    has been elsewhere: of a slow one most samples are in the count of the one before.
    """
    most = len(position) // 2
    if most < 3:
        return []
    apart = _apart(np.diff(position), most)
    least = 1 + np.flatnonzero((apart[1:-1] <= apart[:-2]) & (apart[1:-1] <= apart[2:]))
    away = _apart(position, most) >= np.var(position)
    least = least[least > np.argmax(away)] if away.any() else least[:0]
    return sorted(least[np.argsort(apart[least])[:LAGS]].tolist())


def _apart(signal: Float[np.ndarray, " N"], most: int) -> Float[np.ndarray, " L"]:
    """The mean-square difference of a signal from itself, by lags up to `most`."""
    size, lag = len(signal), np.arange(most)
    centred = signal - signal.mean()
    longer = 1 << (2 * size - 1).bit_length()
    products = np.fft.irfft(np.abs(np.fft.rfft(centred, longer)) ** 2)[:most]
    squares = np.pad(np.cumsum(centred**2), (1, 0))
    return (squares[size - lag] + squares[-1] - squares[lag] - 2 * products) / (size - lag)
