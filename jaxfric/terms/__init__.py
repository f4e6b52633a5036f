"""The physics: one law, one class, one displayed equation."""

from .base import (
    AbstractLaw as AbstractLaw,
    AbstractTerm as AbstractTerm,
    Directional as Directional,
    Parameter as Parameter,
    Sample as Sample,
    Sum as Sum,
)
from .friction import (
    Coulomb as Coulomb,
    Exponential as Exponential,
    Gaussian as Gaussian,
    Generalised as Generalised,
    Lorentzian as Lorentzian,
    Viscous as Viscous,
)
from .inertia import Inertia as Inertia, Offset as Offset
