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
# Lags at which the steps of the position are most like themselves that are looked at: sums of a few
# sines are nearly the same again after many times.
LAGS = 32


def repeated_after(recording: Recording) -> float:
    """The shortest time, s, after which most samples that move are in the same count again.

    Zero where there is none in half of the record, and where the samples, `(N,)`, are not equally
    spaced. A count is the smallest change: decimals of a log make no two of them quite alike.
    """
    if recording.position is None or not np.asarray(recording.mask)[:MOST].all():
        return 0.0
    position, time = (np.asarray(x, float)[:MOST] for x in (recording.position, recording.time))
    changes, steps = np.abs(np.diff(position)), np.diff(time)
    if not changes.any():
        return 0.0
    count, step = float(changes[changes > 0].min()), float(np.median(steps))
    if np.any(np.abs(steps - step) > 0.5 * step):
        return 0.0
    moving = np.gradient(position) != 0
    for lag in _lags(np.diff(position)):
        same = np.abs(position[lag:] - position[:-lag]) < 0.5 * count
        if np.count_nonzero(same & moving[lag:]) > SAME * np.count_nonzero(moving[lag:]):
            return float(lag * step)
    return 0.0


def _lags(signal: Float[np.ndarray, " N"]) -> list[int]:
    """Lags, in samples, at which a signal differs least from itself, the shortest first."""
    size, most = len(signal), len(signal) // 2
    if most < 3:
        return []
    centred = signal - signal.mean()
    spectrum = np.fft.rfft(centred, 2 * size)
    products = np.fft.irfft(np.abs(spectrum) ** 2)[: most + 1]
    squares = np.pad(np.cumsum(centred**2), (1, 0))
    lag = np.arange(most + 1)
    apart = (squares[size - lag] + squares[-1] - squares[lag] - 2 * products) / (size - lag)
    inner = apart[1:-1]
    least = 1 + np.flatnonzero((inner <= apart[:-2]) & (inner <= apart[2:]))
    return sorted(least[np.argsort(apart[least])[:LAGS]].tolist())
