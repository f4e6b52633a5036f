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
from ..simulators import Attribute, Mujoco
from ..simulators.columns import GAIN
from ..simulators.weights import GRAVITY, MASS, attribute, weights
from ..terms.effects import EFFECTS
from ..terms.effects.parameter_mismatch import MISMATCH
from . import parameters as spelled
from .acceptance import LINEARITY
from .attributes import CONSTANT, claimed, listed
from .bodies import Bodies, State
from .explained import Explanation
from .fewest_numbers import answer
from .finding import Finding, Moved
from .joint_rows import joint_rows
from .quantities import quantity
from .sanity.preceding import p_value, with_preceding

# A base is set up to a tenth of a degree.
STRAIGHT = 0.1
# Gravity at the poles, and at the equator five kilometres up, m/s².
EARTH = 9.765, 9.833


class Told(NamedTuple):
    """One joint: its simulator as given, its recordings (the one explained, and the held-out one if
    there is one), and its own explanation.
    """

    simulator: Mujoco
    logs: Sequence[Recording]
    explanation: Explanation


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
        rows = _rows(told, bodies)
        others = [(_rows(told, bodies, wide=2), spelled.with_smoothing),
                  (_rows(told, bodies, held=True), spelled.with_elsewhere)]  # fmt: skip
        found = answer(rows, apart)
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
    text = _text(moved, found.instead, rows, told)
    if moved and found.short:
        text += (
            f"; that is not all: of joint {listed_and(found.short)} other bodies would leave less"
        )
    impossible = _impossible(moved, rows)
    if impossible:
        text += f"; gravity is of that size nowhere: something else is wrong, as {GEOMETRY}"
    return Agreement(moved, text, found.instead, impossible)


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
            found.append(joint_rows(each.simulator, log, model, delay, LINEARITY, wide))
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


def _text(
    moved: Mapping[str, Moved], instead: Mapping[str, tuple[str, ...]], rows: Bodies,
    told: Sequence[Told],
) -> str:  # fmt: skip
    """The wrong values in words, each with what would do as well."""
    own = {each.simulator.joint: each.simulator.attributes() for each in told}
    texts = []
    for name, m in moved.items():
        said = quantity(m.estimate, smaller=False)
        text = f"{_value(name, rows)} {m.before:.4g} → {said}"
        if others := instead.get(name):
            alike = dict.fromkeys(_said(other, rows, own) for other in others)
            text += f" (or {listed(list(alike), 'others')}: these motions cannot tell them apart)"
        texts.append(text)
    return "; ".join(
        [*texts, *_turned(moved, rows), *_raised(moved, rows), *_geometry(moved, rows)]
    )


def _value(name: str, rows: Bodies) -> str:
    """A value of a body or of gravity in words."""
    if name in GRAVITY:
        return f"gravity along {name[-1]}"
    body, what = rows.owner[name]
    value = attribute(rows.weights[body], body, what)
    return f"{value.owner}: {value.what}"


def _turned(moved: Mapping[str, Moved], rows: Bodies) -> list[str]:
    """By how much gravity has another direction than in the file, as of a base that is askew."""
    if not any(name in moved for name in GRAVITY):
        return []
    before = np.array([rows.before[name] for name in GRAVITY])
    after = np.array([moved[n].value if n in moved else rows.before[n] for n in GRAVITY], float)
    sizes = np.linalg.norm(before), np.linalg.norm(after)
    if not all(sizes):
        return []
    angle = np.degrees(np.arctan2(np.linalg.norm(np.cross(before, after)), before @ after))
    text = f"gravity is {sizes[1]:.4g} m/s²"
    if angle < STRAIGHT:
        return [f"{text} and of the same direction"]
    how = "is tilted" if angle < 45 else "is mounted another way"
    return [f"{text} and {angle:.3g}° from the file's direction: the base {how}"]


def _said(name: str, rows: Bodies, own: Mapping[str, Mapping[str, Attribute]]) -> str:
    """A number that would do as well, in words."""
    if name in GRAVITY:
        return _value(name, rows)
    if name in rows.owner:
        body, what = rows.owner[name]
        return str(attribute(rows.weights[body], body, what))
    joint, _, key = name.partition(":")
    if key == CONSTANT or key not in own[joint]:
        return f"a constant force at joint {joint}"
    return (
        f"gain of joint {joint}"
        if key == GAIN and own[joint][key].what == GAIN
        else str(own[joint][key])
    )


# What no value of a body or of gravity stands for.
GEOMETRY = (
    "the file's geometry (lengths of links, axes, couplings of joints), which is not among what is "
    "asked"
)


def _geometry(moved: Mapping[str, Moved], rows: Bodies) -> list[str]:
    """A doubt where values of several bodies differ: a part that is bolted on changes one."""
    bodies = dict.fromkeys(rows.owner[name][0] for name in moved if name in rows.owner)
    if len(bodies) < 2:
        return []
    return [f"these are values of {len(bodies)} bodies at once: look first at {GEOMETRY}"]


def _raised(moved: Mapping[str, Moved], rows: Bodies) -> list[str]:
    """The inertias that go along because no body could be without."""
    texts = []
    for body, weight in rows.weights.items():
        own: State = {rows.owner[n][1]: float(m.value) for n, m in moved.items()
                      if n in rows.owner and rows.owner[n][0] == body}  # fmt: skip
        new = weight.with_values(own)
        times = new.mass / weight.mass if MASS in own else 1.0
        for letter, i, before in zip("xyz", new.inertia, weight.inertia, strict=True):
            if f"inertia_{letter}" not in own and i > before * times * (1 + 1e-9):
                texts.append(
                    f"body {body}: inertia {letter} {before:.4g} → {i:.4g} kg·m², the least that a "
                    "body with the others can have: these motions do not show it"
                )
    return texts
