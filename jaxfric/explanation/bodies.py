"""What the bodies of a robot weigh, by all joints that move them together.

A joint's force is linear in ten parameters of each body (mass, first moment, inertia about its
frame), and these are what a file's numbers make of them: m c and I + m (c² 1 − c cᵀ) are no linear
functions of mass and centre. So the fewest of the file's numbers that leave no joint more than all
the linear parameters do are looked for by Gauss-Newton's steps, each set by itself, with one value
of each number for all joints.
"""

import itertools
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..identification.uncertainty import Estimate
from ..simulators.rigid import PARAMETERS
from ..simulators.weights import MASS, MASS_ALONE, Weight, attribute
from .intervals import spread
from .joint_rows import JointRows
from .least_squares import orthonormal
from .mismatch import SURE
from .regression import Fit

MASSES = MASS, MASS_ALONE
# A robot's values by name, those that differ from the simulator's; of a joint's own the change.
State = dict[str, float]
# Sets of one number fewer to which each other number is added, and numbers that are tried with
# each: those that would take most if all were linear. Wider beams find nothing that these do not
# where one or two numbers are wrong, for then all sets of two are tried with the best of one.
BEAM, TRIED = 8, 16
# Steps of Gauss and Newton, which converge in four or five; halvings of one; a gain that ends them,
# as a part of the energy; the step of a numerical derivative, as a part of a value's own size.
STEPS, HALVINGS, NO_GAIN, STEP = 20, 8, 1e-9, 1e-4
# A number that adds less than this to the energy of the force, by a change of its own size, is not
# seen but for rounding.
UNSEEN = 1e-12


class Answer(NamedTuple):
    """What all joints say together: the values that differ by name, with `estimates`, and what else
    would do as well in place of each, `instead`.
    """

    values: State
    estimates: dict[str, Estimate]
    instead: dict[str, tuple[str, ...]]


class Bodies:
    """The rows of all joints, and the numbers of a model's file that their forces depend on."""

    def __init__(
        self,
        joints: Sequence[JointRows],
        weights: Mapping[str, Weight],
        apart: Collection[str] = (),
    ):
        """`apart`: bodies whose mass and inertia are numbers apart from each other in the file."""
        self.joints, self.weights, self.apart = joints, weights, apart
        own = [f"{joint.name}:{name}" for joint in joints for name in joint.own]
        self.place = {name: i for i, name in enumerate(own)}
        self.before = dict.fromkeys(own, 0.0)
        self.owner: dict[str, tuple[str, str]] = {}
        for body, weight in weights.items():
            for what, value in weight.values().items():
                self.owner[f"body/{body}/{what}"] = body, what
                self.before[f"body/{body}/{what}"] = value
        self.starts = {body: len(own) + PARAMETERS * i for i, body in enumerate(weights)}
        count = len(own) + PARAMETERS * len(weights)
        self.grams = np.zeros((len(joints), count, count))
        self.pulls, self.pull = np.zeros((len(joints), count)), np.zeros(count)
        self.powers = np.array([joint.target @ joint.target for joint in joints])
        self.enough = np.array([joint.enough for joint in joints])
        for k, joint in enumerate(joints):
            at = self._at(k)
            self.grams[k][np.ix_(at, at)] = joint.columns.T @ joint.columns
            self.pulls[k][at] = joint.columns.T @ joint.target
        self.gram, self.pull = self.grams.sum(axis=0), self.pulls.sum(axis=0)
        size = np.sqrt(np.maximum(np.diag(self.gram), 1e-300))
        scaled = self.gram / np.outer(size, size)
        every = np.linalg.lstsq(scaled, self.pull / size, rcond=1e-12)[0] / size
        self.least = self._energies(every)

    def _at(self, number: int) -> list[int]:
        """Where the columns of a joint stand among those of all."""
        first = sum(len(joint.own) for joint in self.joints[:number])
        own = list(range(first, first + len(self.joints[number].own)))
        return own + list(range(len(self.place), len(self.pull)))

    def _energies(self, shift: np.ndarray) -> np.ndarray:
        """The energy that a shift of all linear parameters leaves of each joint, in its noise's."""
        bent = np.einsum("i,kij,j->k", shift, self.grams, shift)
        return self.powers - 2 * self.pulls @ shift + bent

    def energies(self, state: State) -> np.ndarray:
        """What a state leaves of each joint, in units of its noise's energy, `(joints,)`."""
        return self._energies(self.shift(state))

    def shift(self, state: State) -> np.ndarray:
        """By how much the linear parameters differ from the simulator's.

        **Raises:** `ValueError` for a body that cannot be.
        """
        found = np.zeros(len(self.pull))
        for name in state.keys() & self.place.keys():
            found[self.place[name]] = state[name]
        for body in {self.owner[n][0] for n in state if n in self.owner}:
            start = self.starts[body]
            new = self.weight(body, state).parameters()
            found[start : start + PARAMETERS] = new - self.weights[body].parameters()
        return found

    def weight(self, body: str, state: State) -> Weight:
        """What a body weighs in a state."""
        owned = ((self.owner[n], v) for n, v in state.items() if n in self.owner)
        return self.weights[body].with_values({what: v for (b, what), v in owned if b == body})

    def value(self, name: str, state: State) -> float:
        """A number in a state that may not hold it, as it goes along with the others."""
        if name in state or name in self.place:
            return state.get(name, 0.0)
        body, what = self.owner[name]
        return self.weight(body, state).values()[what]

    def _size(self, name: str) -> float:
        """The size of a number, that of zero too."""
        if name in self.place:
            return 1.0
        body, what = self.owner[name]
        weight = self.weights[body]
        sizes = {"mass": weight.mass, "centre": weight.extent()}
        return sizes.get(what.partition("_")[0], weight.mass * weight.extent() ** 2)

    def slopes(self, names: Iterable[str], state: State) -> np.ndarray:
        """Derivatives of the linear parameters by the numbers of those names, `(count, names)`."""
        found = []
        for name in names:
            if name in self.place:
                found.append(np.eye(1, len(self.pull), self.place[name])[0])
                continue
            value, sides = self.value(name, state), []
            for step in STEP * self._size(name) * np.array([1.0, -1.0, 0.0]):
                try:
                    sides.append((value + step, self.shift({**state, name: value + step})))
                except ValueError:
                    continue
            (a, one), (b, other) = sides[0], sides[1]
            found.append((one - other) / (a - b))
        return np.array(found).T

    def fitted(self, names: Iterable[str], start: State) -> tuple[float, State]:
        """Those numbers by least squares over all joints, from a state; the energy that is left."""
        names = list(names)
        state = {name: self.value(name, start) for name in names}
        try:
            energy = float(self.energies(state).sum())
        except ValueError:
            return np.inf, state
        for _ in range(STEPS):
            slopes = self.slopes(names, state)
            size = np.sqrt(np.maximum(np.sum(slopes * (self.gram @ slopes), axis=0), 1e-300))
            inner = slopes.T @ self.gram @ slopes / np.outer(size, size)
            outer = slopes.T @ (self.pull - self.gram @ self.shift(state)) / size
            if not np.isfinite(inner).all():
                return np.inf, state
            step = np.linalg.lstsq(inner, outer, rcond=1e-10)[0] / size
            before = energy
            for part in 0.5 ** np.arange(HALVINGS):
                moved = {n: state[n] + part * s for n, s in zip(names, step, strict=True)}
                try:
                    left = float(self.energies(moved).sum())
                except ValueError:
                    continue
                if left < energy:
                    energy, state = left, moved
                    break
            if before - energy <= NO_GAIN * before:
                break
        return energy, state

    def fewest(self) -> State:
        """The numbers of the fewest bodies that leave no joint more than all linear parameters do,
        and the fewest of these: one part of a machine is wrong sooner than two.
        """
        found = self._fewest(frozenset(self.weights))
        bodies = sorted({self.owner[n][0] for n in found if n in self.owner})
        for count in range(1, len(bodies)):
            for some in itertools.combinations(bodies, count):
                fewer = self._fewest(frozenset(some))
                if np.all(self.energies(fewer) <= self.energies(found) + self.enough):
                    return fewer
        return found

    def _fewest(self, bodies: frozenset[str]) -> State:
        """The fewest numbers of joints and those bodies that leave no more than all do.

        Each of them beyond its noise; among sets that do as well, the one that changes least.
        """
        found, beam = State(), [State()]
        while np.any(self.energies(found) - self.least > self.enough):
            tried: dict[frozenset[str], tuple[float, State]] = {}
            for state in beam:
                for name in self._promising(state, bodies):
                    names = frozenset({*state, name})
                    if names not in tried:
                        tried[names] = self.fitted([*state, name], state)
            best = sorted(tried.values(), key=lambda each: each[0])[:BEAM]
            beam = [state for energy, state in best if np.isfinite(energy)]
            sure = [state for state in beam if self.sure(state)]
            if not sure:
                break
            alike = self.energies(sure[0]) + self.enough
            sure = [state for state in sure if np.all(self.energies(state) <= alike)]
            found = min(sure, key=self.changed)
        return found

    def _others(self, state: State) -> list[str]:
        """The numbers beside a state's; of a body's mass no second one."""
        twins = {f"body/{self.owner[n][0]}/{w}" for n in state if "/mass" in n for w in MASSES}
        return [n for n in self.before if n not in state and n not in twins]

    def _promising(self, state: State, bodies: frozenset[str]) -> list[str]:
        """The numbers beside a state's that would take most, were they linear."""
        names = [n for n in self._others(state) if n in self.place or self.owner[n][0] in bodies]
        mine, slopes = self.slopes(state, state), self.slopes(names, state)
        rest = self.pull - self.gram @ self.shift(state)
        if len(state):
            inner = np.linalg.pinv(mine.T @ self.gram @ mine, rcond=1e-12)
            slopes = slopes - mine @ (inner @ (mine.T @ self.gram @ slopes))
        sizes = np.sum(slopes * (self.gram @ slopes), axis=0)
        seen = sizes * np.array([self._size(n) ** 2 for n in names]) > UNSEEN * self.powers.sum()
        gains = np.where(seen, (rest @ slopes) ** 2 / np.maximum(sizes, 1e-300), 0.0)
        return [names[i] for i in np.argsort(-gains, kind="stable")[:TRIED] if gains[i] > 0]

    def changed(self, state: State) -> float:
        """By how much a state's numbers differ from the simulator's, a part of each, summed; where
        a mass takes more than one number of the file, that counts as another one.
        """
        found = 0.0
        for name, value in state.items():
            if name in self.place:
                found += 1.0
                continue
            before, size = self.before[name], abs(value - self.before[name])
            found += size / (abs(value) + abs(before))
            body, what = self.owner[name]
            found += {MASS: body in self.apart, MASS_ALONE: body not in self.apart}.get(what, 0)
        return found

    def _rows(self, names: Sequence[str], state: State) -> Fit:
        """The rows of all joints at a state, as a fit with the derivatives by those numbers."""
        slopes, shift = self.slopes(names, state), self.shift(state)
        columns, left = [], []
        for k, joint in enumerate(self.joints):
            columns.append(joint.columns @ slopes[self._at(k)])
            left.append(joint.target - joint.columns @ shift[self._at(k)])
        residual, whole = np.concatenate(left), np.concatenate(columns)
        empty = np.zeros((len(whole), 0))
        values = (np.array([self.value(name, state) for name in names]),)
        return Fit((), (), values, whole, empty, residual, float(residual @ residual))

    @property
    def block(self) -> np.ndarray:
        """The number of each row's block, of one joint after the other."""
        counts = np.cumsum([0, *(joint.block[-1] + 1 for joint in self.joints)])
        return np.concatenate([j.block + c for j, c in zip(self.joints, counts[:-1], strict=True)])

    def estimates(self, state: State) -> dict[str, Estimate]:
        """The numbers of a state with their standard errors, from blocks of all joints' rows."""
        names = list(state)
        known = spread(self._rows(names, state), self.block)
        freedom = known.degrees_of_freedom(np.eye(len(names)))
        errors = np.sqrt(np.diag(known.covariance))
        return {
            name: Estimate(np.float64(state[name]), np.float64(error), self._unit(name), float(df))
            for name, error, df in zip(names, errors, freedom, strict=True)
        }

    def _unit(self, name: str) -> str:
        if name in self.place:
            return ""
        body, what = self.owner[name]
        return attribute(self.weights[body], body, what).unit

    def sure(self, state: State) -> bool:
        """Whether each number of a state differs from the simulator's beyond noise."""
        known = self.estimates(state)
        return all(
            abs(float(e.value) - self.before[n]) > SURE * float(e.standard_error)
            for n, e in known.items()
        )

    def instead(self, state: State) -> dict[str, tuple[str, ...]]:
        """To each number of a state, others that would do as well in its place.

        With these all joints together leave no more than noise like theirs takes for the number
        that is replaced, or each of them no more than a sensor of force resolves.
        """
        found = {}
        for name in state:
            rest = {n: v for n, v in state.items() if n != name}
            names = [n for n in self._others(rest) if n != name]
            energy, noise = self.energies(state), self._noise(name, rest, state)
            more = {n: self._left([*rest, n], rest) - energy for n in names}
            alike = (
                n for n, each in more.items()
                if each.sum() <= SURE**2 * noise or np.all(each <= self.enough)
            )  # fmt: skip
            if others := tuple(alike):
                found[name] = others
        return found

    def _left(self, names: Sequence[str], start: State) -> np.ndarray:
        """What the best values of some numbers leave of each joint, infinite for none that can be,
        `(joints,)`.
        """
        energy, state = self.fitted(names, start)
        return self.energies(state) if np.isfinite(energy) else np.full(len(self.joints), np.inf)

    def _noise(self, name: str, rest: State, state: State) -> float:
        """The energy that a number beside others takes of noise like what a state leaves."""
        rows = self._rows([*rest, name], state)
        beside = orthonormal(rows.columns[:, :-1])
        lone = rows.columns[:, -1] - beside @ (beside.T @ rows.columns[:, -1])
        size = max(float(np.linalg.norm(lone)), 1e-300)
        return float(np.sum(np.bincount(self.block, lone / size * rows.residual) ** 2))

    def answer(self) -> Answer:
        """The fewest numbers, how well they are known, and what else would do as well."""
        state = self.fewest()
        return Answer(state, self.estimates(state) if state else {}, self.instead(state))
