"""Eight ways to identify asymmetric Coulomb and viscous friction, on many records at once.

A `Record` holds draws side by side, signals of shape `(N, R)`. Each method returns the parameters
`(R, 4)`: Coulomb and viscous, forward then backward, N and N·s/m. All see the same velocity. What
needs a mass is told one, or fits it.
"""

from typing import NamedTuple

import numpy as np
from scipy.signal import butter, filtfilt

# The recipe of the EMPS benchmark: 4th-order Butterworth without phase lag, then decimation.
CORNER, DECIMATE = 100.0, 10
HARMONICS = 25
# Of the top speed: slower samples tell of the direction's noise.
SLOWEST = 0.02


class Record(NamedTuple):
    """Interval, s; position, velocity, smoothed and plain acceleration, force, `(N, R)`; samples a
    period; the mass that a method is told, kg.
    """

    step: float
    position: np.ndarray
    velocity: np.ndarray
    smooth: np.ndarray
    rough: np.ndarray
    force: np.ndarray
    period: int
    mass: float


def prepared(step, position, force, period, mass):
    """The record with its derivatives: of the filtered position, and plain second differences."""
    low = _low(position, step)
    velocity = np.gradient(low, step, axis=0)
    rough = np.zeros_like(position)
    rough[1:-1] = np.diff(position, 2, axis=0) / step**2
    return Record(
        step, position, velocity, np.gradient(velocity, step, axis=0), rough, force, period, mass
    )


def _low(signal, step):
    b, a = butter(4, CORNER * 2 * step)
    return filtfilt(b, a, signal, axis=0)


def columns(velocity, rest=False):
    """Coulomb and viscous friction of both directions, `(N, R, 4)`; zero near rest, if left out.

    Methods that mix neighbouring samples can leave none out: `rest`.
    """
    slowest = 0.0 if rest else SLOWEST * np.quantile(np.abs(velocity), 0.98)
    up, down = velocity > slowest, velocity < -slowest
    return np.stack([1.0 * up, velocity * up, -1.0 * down, velocity * down], axis=-1)


def solve(design, target):
    """Least squares of each draw: `(N, R, p)` and `(N, R)` to `(R, p)`."""
    size = np.sqrt(np.mean(design**2, axis=0)) + 1e-300
    scaled = design / size
    square = np.einsum("nrp,nrq->rpq", scaled, scaled)
    square += 1e-12 * len(design) * np.eye(design.shape[-1])
    shared = np.einsum("nrp,nr->rp", scaled, target)
    return np.linalg.solve(square, shared[..., None])[..., 0] / size


def _slipping(design, *signals):
    moving = np.any(design != 0, axis=-1)
    return [np.where(moving, signal, 0.0) for signal in signals]


def _adaptive(record):
    """Scaled columns with the filtered acceleration, their scale, and the force; zero near rest."""
    friction = columns(record.velocity)
    acceleration, force = _slipping(friction, record.smooth, record.force)
    design = np.concatenate([acceleration[..., None], friction], axis=-1)
    size = np.sqrt(np.mean(design**2, axis=0)) + 1e-300
    return design / size, size, force


def problem_l(record):
    """Problem (L), eqs. (18), (19): the longest stretch that ends at the velocity of its start."""
    found = []
    for r in range(record.force.shape[1]):
        first, last = closed(record.velocity[:, r])
        part = slice(first, last)
        design = columns(record.velocity[part, r : r + 1])
        target = _slipping(design, record.force[part, r : r + 1])[0]
        found.append(solve(design, target)[0])
    return np.array(found)


def closed(velocity):
    """Ends of the longest stretch whose first and last velocity are equal."""
    levels = np.quantile(velocity, np.linspace(0.05, 0.95, 19))
    best = (0, 1)
    for level in levels:
        cross = np.flatnonzero(np.diff(np.sign(velocity - level)) != 0)
        if cross.size > 1 and cross[-1] - cross[0] > best[1] - best[0]:
            best = int(cross[0]) + 1, int(cross[-1]) + 1
    if abs(velocity[-1] - velocity[0]) < 1e-3 * np.ptp(velocity):
        best = (0, velocity.size)
    return best


def problem_p(record):
    """Problem (P), eq. (8): mass fitted, acceleration by second differences."""
    design = columns(record.velocity)
    rough, target = _slipping(design, record.rough, record.force)
    return solve(np.concatenate([rough[..., None], design], axis=-1), target)[:, 1:]


def problem_p_told(record):
    """Problem (P) with the mass that it is told."""
    design = columns(record.velocity)
    target = _slipping(design, record.force - record.mass * record.rough)[0]
    return solve(design, target)


def inverse_dynamics(record):
    """The EMPS recipe: mass fitted; columns and force through one filter, then every tenth row."""
    design = columns(record.velocity, rest=True)
    design = np.concatenate([record.smooth[..., None], design], axis=-1)
    rows = _low(np.concatenate([design, record.force[..., None]], axis=-1), record.step)
    rows = rows[DECIMATE::DECIMATE][:-1]
    return solve(rows[..., :-1], rows[..., -1])[:, 1:]


def recursive(record, forget=2.0):
    """Recursive least squares that forgets in two periods, mass fitted, filtered acceleration."""
    design, size, forces = _adaptive(record)
    keep = np.exp(-1 / (forget * record.period))
    theta = np.zeros(size.shape)
    matrix = np.repeat(1e6 * np.eye(5)[None], len(theta), axis=0)
    for row, force in zip(design, forces, strict=True):
        slips = row.any(axis=1)[:, None]
        turned = np.einsum("rpq,rq->rp", matrix, row)
        gain = turned / (keep + np.sum(row * turned, axis=1))[:, None]
        theta = theta + gain * (force - np.sum(row * theta, axis=1))[:, None]
        after = (matrix - gain[:, :, None] * turned[:, None]) / keep
        matrix = np.where(slips[..., None], after, matrix)
    return (theta / size)[:, 1:]


def least_mean_squares(record, step=0.01):
    """Normalised least mean squares on the same columns (Widrow & Hoff 1960), step 0.01."""
    design, size, forces = _adaptive(record)
    theta = np.zeros(size.shape)
    for row, force in zip(design, forces, strict=True):
        power = np.sum(row**2, axis=1)
        error = force - np.sum(row * theta, axis=1)
        theta = theta + step * (error / (power + 1e-9))[:, None] * row
    return (theta / size)[:, 1:]


def sequential(record):
    """Coulomb friction first, from the slow fifth of the speeds; then viscous from what is left.

    What the title of Elhami & Brookfield (1997) says, in a form of ours: neither paper nor its
    abstract was at hand. The mass is told.
    """
    design = columns(record.velocity)
    target = _slipping(design, record.force - record.mass * record.smooth)[0]
    slow = np.abs(record.velocity) < 0.2 * np.quantile(np.abs(record.velocity), 0.98)
    coulomb = design[..., [0, 2]]
    first = solve(np.where(slow[..., None], coulomb, 0.0), np.where(slow, target, 0.0))
    left = target - np.einsum("nrp,rp->nr", coulomb, first)
    second = solve(design[..., [1, 3]], left)
    return np.stack([first[:, 0], second[:, 0], first[:, 1], second[:, 1]], axis=1)


def frequency_domain(record):
    """The equation's mean and first harmonics over whole periods; −(kω)² X_k is the acceleration.

    What the title of Kim & Ha (2001) says, in a form of ours: neither their paper nor its abstract
    was at hand. NaN without a whole period. Mass fitted.
    """
    whole = (len(record.force) - 1) // record.period * record.period
    if not whole:
        return np.full((record.force.shape[1], 4), np.nan)
    kept = np.arange(HARMONICS + 1) * (whole // record.period)
    part = slice(0, whole)
    design = np.fft.rfft(columns(record.velocity[part], rest=True), axis=0)[kept]
    position, force = (np.fft.rfft(x[part], axis=0)[kept] for x in (record.position, record.force))
    rate = 2 * np.pi * kept / (whole * record.step)
    acceleration = -(rate[:, None] ** 2) * position
    design = np.concatenate([acceleration[..., None], design], axis=-1)
    both = np.concatenate([design.real, design.imag])
    return solve(both, np.concatenate([force.real, force.imag]))[:, 1:]


METHODS = {
    "(L)": problem_l,
    "(P), mass fitted": problem_p,
    "(P), mass told": problem_p_told,
    "IDIM-LS": inverse_dynamics,
    "frequency domain": frequency_domain,
    "sequential, mass told": sequential,
    "RLS": recursive,
    "LMS": least_mean_squares,
}
