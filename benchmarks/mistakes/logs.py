"""A log as a person would hand it over: columns, their names, and what nobody knows who has it."""

import csv
import io
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

# Roles in the order in which they are written.
ROLES = ("time", "position", "velocity", "force", "reference")
# Beside them, what no file holds: by it is judged what is said of a derivative.
TRUE_VELOCITY = "true velocity"
# Names that loggers give the columns; each set states no unit.
PLAIN = (
    {"time": "time", "position": "position", "velocity": "velocity", "force": "force"},
    {"time": "t", "position": "q", "velocity": "qd", "force": "tau"},
    {"time": "timestamp", "position": "angle", "velocity": "omega", "force": "torque"},
    {"time": "t", "position": "x", "velocity": "v", "force": "current"},
)


class Text(NamedTuple):
    """How the numbers are spelled: between cells, before decimals, and what is done at last."""

    delimiter: str = ","
    decimal: str = "."
    digits: int = 12
    finish: Callable[[list[str]], list[str]] = list


class Log(NamedTuple):
    """One recording of one axis before it is written.

    - `columns`: role to `(N,)`; `names`: role to the name in the header.
    - `truth`: the parameters that a right answer has, in the units that the log claims: Coulomb
      and viscous friction of each direction (a constant force counts to the Coulomb friction of
      both), the Stribeck force, and the inertia.
    - `top` and `hardest`: 98 % of the true speeds and accelerations are below.
    - `cycle`: samples a cycle of the fastest motion.
    - `model`: name of the model that is right for it.
    - `machine`: what it was drawn from, for the report.
    - `lacks`: whether that model lacks a force of the machine, so that saying so is right.
    - `text`: how it is written.
    """

    columns: Mapping[str, np.ndarray]
    names: Mapping[str, str]
    truth: Mapping[str, float]
    top: float
    hardest: float
    cycle: float
    model: str
    machine: str
    lacks: bool = False
    text: Text = Text()

    @property
    def size(self) -> int:
        """The number of rows."""
        return len(self.columns["time"])

    def having(self, **columns: np.ndarray | None) -> "Log":
        """The log with other columns; `None` takes one away."""
        both = {**self.columns, **columns}
        return self._replace(columns={k: v for k, v in both.items() if v is not None})

    def called(self, **names: str) -> "Log":
        """The log with other names in its header."""
        return self._replace(names={**self.names, **names})

    def rows(self, index: np.ndarray) -> "Log":
        """Some of its rows, in that order."""
        return self._replace(columns={k: v[index] for k, v in self.columns.items()})

    def scaled(self, force: float = 1.0, position: float = 1.0, time: float = 1.0) -> "Log":
        """The same axis in other units: every column and the truth change together."""
        speed = position / time
        factors = {"time": time, "position": position, "reference": position}
        factors |= {"velocity": speed, TRUE_VELOCITY: speed, "force": force}
        kinds = {"coulomb": force, "stribeck_force": force, "viscous": force / speed}
        kinds |= {"inertia": force * time / speed, "stribeck_velocity": speed}
        return self._replace(
            columns={k: v * factors[k] for k, v in self.columns.items()},
            truth={k: v * kinds[k.rstrip("+-")] for k, v in self.truth.items()},
            top=self.top * speed,
            hardest=self.hardest * speed / time,
        )

    def without_velocity(self) -> "Log":
        """As most encoders' logs are."""
        return self.having(velocity=None)


class Pair(NamedTuple):
    """The log to identify and a second run of the same machine."""

    log: Log
    holdout: Log


def spelled(log: Log) -> str:
    """The text of a file."""
    roles = [role for role in ROLES if role in log.columns]
    values = np.column_stack([log.columns[role] for role in roles])
    buffer = io.StringIO()
    np.savetxt(buffer, values, fmt=f"%.{log.text.digits}g", delimiter="\t")
    body = buffer.getvalue()
    if log.text.decimal != ".":
        body = body.replace(".", log.text.decimal)
    rows = body.replace("\t", log.text.delimiter).splitlines()
    head = io.StringIO()
    writer = csv.writer(head, delimiter=log.text.delimiter, lineterminator="")
    writer.writerow([log.names.get(role, role) for role in roles])
    return "\n".join(log.text.finish([head.getvalue(), *rows])) + "\n"


def log_uniform(rng: Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
