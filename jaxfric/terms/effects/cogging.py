"""Detent force of a motor, or the error of a screw or a gear."""

from ..effect import Effect, Waves, slowly
from ..position import Cogging

COGGING = Effect(
    "cogging",
    "Σ A_n sin(2πn x/p + φ_n)",
    "position",
    "A force periodic in position, period {pitch}, amplitude {amplitude}: cogging of a motor, or "
    "the error of a screw or a gear; an unbalance would repeat once per revolution",
    laws=(Cogging,),
    scaled=lambda scales: tuple(Cogging(harmonics=n) for n in (1, 2, 3)),
    coordinates=("position_lines", "position"),
    needs=frozenset({"position"}),
    confusable_with=("periodic_disturbance", "gravity_unbalance"),
    separate_by="Change the speed: a line in position keeps its pitch, a tone its frequency.",
    waves=lambda term: Waves("position", True, harmonics=term.harmonics),
    variant=slowly(
        "pitch",
        "A force varies slowly along the stroke, by {amplitude}: it does not repeat within the "
        "stroke",
    ),
)
