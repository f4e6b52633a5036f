"""Cases of a hunt: a machine, and, three times in four, one mistake made with its log."""

from typing import NamedTuple

import numpy as np

from . import sources
from .logs import Log, Pair, log_uniform
from .mistake import Mistake
from .mistakes import MISTAKES

# Of so many cases one is healthy.
HEALTHY_EVERY = 4
# Of so many cases one is explained too; it takes ten times as long.
EXPLAINED_EVERY = 10


class Case(NamedTuple):
    """The same seed, number and sources are the same files."""

    seed: int
    number: int
    unseen: bool = False


class Made(NamedTuple):
    """What a case consists of.

    `log` and `holdout` as handed over; `healthy`: the log before the mistake; `mistake`: `None`
    where there is none; `explained`: whether `explain` is asked too.
    """

    log: Log
    holdout: Log
    healthy: Log
    mistake: Mistake | None
    explained: bool


def mistake_of(case: Case) -> Mistake | None:
    """The mistake of a case; the kinds take turns."""
    if case.number % HEALTHY_EVERY == 0:
        return None
    return MISTAKES[(case.number - case.number // HEALTHY_EVERY - 1) % len(MISTAKES)]


def make(case: Case) -> Made:
    """The logs of a case."""
    rng = np.random.default_rng((case.seed, int(case.unseen), case.number))
    turn = int(rng.integers(1 << 16))
    pair = sources.draw(rng, turn, case.unseen)
    mistake = mistake_of(case)
    beside = rng.random() < 0.5 if mistake is None or mistake.velocity is None else mistake.velocity
    if not beside:
        pair = Pair(*(log.without_velocity() for log in pair))
    other = _sibling(pair.holdout, rng)
    explained = case.number % EXPLAINED_EVERY == 0
    if mistake is None:
        seed = int(rng.integers(1 << 31))
        log, held = (_varied(log, np.random.default_rng(seed)) for log in pair)
        return Made(log, held, log, None, explained)
    if mistake.held_out:
        return Made(pair.log, mistake.apply(pair.holdout, rng, other), pair.log, mistake, True)
    # The held-out log is written by the same hand.
    seed = int(rng.integers(1 << 31))
    log, held = (mistake.apply(x, np.random.default_rng(seed), other) for x in pair)
    return Made(log, held, pair.log, mistake, explained)


def _sibling(log: Log, rng) -> Log:
    """Another axis of the same machine: its forces and its stroke are other ones."""
    force, stroke = (
        log_uniform(rng, 1.8, 6.0) ** (1 if rng.random() < 0.5 else -1) for _ in range(2)
    )
    return log.scaled(force=force, position=stroke)


def _varied(log: Log, rng) -> Log:
    """Honest variety of spelling: stated units, decimal commas, an origin of the clock."""
    choice = rng.integers(5)
    if choice == 0:
        names = {"time": "Time [s]", "position": "Position [mm]", "velocity": "Velocity [mm/s]"}
        return log.scaled(position=1e3).called(**names, force="Force [N]")
    if choice == 1:
        return log._replace(text=log.text._replace(delimiter=";", decimal=","))
    if choice == 2:
        later = log.columns["time"] + 1e4 * rng.random()
        return log.having(time=later)._replace(text=log.text._replace(digits=15))
    return log
