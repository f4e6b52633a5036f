"""Other programs' simulators as baselines: their force along the recorded motion, as it is."""

from . import closed as closed
from .known import (
    AbstractSimulator as AbstractSimulator,
    Attribute as Attribute,
    Known as Known,
    along as along,
    same_motion as same_motion,
)
from .multibody import Mujoco as Mujoco, mujoco as mujoco
