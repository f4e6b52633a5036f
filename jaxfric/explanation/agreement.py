"""What all joints of a robot say of its bodies and of gravity together, beside what each says by
itself.
"""

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import jax
import numpy as np

from ..data.printable import listed_and
from ..data.recording import Recording
from ..identification.uncertainty import Estimate
from ..models import Model
from ..simulators import Mujoco
from ..simulators.weights import GRAVITY, weights
from ..terms.base import AbstractTerm
from ..terms.effects import EFFECTS
from ..terms.effects.parameter_mismatch import MISMATCH
from . import parameters as spelled
from .acceptance import LINEARITY
from .agreement_text import GEOMETRY, worded
from .attributes import claimed
from .bodies import Bodies, State
from .explained import Explanation
from .fewest_numbers import Answer, answer
from .finding import Finding, Moved
from .joint_rows import joint_rows, missing, needless
from .sanity.preceding import p_value, with_preceding

# Gravity at the poles, and at the equator five kilometres up, m/s².
EARTH = 9.765, 9.833


class Told(NamedTuple):
    """One joint: its simulator as given, its recordings (the one explained, and the held-out one if
    there is one), and its own explanation; `needless`, terms of that which gravity accounts for.
    """

    simulator: Mujoco
    logs: Sequence[Recording]
    explanation: Explanation
    needless: Sequence[AbstractTerm] = ()


class Agreement(NamedTuple):
    """The values of bodies and of gravity that all joints together say are wrong: `parameters` by
    name, `text` in words, `instead` what else would do as well in place of each; `impossible`:
    whether gravity would have to be of a size that it has nowhere.
    """

    parameters: dict[str, Moved]
    text: str
    instead: dict[str, tuple[str, ...]]
    impossible: bool = False

    def values(self) -> dict[str, float]:
        """The values by name."""
        return {name: float(moved.value) for name, moved in self.parameters.items()}

    @property
    def bodies(self) -> set[str]:
        """The bodies whose values are wrong."""
        return {name.split("/")[1] for name in self.parameters if name not in GRAVITY}

    @property
    def everywhere(self) -> bool:
        """Whether gravity is among them, which every joint feels."""
        return any(name in GRAVITY for name in self.parameters)


# The error of what another recording contradicts beyond all that a body can be.
UNKNOWN = np.float64(np.inf)


def agreed(told: Sequence[Told], apart: Collection[str] = ()) -> Agreement:
    """What several joints say of the bodies that move with them.

    The values are those of the recordings; the held-out ones, and a kernel of twice the width, say
    only how well they are known. `apart`: bodies whose mass and inertia are numbers apart from each
    other in the simulator's file.
    """
    simulator = told[0].simulator
    bodies = weights(simulator.mujoco, simulator.model)
    with jax.enable_x64(True):
        told, rows, found = _answered(told, bodies, apart)
        others = [(_rows(told, bodies, wide=2), spelled.with_smoothing),
                  (_rows(told, bodies, held=True), spelled.with_elsewhere)]  # fmt: skip
        state, moved = found.values, _moved(rows, others, found.values)
        while unsure := {name for name, m in moved.items() if m.may_be_none}:
            rest = {name: value for name, value in state.items() if name not in unsure}
            energy, state = rows.fitted(rest, rest)
            state = state if np.isfinite(energy) else {}
            moved = _moved(rows, others, state)
    values = {name: float(m.value) for name, m in moved.items()}
    known = {name: m.estimate for name, m in moved.items()}
    if rows.turned(values):
        moved[rows.down] = _down(rows, values, known)
    own = {each.simulator.joint: each.simulator.attributes() for each in told}
    text = worded(moved, found.instead, rows, own)
    if moved and found.short:
        text += (
            f"; that is not all: of joint {listed_and(found.short)} other bodies would leave less"
        )
    impossible = _impossible(moved, rows)
    if impossible:
        text += f"; gravity is of that size nowhere: something else is wrong, as {GEOMETRY}"
    return Agreement(moved, text, found.instead, impossible)


def _answered(
    told: Sequence[Told], bodies, apart: Collection[str]
) -> tuple[Sequence[Told], Bodies, Answer]:
    """The rows of all joints and what they say, beside the missing physics that is needed then.

    Without gravity of another direction a joint finds a spring, an unbalance or worse in what that
    does to it. In the span of these is what tells a centre of mass from an armature. So where
    gravity is in the answer, it is asked for again without them: all are needless that take nothing
    beside it, if it takes no more numbers than one for each of them.
    """
    rows = _rows(told, bodies)
    first = told, rows, answer(rows, apart)
    if not rows.turned(first[2].values):
        return first
    bare = [each._replace(needless=missing(each.explanation.model)) for each in told]
    if not any(each.needless for each in bare):
        return first
    plain = _rows(bare, bodies)
    found = answer(plain, apart)
    shift = plain.shift(found.values)
    some = [
        each._replace(needless=needless(own, each.explanation.model, shift[plain.at(k)]))
        for k, (each, own) in enumerate(zip(bare, plain.joints, strict=True))
    ]
    gone = sum(len(each.needless) for each in some)
    if gone < sum(len(each.needless) for each in bare):
        bare, plain = some, _rows(some, bodies)
        found = answer(plain, apart)
    fewer = len(found.values) <= len(first[2].values) + gone
    tilted = plain.turned(found.values)
    return (bare, plain, found) if gone and fewer and tilted else first


def _impossible(moved: Mapping[str, Moved], rows: Bodies) -> bool:
    """Whether gravity would have to be of a size that it has nowhere, beyond its error.

    Of a length that is wrong the pull of all that hangs on it is.
    """
    if rows.down not in moved:
        return False
    values = [moved[n].value if n in moved else rows.before[n] for n in GRAVITY]
    size, half = np.linalg.norm(np.array(values, float)), float(moved[rows.down].half_width())
    return not EARTH[0] - half <= size <= EARTH[1] + half


def _moved(rows: Bodies, others, state: State) -> dict[str, Moved]:
    """The values of bodies and of gravity in a state, with what `others` add to their errors: rows
    through another kernel or of another recording, or `None`, and how they do. Of a body that
    cannot be there they know nothing.
    """
    own = {n for n in state if n in rows.owner or n in GRAVITY}
    known = {n: e for n, e in rows.estimates(state).items() if n in own} if own else {}
    for more, joined in others:
        if own and more is not None:
            energy, there = more.fitted(state, state)
            if np.isfinite(energy):
                known = joined(known, more.estimates(there))
                continue
            for name in more.impossible(there) or own:
                known[name] = known[name]._replace(standard_error=UNKNOWN)
    return {name: Moved(rows.before[name], estimate) for name, estimate in known.items()}


def _down(rows: Bodies, values: State, known: Mapping[str, Estimate]) -> Moved:
    """Gravity's largest component z = √(g² − Σ x²), which follows from the others.

    Its error is Σ x δx / z; of a base on a wall, where z is next to nothing, √(2 Σ x δx).
    """
    value, others = rows.gravity(values), [name for name in values if name in GRAVITY]
    turned = sum(abs(values[n]) * float(known[n].standard_error) for n in others)
    error = np.sqrt(2 * turned) if value**2 < 0.5 * turned else turned / abs(value)
    freedom = min(known[n].degrees_of_freedom for n in others)
    estimate = Estimate(np.float64(value), np.float64(error), "m/s²", freedom)
    return Moved(rows.before[rows.down], estimate)


def _rows(told: Sequence[Told], bodies, wide: int = 1, held: bool = False) -> Bodies | None:
    """The rows of all joints, of the held-out recording where `held`; `None` without enough."""
    if any(len(each.logs) <= held for each in told):
        return None
    found = []
    for each in told:
        model: Model = each.explanation.model
        delay = each.explanation.fit["filtered_force_error"]["force_taken_later"]
        log = each.logs[held]
        try:
            own = joint_rows(
                each.simulator, log, model, delay, LINEARITY, wide, needless=each.needless
            )
            found.append(own)
        except ValueError:
            if not held and wide == 1:
                raise
            return None
    return Bodies(found, bodies, told[0].simulator.model.opt.gravity)


def with_bodies(
    found: Explanation, first: Explanation, agreement: Agreement, joints: Sequence[str]
) -> Explanation:
    """A joint's explanation, its bodies put right, with what of them was wrong before it.

    **Arguments:** `found`, by the simulator whose bodies are right; `first`, by the one as it was
    given; `joints` that have told of the bodies together.
    """
    name = "filtered_force_error"
    before, left = (each.fit[name]["before"] for each in (first, found))
    part = (left / before) ** 2 if before > 0 else 1.0
    share = max(1 - part, 0.0)
    moved = agreement.parameters
    together = f"{listed_and(joints)} together: " if len(joints) > 1 else ""
    finding = Finding(
        MISMATCH, EFFECTS[MISMATCH].equation,
        f"Wrong in the simulator: {together}{agreement.text}; {share:.0%} of the unexplained "
        "force.",
        (), "", {} if agreement.impossible else moved, share, _held_out_share(found, first),
        max(p_value(m.change) for m in moved.values()),
        attribute=None if agreement.impossible else ", ".join(moved),
        confirmed=_confirmed(found, first),
        instead={n: o for n, o in agreement.instead.items() if n in moved},
        untold=tuple(moved) if agreement.impossible else (),
    )  # fmt: skip
    names = ("force_error", name, "holdout_force_error", "filtered_holdout_force_error")
    errors = {n: first.fit[n]["before"] for n in names if first.fit[n] and found.fit[n]}
    told = with_preceding(found, [finding], part, errors)
    return _without_values(told) if agreement.impossible else told


def _without_values(told: Explanation) -> Explanation:
    """An explanation whose first finding is of values that cannot be: nor is there anything in what
    a joint's own values lack beside them.
    """
    kept = [i for i, f in enumerate(told.findings) if not i or f.effect != MISMATCH]
    pictures = told.curves["findings"]
    return dataclasses.replace(
        told,
        findings=[told.findings[i] for i in kept],
        curves=told.curves | {"findings": [pictures[i] for i in kept]},
        verdict=claimed(told.verdict, told.findings),
    )


def _held_out_share(found: Explanation, first: Explanation) -> float | None:
    name = "filtered_holdout_force_error"
    if not (found.fit[name] and first.fit[name]):
        return None
    return 1 - (found.fit[name]["before"] / first.fit[name]["before"]) ** 2


def _confirmed(found: Explanation, first: Explanation) -> bool | None:
    share = _held_out_share(found, first)
    return None if share is None else share > 0
