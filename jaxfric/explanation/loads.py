"""What was picked up or put down by a robot: its mass, and where it hangs, by all joints.

A joint's own answer is what the load does to its force: some mass and centre of the body that
carries it. All joints together tell a load of one mass in one place: of the ten parameters that the
force of a body is linear in, those of a mass m at p are m, m p and m (p² 1 − p pᵀ).
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np

from ..data.printable import listed_and
from ..identification.uncertainty import Estimate
from ..simulators.rigid import PARAMETERS, about_origin
from ..simulators.weights import GRAVITY, Weight, weights
from ..terms import KnownColumns, PayloadChange
from ..terms.base import AbstractTerm, leaves
from ..terms.effects import EFFECTS
from ..terms.effects.steps import PAYLOAD_CHANGE, ramp
from .acceptance import LINEARITY
from .agreement import Told
from .evidence import Evidence
from .explained import Explanation
from .finding import Finding
from .intervals import spread
from .joint_rows import opened, physics
from .least_squares import orthonormal, solve
from .mismatch import SURE
from .quantities import quantity
from .regression import Fit
from .significance import blocks

# Steps of Gauss and Newton, and halvings of one.
STEPS, HALVINGS = 40, 12
# Dates that are tried within the joints' own intervals; then parts of the step's ramp.
DATES, FINER = 100, 20


class Load(NamedTuple):
    """A load: the `body` that carries it, when it came, s, its mass, kg, and the coordinates of its
    place in the body's frame, m, by letter, those that the motions tell.
    """

    body: str
    moment: Estimate
    mass: Estimate
    place: dict[str, Estimate]

    def parameters(self) -> dict[str, Estimate]:
        """The numbers of a finding."""
        places = {f"load_{letter}": value for letter, value in self.place.items()}
        return {PAYLOAD_CHANGE.moment: self.moment, "load_mass": self.mass, **places}

    def sentence(self, joints: Sequence[str]) -> str:
        """The load in words."""
        done = "picked up" if float(self.mass.value) > 0 else "put down"
        mass = quantity(self.mass._replace(value=np.abs(self.mass.value)), smaller=False)
        places = [f"{letter} = {quantity(e, smaller=False)}" for letter, e in self.place.items()]
        where = f", at {listed_and(places)} in its frame" if places else ""
        together = f" ({listed_and(joints)} together)" if len(joints) > 1 else ""
        return (
            f"At t = {quantity(self.moment)} body {self.body} has {done} {mass}{where}{together}."
        )


class Felt(NamedTuple):
    """What one joint feels of a body's load: its `evidence`, its `target` `(J,)` and the `basis`
    `(J, r)` of all that is there all the time, which the target is without; the `law` of the body's
    ten parameters; the energy `enough`, N², that tells nothing.
    """

    evidence: Evidence
    target: np.ndarray
    basis: np.ndarray
    law: KnownColumns
    enough: float

    def columns(self, dates: np.ndarray) -> np.ndarray:
        """The force by each parameter of a load that comes at each date, `(G, J, 10)`."""
        term = PayloadChange(self.law, ramp=ramp(self.evidence.limits))
        columns = self.evidence.columns(term, dates[:, None])
        return columns - self.basis @ (self.basis.T @ columns)

    def block(self) -> np.ndarray:
        """The number of each row's block, `(J,)`."""
        return blocks(self.evidence.elapsed[self.evidence.centre], self.evidence.reach)


def with_load(told: Sequence[Told]) -> list[Explanation]:
    """The joints' explanations; where they find that a body's load changes, by the load that
    explains them all, if there is one.
    """
    found = [each.explanation for each in told]
    with jax.enable_x64(True):
        load = load_of(told)
    if load is None:
        return found
    names = [each.simulator.joint for each in told if load.body in each.simulator.bodies()]
    for number, each in enumerate(found):
        findings = [
            f._replace(sentence=load.sentence(names), parameters=load.parameters(), attribute=None)
            if _carrier(f) == load.body
            else f
            for f in each.findings
        ]
        found[number] = dataclasses.replace(each, findings=findings)
    return found


def _carrier(finding: Finding) -> str:
    """The body whose load changes by a finding; none where it is no such finding."""
    if EFFECTS.get(finding.effect) is not PAYLOAD_CHANGE:
        return ""
    bodies = (name.partition("body/")[2].split("/")[0] for name in finding.parameters)
    return next(filter(None, bodies), "")


def load_of(told: Sequence[Told]) -> Load | None:
    """The load that explains what all joints feel of it as well as any change of the body that
    carries it does; `None` where there is none.
    """
    said = [(f, _carrier(f)) for each in told for f in each.explanation.findings]
    moments = [f.parameters[PAYLOAD_CHANGE.moment] for f, body in said if body]
    if len({body for _, body in said if body}) != 1:
        return None
    body = next(body for _, body in said if body)
    able = [each for each in told if body in each.simulator.bodies()]
    ends = np.array([m.interval() for m in moments], float)
    try:
        felt = [_felt(each, body) for each in able]
    except ValueError:
        return None
    if not np.isfinite(ends).all():
        return None
    dates = np.linspace(ends[:, 0].min(), ends[:, 1].max(), DATES)
    step = max(ramp(each.evidence.limits) for each in felt)
    for width in (max(step, float(np.diff(dates)[0])), step / FINER):
        at = int(np.argmin(_least([each.columns(dates) for each in felt], felt)))
        dates = dates[at] + width * np.linspace(-1, 1, 2 * FINER + 1)
    best = dates[int(np.argmin(_least([each.columns(dates) for each in felt], felt)))]
    carrying = weights(able[0].simulator.mujoco, able[0].simulator.model)[body]
    narrow = min(moments, key=lambda m: float(m.half_width()))
    return _fitted(felt, best + 0.5 * step * np.array([-1.0, 0.0, 1.0]), body, carrying, narrow)


def _felt(told: Told, body: str) -> Felt:
    """What a joint feels of a body's load, beside its own values, those of all bodies, and the
    other physics that was found.

    **Raises:** `ValueError` where the joint hardly slips.
    """
    simulator, model = told.simulator, told.explanation.model
    delay = told.explanation.fit["filtered_force_error"]["force_taken_later"]
    evidence, _, own, columns, shared = opened(simulator, told.logs[0], delay)
    bodies = list(weights(simulator.mujoco, simulator.model))
    first = len(GRAVITY)
    others = columns[:, first : first + PARAMETERS * len(bodies)]
    found = physics(model, evidence, but=_steps_a_value)
    basis = orthonormal(np.concatenate([own, others, found], axis=1))
    start = first + PARAMETERS * bodies.index(body)
    names = tuple(f"{i}" for i in range(PARAMETERS))
    law = KnownColumns(names, ("1",) * PARAMETERS, len(simulator.attributes()))
    pairs = zip(law.channels, *(each[start:] for each in shared), strict=False)
    evidence = evidence.with_channels(
        **{n: values for pair, *both in pairs for n, values in zip(pair, both, strict=True)}
    )
    target = evidence.target - basis @ (basis.T @ evidence.target)
    return Felt(evidence, target, basis, law, LINEARITY**2 * float(evidence.force @ evidence.force))


def _steps_a_value(term: AbstractTerm) -> bool:
    """Whether a term is one of the simulator's values that changes at a moment."""
    changed = term.switched
    return changed is not None and any(isinstance(part, KnownColumns) for part in leaves(changed))


def _least(columns: Sequence[np.ndarray], felt: Sequence[Felt]) -> np.ndarray:
    """The energy that any change of the ten parameters leaves at each date, each joint's in units
    of what it has of its own force, `(G,)`.
    """
    found = []
    for some in zip(*columns, strict=True):
        whole = np.concatenate([c / np.sqrt(f.enough) for c, f in zip(some, felt, strict=True)])
        target = np.concatenate([f.target / np.sqrt(f.enough) for f in felt])
        found.append(float(np.sum((target - whole @ solve(whole, target)) ** 2)))
    return np.array(found)


def _of_point(numbers: np.ndarray) -> np.ndarray:
    """The ten parameters of a mass, kg, at a place, m: `(m, x, y, z)`."""
    return about_origin(numbers[0], numbers[1:], np.zeros(3), np.eye(3))


def _slopes(numbers: np.ndarray, size: float) -> np.ndarray:
    """Their derivatives by mass and place, `(10, 4)`, exact: parabolas of the place."""
    steps = np.diag([1.0, size, size, size])
    sides = [(_of_point(numbers + each), _of_point(numbers - each)) for each in steps]
    return np.array([one - other for one, other in sides]).T / (2 * np.diag(steps))


def _fitted(
    felt: Sequence[Felt], dates: np.ndarray, body: str, carrying: Weight, narrow: Estimate
) -> Load | None:
    """The load of one mass in one place at the middle one of three dates, if that is enough.

    `narrow`: the narrowest date that a joint has by itself, for a change that no joint feels as it
    comes: all of them stand.
    """
    columns = [each.columns(dates) for each in felt]
    noises = []
    for own, each in zip(columns, felt, strict=True):
        rest = each.target - own[1] @ solve(own[1], each.target)
        noises.append(max(float(np.sqrt(np.mean(rest**2))), 1e-300))
    scaled = [c / n for c, n in zip(columns, noises, strict=True)]
    before, whole, after = (np.concatenate(some) for some in zip(*scaled, strict=True))
    target = np.concatenate([f.target / n for f, n in zip(felt, noises, strict=True)])
    numbers = _point(whole, target, carrying)
    enough = [each.enough / noise**2 for each, noise in zip(felt, noises, strict=True)]
    if not _suffices(numbers, whole, target, [len(f.target) for f in felt], enough):
        return None
    late = (after - before) @ _of_point(numbers) / (dates[2] - dates[0])
    jacobian = np.concatenate([whole @ _slopes(numbers, carrying.extent()), late[:, None]], axis=1)
    values = np.array([*numbers, dates[1]])
    mass, *place, moment = _estimates(
        values, jacobian, target - whole @ _of_point(numbers), [f.block() for f in felt]
    )
    if not np.isfinite(float(mass.standard_error)):
        return None
    seen = {k: e for k, e in zip("xyz", place, strict=True) if np.isfinite(float(e.standard_error))}
    if not float(moment.half_width()) < float(narrow.half_width()):
        moment = narrow
    return Load(body, moment, mass, seen)


def _suffices(
    numbers: np.ndarray, columns: np.ndarray, target: np.ndarray,
    counts: Sequence[int], enough: Sequence[float],
) -> bool:  # fmt: skip
    """Whether a load leaves no joint more than any ten parameters do: than ten that say nothing
    take of noise, or than a sensor of force resolves.
    """
    ends = np.cumsum(counts)[:-1]
    thetas = _of_point(numbers), solve(columns, target)
    powers = [np.split((target - columns @ theta) ** 2, ends) for theta in thetas]
    return all(
        one.sum() - other.sum() <= max(least, SURE**2 * PARAMETERS)
        for one, other, least in zip(*powers, enough, strict=True)
    )


def _estimates(
    values: np.ndarray, jacobian: np.ndarray, residual: np.ndarray, own: Sequence[np.ndarray]
) -> list[Estimate]:
    """Mass, place and date with their standard errors, from blocks of all joints' rows."""
    starts = np.cumsum([0, *(block[-1] + 1 for block in own)])[:-1]
    block = np.concatenate([each + start for each, start in zip(own, starts, strict=True)])
    empty, energy = np.zeros((len(residual), 0)), float(residual @ residual)
    known = spread(Fit((), (), (values,), jacobian, empty, residual, energy), block)
    freedom = known.degrees_of_freedom(np.eye(len(values)))
    errors, units = np.sqrt(np.diag(known.covariance)), ("kg", "m", "m", "m", "s")
    return [
        Estimate(np.float64(v), np.float64(e), unit, float(df))
        for v, e, unit, df in zip(values, errors, units, freedom, strict=True)
    ]


def _point(columns: np.ndarray, target: np.ndarray, carrying: Weight) -> np.ndarray:
    """Mass and place of the load that leaves least, by Gauss and Newton's steps from a few places
    about the body's centre.
    """
    gram, pull, size = columns.T @ columns, columns.T @ target, carrying.extent()

    def energy(numbers: np.ndarray) -> float:
        theta = _of_point(numbers)
        return float(theta @ gram @ theta - 2 * pull @ theta)

    best = np.zeros(4)
    for away in (*np.zeros((1, 3)), *size * np.eye(3), *-size * np.eye(3)):
        unit = _of_point(np.array([1.0, *(carrying.centre + away)]))
        mass = float(unit @ pull) / max(float(unit @ gram @ unit), 1e-300)
        numbers = np.array([mass, *(carrying.centre + away)])
        for _ in range(STEPS):
            slopes = _slopes(numbers, size)
            step = solve(columns @ slopes, target - columns @ _of_point(numbers))
            left = energy(numbers)
            parts = (numbers + part * step for part in 0.5 ** np.arange(HALVINGS))
            moved = next((each for each in parts if energy(each) < left), None)
            if moved is None:
                break
            numbers = moved
        best = min(best, numbers, key=energy)
    return best
