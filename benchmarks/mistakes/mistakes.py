"""Every kind of mistake, in the order in which cases go through them."""

from . import clocks, formats, scales, sensors
from .mistake import Mistake

MISTAKES: tuple[Mistake, ...] = (
    *scales.MISTAKES, *sensors.MISTAKES, *clocks.MISTAKES, *formats.MISTAKES
)  # fmt: skip
