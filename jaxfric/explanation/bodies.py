"""What the bodies of a robot weigh, and which way gravity pulls, by all joints together.

A joint's force is linear in ten parameters of each body (mass, first moment, inertia about its
frame), and these are what a file's numbers make of them: m c and I + m (c² 1 − c cᵀ) are no linear
functions of mass and centre. So the fewest of the file's numbers that leave no joint more than all
the linear parameters do are looked for by Gauss-Newton's steps, each set by itself, with one value
of each number for all joints. Gravity, the same for all, counts as three more numbers: a base that
stands askew is no fault of a body. It pulls on what the bodies weigh then, which is a product of
numbers, and keeps its size where only its direction is a number.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from jaxtyping import Float

from ..identification.uncertainty import Estimate
from ..simulators.rigid import PARAMETERS
from ..simulators.weights import GRAVITY, MASS, PULLED, Weight, attribute
from .intervals import spread
from .joint_rows import JointRows
from .regression import Fit

# A robot's values by name, those that differ from the simulator's; of a joint's own the change.
State = dict[str, float]
# Steps of Gauss and Newton, which converge in four or five; halvings of one; a gain that ends them,
# as a part of the energy; the step of a numerical derivative, as a part of a value's own size.
STEPS, HALVINGS, NO_GAIN, STEP = 20, 8, 1e-9, 1e-4


class Bodies:
    """The rows of all joints, and the numbers of a model's file that their forces depend on."""

    def __init__(
        self,
        joints: Sequence[JointRows],
        weights: Mapping[str, Weight],
        gravity: Float[np.ndarray, "3"],
    ):
        self.joints, self.weights = joints, weights
        own = [f"{joint.name}:{name}" for joint in joints for name in joint.own]
        self.place = {name: i for i, name in enumerate([*own, *GRAVITY])}
        self.shared = len(own)
        self.before = dict.fromkeys(own, 0.0)
        self.before |= {n: float(g) for n, g in zip(GRAVITY, gravity, strict=True)}
        self.down = GRAVITY[int(np.argmax(np.abs(gravity)))]
        self.owner: dict[str, tuple[str, str]] = {}
        for body, weight in weights.items():
            for what, value in weight.values().items():
                self.owner[f"body/{body}/{what}"] = body, what
                self.before[f"body/{body}/{what}"] = value
        bodies = len(self.place)
        self.starts = {body: bodies + PARAMETERS * i for i, body in enumerate(weights)}
        self.products = bodies + PARAMETERS * len(weights)
        count = self.products + PULLED * len(GRAVITY) * len(weights)
        self.grams = np.zeros((len(joints), count, count))
        self.pulls, self.pull = np.zeros((len(joints), count)), np.zeros(count)
        self.powers = np.array([joint.target @ joint.target for joint in joints])
        self.enough = np.array([joint.enough for joint in joints])
        for k, joint in enumerate(joints):
            at = self.at(k)
            self.grams[k][np.ix_(at, at)] = joint.columns.T @ joint.columns
            self.pulls[k][at] = joint.columns.T @ joint.target
        self.gram, self.pull = self.grams.sum(axis=0), self.pulls.sum(axis=0)
        # All that the force is linear in; a product of two of these is no parameter by itself.
        linear = slice(0, self.products)
        size = np.sqrt(np.maximum(np.diag(self.gram)[linear], 1e-300))
        scaled = self.gram[linear, linear] / np.outer(size, size)
        every = np.zeros(count)
        every[linear] = np.linalg.lstsq(scaled, self.pull[linear] / size, rcond=1e-12)[0] / size
        self.least = self._energies(every)

    def at(self, number: int) -> list[int]:
        """Where the columns of a joint stand among those of all."""
        first = sum(len(joint.own) for joint in self.joints[:number])
        own = list(range(first, first + len(self.joints[number].own)))
        return own + list(range(self.shared, len(self.pull)))

    def _energies(self, shift: np.ndarray) -> np.ndarray:
        """The energy that a shift of all linear parameters leaves of each joint, in its noise's."""
        bent = np.einsum("i,kij,j->k", shift, self.grams, shift)
        return self.powers - 2 * self.pulls @ shift + bent

    def energies(self, state: State, any_: bool = False) -> np.ndarray:
        """What a state leaves of each joint, in units of its noise's energy, `(joints,)`: without
        bound where a body cannot be.
        """
        try:
            return self._energies(self.shift(state, any_))
        except ValueError:
            return np.full(len(self.joints), np.inf)

    def impossible(self, state: State) -> set[str]:
        """The numbers of the bodies that cannot be in a state."""
        found = set()
        for name in state.keys() & self.owner.keys():
            try:
                self.weight(self.owner[name][0], state)
            except ValueError:
                found.add(name)
        return found

    def shift(self, state: State, any_: bool = False) -> np.ndarray:
        """By how much the linear parameters differ from the simulator's; `any_`: also of a body
        that cannot be.

        **Raises:** `ValueError` for a body that cannot be.
        """
        found = np.zeros(len(self.pull))
        for name in state.keys() & self.place.keys():
            found[self.place[name]] = state[name] - self.before[name]
        if self.turned(state):
            found[self.place[self.down]] = self.gravity(state) - self.before[self.down]
        for body in {self.owner[n][0] for n in state if n in self.owner}:
            start = self.starts[body]
            new = self.weight(body, state, any_).parameters()
            found[start : start + PARAMETERS] = new - self.weights[body].parameters()
        gravity = np.array([found[self.place[name]] for name in GRAVITY])
        if np.any(gravity):
            heavier = found[self.shared + len(GRAVITY) : self.products].reshape(-1, PARAMETERS)
            found[self.products :] = np.multiply.outer(heavier[:, :PULLED], gravity).ravel()
        return found

    def turned(self, state: State) -> bool:
        """Whether only the direction of gravity is a number, not its largest component."""
        return self.down not in state and not state.keys().isdisjoint(GRAVITY)

    def gravity(self, state: State) -> float:
        """The largest component of gravity, m/s², with which its size is that of the file."""
        largest, squares = self.before[self.down], sum(self.before[n] ** 2 for n in GRAVITY)
        others = sum(state.get(n, self.before[n]) ** 2 for n in GRAVITY if n != self.down)
        return float(np.copysign(np.sqrt(max(squares - others, 0.0)), largest))

    def unchanged(self, name: str, state: State) -> float:
        """What a number of a state would be without it: the file's, gravity's largest component
        such that its size is the file's.
        """
        rest = {n: value for n, value in state.items() if n != name}
        return self.gravity(rest) if name == self.down else self.before[name]

    def weight(self, body: str, state: State, any_: bool = False) -> Weight:
        """What a body weighs in a state."""
        owned = ((self.owner[n], v) for n, v in state.items() if n in self.owner)
        own = {what: v for (b, what), v in owned if b == body}
        return self.weights[body].with_values(own, any_)

    def raised(self, state: State) -> list[tuple[str, str, float, float]]:
        """The inertias that go along in a state because no body could be without: body, axis, and
        the inertia before and after, kg·m².
        """
        found = []
        for body in dict.fromkeys(self.owner[n][0] for n in state if n in self.owner):
            before, after = self.weights[body], self.weight(body, state)
            times = after.mass / before.mass if f"body/{body}/{MASS}" in state else 1.0
            for letter, old, new in zip("xyz", before.inertia, after.inertia, strict=True):
                given = f"body/{body}/inertia_{letter}" in state
                if not given and new > old * times * (1 + 1e-9):
                    found.append((body, letter, float(old), float(new)))
        return found

    def value(self, name: str, state: State) -> float:
        """A number in a state that may not hold it, as it goes along with the others."""
        if name == self.down and self.turned(state):
            return self.gravity(state)
        if name in state or name in self.place:
            return state.get(name, self.before[name])
        body, what = self.owner[name]
        return self.weight(body, state).values()[what]

    def size(self, name: str) -> float:
        """The size of a number, that of zero too."""
        if name in GRAVITY:
            return float(np.linalg.norm([self.before[each] for each in GRAVITY])) or 1.0
        if name in self.place:
            return 1.0
        body, what = self.owner[name]
        weight = self.weights[body]
        sizes = {"mass": weight.mass, "centre": weight.extent()}
        return sizes.get(what.partition("_")[0], weight.mass * weight.extent() ** 2)

    def slopes(self, names: Iterable[str], state: State, any_: bool = False) -> np.ndarray:
        """Derivatives of the linear parameters by the numbers of those names, `(count, names)`."""
        found = []
        for name in names:
            if name in self.place and name not in GRAVITY:
                found.append(np.eye(1, len(self.pull), self.place[name])[0])
                continue
            value, sides = self.value(name, state), []
            for step in STEP * self.size(name) * np.array([1.0, -1.0, 0.0]):
                try:
                    sides.append((value + step, self.shift({**state, name: value + step}, any_)))
                except ValueError:
                    continue
            if len(sides) < 2:  # at an end of what a body can be, it cannot change by itself
                found.append(np.zeros(len(self.pull)))
                continue
            (a, one), (b, other) = sides[0], sides[1]
            if a == b:
                raise ValueError(f"{name} is beyond all bounds")
            found.append((one - other) / (a - b))
        return np.array(found).T

    def fitted(self, names: Iterable[str], start: State) -> tuple[float, State]:
        """Those numbers by least squares over all joints, from a state; the energy that is left.

        The way may lead through bodies that cannot be; the energy of an end that cannot is
        infinite.
        """
        state = dict(start)
        try:
            state = {name: self.value(name, start) for name in names}
            energy, state = self._descended(state, True)
            if abs(float(self.energies(state).sum()) - energy) <= NO_GAIN * energy:
                return energy, state
            return self._descended(state, False)
        except ValueError:
            return np.inf, state

    def _descended(self, state: State, any_: bool) -> tuple[float, State]:
        """The numbers of a state by Gauss and Newton's steps, and the energy that is left.

        **Raises:** `ValueError` for a body that cannot be.
        """
        names, energy = list(state), float(self.energies(state, any_).sum())
        for _ in range(STEPS):
            slopes = self.slopes(names, state, any_)
            size = np.sqrt(np.maximum(np.sum(slopes * (self.gram @ slopes), axis=0), 1e-300))
            inner = slopes.T @ self.gram @ slopes / np.outer(size, size)
            outer = slopes.T @ (self.pull - self.gram @ self.shift(state, any_)) / size
            if not np.isfinite(inner).all():
                raise ValueError("its values are beyond all bounds")
            step = np.linalg.lstsq(inner, outer, rcond=1e-10)[0] / size
            before = energy
            for part in 0.5 ** np.arange(HALVINGS):
                moved = {n: state[n] + part * s for n, s in zip(names, step, strict=True)}
                try:
                    left = float(self.energies(moved, any_).sum())
                except ValueError:
                    continue
                if left < energy:
                    energy, state = left, moved
                    break
            if before - energy <= NO_GAIN * before:
                break
        return energy, state

    def rows(self, names: Sequence[str], state: State) -> Fit:
        """The rows of all joints at a state, as a fit with the derivatives by those numbers."""
        slopes, shift = self.slopes(names, state), self.shift(state)
        columns, left = [], []
        for k, joint in enumerate(self.joints):
            columns.append(joint.columns @ slopes[self.at(k)])
            left.append(joint.target - joint.columns @ shift[self.at(k)])
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
        known = spread(self.rows(names, state), self.block)
        freedom = known.degrees_of_freedom(np.eye(len(names)))
        errors = np.sqrt(np.diag(known.covariance))
        return {
            name: Estimate(np.float64(state[name]), np.float64(error), self._unit(name), float(df))
            for name, error, df in zip(names, errors, freedom, strict=True)
        }

    def _unit(self, name: str) -> str:
        if name in GRAVITY:
            return "m/s²"
        if name in self.place:
            return ""
        body, what = self.owner[name]
        return attribute(self.weights[body], body, what).unit
