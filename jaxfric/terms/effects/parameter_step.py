"""A value of the baseline that changes at one moment."""

import dataclasses
from collections.abc import Iterator, Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ..base import AbstractTerm, leaves
from ..change import AbstractChange
from ..effect import Effect, Extent
from ..friction import Coulomb, Viscous
from ..inertia import Inertia, Offset
from ..known import KnownColumns, KnownGain
from ..sample import UNKNOWN, Scales
from .steps import moments, ramp


class ParameterStep(AbstractChange):
    """A parameter of a law that changes at one moment: F = Δθ g 1(t > t_c), g the law `term`.

    `step_time` t_c, s; the step is a ramp as in [`FrictionStep`][].
    """

    term: AbstractTerm = Viscous()
    step_time: Float[Array, ""] | float = UNKNOWN
    ramp: float = eqx.field(static=True, default=0.0)
    prefix: ClassVar = "step"

    @property
    def changed(self) -> AbstractTerm:
        return self.term


# What other effects of one moment are about: friction, the load, the gain of all of the force.
OTHERS = (Coulomb, Inertia, KnownGain)
# What a law says at one moment of the motion alone.
MOTION = frozenset({"position", "velocity", "acceleration"})


def of_each(
    term: ParameterStep, base: AbstractTerm, turn: float | None
) -> tuple[AbstractTerm, ...]:
    """The step of each parameter of the baseline; a constant force may always begin."""
    laws = [Offset(), *_laws(base)]
    return tuple(dataclasses.replace(term, term=law) for law in laws)


def _laws(base: AbstractTerm) -> Iterator[AbstractTerm]:
    for part in leaves(base):
        if isinstance(part, KnownColumns):
            yield from _attributes(part)
        elif part.affine and not part.nonlinear and part.coordinates <= MOTION:
            if not isinstance(part, (*OTHERS, Offset)):
                yield part


def _attributes(part: KnownColumns) -> Iterator[AbstractTerm]:
    """Of a simulator's parameters those of the joint, and masses of bodies but the last, which is
    the load's. Centres and inertias of bodies change with a mass.
    """
    as_laws = {"damping": Viscous(), "armature": Inertia()}
    kinds = [name.rpartition("/")[2] for name in part.names]
    masses = [i for i, kind in enumerate(kinds) if kind == "mass"]
    for i, kind in enumerate(kinds):
        if kind in as_laws:
            yield as_laws[kind]
        elif kind == "stiffness" or i in masses[:-1]:
            yield part.only(i)


def shapes(scales: Scales) -> tuple[AbstractTerm, ...]:
    """One step, as short as a recording resolves."""
    return (ParameterStep(ramp=ramp(scales)),)


# Parameters in words.
SPOKEN = {
    "viscous": "viscous friction",
    "offset": "a constant force",
    "inertia": "the inertia",
    "stiffness": "the stiffness of the spring",
    "gravity_sin": "the weight",
}


def named(values: Mapping[str, float], extent: Extent) -> str | None:
    """The sentence with the parameter that changes."""
    name = next(name for name in values if name.startswith("step_") and name != "step_time")
    stem = name.removeprefix("step_")
    size = "amplitude" if stem.endswith("_sin") else name
    spoken = SPOKEN.get(stem, stem.replace("_", " "))
    return f"At t = {{step_time}} {spoken} changes by {{{size}}}"


PARAMETER_STEP = Effect(
    "parameter_step",
    "Δθ g 1(t > t_c), g the law of a parameter θ of the baseline",
    "time",
    "At t = {step_time} a value of the baseline changes",
    laws=(ParameterStep,),
    scaled=shapes,
    suited=of_each,
    coordinates=("time_by_velocity", "time"),
    confusable_with=("friction_step", "payload_change", "gain_step", "load_drift", "thermal_drift"),
    separate_by="Repeat the motion, with slow and fast, and with small and large strokes.",
    momentary=True,
    leftover=True,
    by_parameter=True,
    grid=moments,
    variant=named,
    moment="step_time",
    drawn=False,
)
