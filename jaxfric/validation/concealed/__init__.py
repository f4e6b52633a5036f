"""Machines drawn at random with something concealed in them: for the demo, the tests, `prove`."""

from .drawing import draw as draw
from .kinds import OUTSIDE as OUTSIDE, names as names
from .machines import Machine as Machine, Noise as Noise, Plan as Plan
from .runs import Run as Run, record as record
