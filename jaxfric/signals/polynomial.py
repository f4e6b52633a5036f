"""Weights of derivatives by local polynomials on an even clock, and the ladder of their widths."""

from typing import NamedTuple

import numpy as np

from .kernels import kernel

# Half-widths, in samples, of the ladder: steps of about √2, which change the noise of a derivative
# by √2³ = 2.8. From the third octave on the signal may be averaged in blocks first.
HALF_WIDTHS = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
WIDE = (128, 192, 256)
BLOCKS = (3, 9, 27)
# Degrees of the polynomial. A higher one takes less off the motion at the same width: at six
# samples a cycle the narrowest of degree six errs by 1 %, that of degree two by 17 %.
DEGREES = (2, 4, 6)


class Choice(NamedTuple):
    """A local polynomial: its degree, its half-width in samples, and the error that it makes.

    `error`: root mean square of bias and noise of the derivative, in its own unit; `bias`: that of
    the bias alone; `noise`: standard deviation of the signal's white noise, in the signal's unit.
    """

    degree: int
    half_width: int
    error: float = float("nan")
    bias: float = float("nan")
    noise: float = float("nan")

    @property
    def reach(self) -> int:
        """So many samples on either side decide on the derivative, blocks of them included."""
        return self.half_width + 4 * BLOCKS[-1]


def weights(half_width: float, degree: int, order: int = 1, reach: int | None = None) -> np.ndarray:
    """Weights of the derivative at the middle of an even clock of one second, `(2 reach + 1,)`.

    Least squares of a polynomial, weighted by (1 − τ²)⁴ with τ = 1 half a sample beyond the
    half-width (Savitzky & Golay 1964, with a tapered weight). `order`: 1 or 2.
    """
    reach = int(half_width) if reach is None else reach
    tau = np.arange(-reach, reach + 1) / (half_width + 0.5)
    weight = kernel(tau)
    # By symmetry the powers of the other parity have no part in it.
    powers = tau[:, None] ** np.arange(order % 2, degree + 1, 2)
    wanted = np.zeros(powers.shape[1])
    wanted[order // 2] = order  # 1! and 2!
    solved = np.linalg.solve(powers.T @ (weight[:, None] * powers), wanted)
    return weight * (powers @ solved) / (half_width + 0.5) ** order


def smoothing(choice: Choice) -> float:
    """By how much a chosen derivative smooths the velocity, in samples².

    The velocity less that times its second difference is what was smoothed, to first order: a
    sixth of the third moment of the weights, which degrees above two annul.
    """
    if choice.degree > DEGREES[0]:
        return 0.0
    offsets = np.arange(-choice.half_width, choice.half_width + 1.0)
    return float(weights(choice.half_width, choice.degree) @ offsets**3) / 6
