"""Friction identified while the axis runs: the second open issue of Kim, Kim & Ha (2004)."""

from .chart import Chart as Chart, threshold as threshold
from .follower import Change as Change, Follower as Follower
from .generated import c_source as c_source
from .moments import State as State, reference as reference, start as start, update as update
from .precision import Assessment as Assessment
from .solving import Solution as Solution, solve as solve
