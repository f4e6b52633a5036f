"""Another axis that pulls along."""

from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp

from ...data.recording import Recording
from ...units import DAMPING, DIMENSIONLESS, INERTIA
from ..base import AbstractLaw
from ..effect import Effect, Extent
from ..known import KNOWN
from ..sample import Parameter, Sample
from ..table import reading

# The channel of a recording's only neighbour; what those of several begin with.
NEIGHBOUR, NEIGHBOURS = "neighbour_velocity", f"{KNOWN}velocity "
DRAG, MASS, SHARE = "coupling_viscous", "coupling_inertia", "coupling_force"
# What the channels of the force that a neighbour's motion needs begin with, by a simulator.
NEEDED, NEEDED_MOMENTUM = f"{KNOWN}needed ", f"{KNOWN}needed_momentum "


def neighbour_channel(name: str, unit: str) -> str:
    """The channel of the velocity of a neighbour, whose position is in a unit, m or rad."""
    return f"{NEIGHBOURS}{unit} {name}"


def force_channels(name: str, unit: str) -> tuple[str, str]:
    """The channels of the force that a neighbour needs: the rest, and what is differentiated."""
    return f"{NEEDED}{unit} {name}", f"{NEEDED_MOMENTUM}{unit} {name}"


class CrossAxis(AbstractLaw):
    """Coupling from another axis: u = d(C v₂)/dt + h v₂.

    Needs that axis' velocity as a channel; its acceleration is never formed, the weak form
    differentiates the kernel instead.

    **Arguments:** `neighbour`, the name of that axis and the unit of its position, m or rad, where
    there are several; `spelled`, the units of C and h where that axis turns and this one does not,
    or the other way round.
    """

    neighbour: tuple[str, ...] = eqx.field(static=True, default=(), converter=tuple)
    spelled: tuple[str, ...] = eqx.field(static=True, default=(), converter=tuple)

    @property
    def channel(self) -> str:
        """The channel of that axis' velocity."""
        return neighbour_channel(*self.neighbour) if self.neighbour else NEIGHBOUR

    @property
    def affine(self):
        units = self.spelled or (INERTIA, DAMPING)
        end = f"_{self.neighbour[0]}" if self.neighbour else ""
        return (Parameter(MASS + end, units[0]), Parameter(DRAG + end, units[1]))

    @property
    def coordinates(self):
        return frozenset({self.channel})

    def law(self, sample: Sample):
        other = reading(sample, self.channel)
        return (jnp.zeros_like(other), other)

    def impulse(self, sample: Sample):
        other = reading(sample, self.channel)
        return (other, jnp.zeros_like(other))


class CrossForce(AbstractLaw):
    """A part of the force that another axis needs: u = c f₂, f₂ by a simulator.

    A motor, a belt or a cable of that axis rests on this one. Needs f₂ = r + dp/dt as two channels.

    **Arguments:** `neighbour`, the name of that axis and the unit of its position, m or rad;
    `spelled`, the unit of c where that axis turns and this one does not, or the other way round.
    """

    neighbour: tuple[str, ...] = eqx.field(static=True, converter=tuple)
    spelled: tuple[str, ...] = eqx.field(static=True, default=(), converter=tuple)

    @property
    def affine(self):
        unit = self.spelled[0] if self.spelled else DIMENSIONLESS
        return (Parameter(f"{SHARE}_{self.neighbour[0]}", unit),)

    @property
    def coordinates(self):
        return frozenset(force_channels(*self.neighbour))

    def law(self, sample: Sample):
        return (reading(sample, force_channels(*self.neighbour)[0]),)

    def impulse(self, sample: Sample):
        return (reading(sample, force_channels(*self.neighbour)[1]),)


def _neighbours(recording: Recording) -> tuple[CrossAxis | CrossForce, ...]:
    """Laws for each of several neighbours that a recording has the velocities or forces of."""
    force, own = (recording.unit_names[name] for name in ("force", "position"))
    found: list[CrossAxis | CrossForce] = []
    for channel in recording.channels:
        if channel.startswith(NEIGHBOURS):
            unit, _, name = channel.removeprefix(NEIGHBOURS).partition(" ")
            spelled = () if unit == own else (f"{force}·s²/{unit}", f"{force}·s/{unit}")
            found.append(CrossAxis((name, unit), spelled))
        elif channel.startswith(NEEDED):
            unit, _, name = channel.removeprefix(NEEDED).partition(" ")
            ratio = () if unit == own else ("1/m",) if unit == "rad" else ("m",)
            found.append(CrossForce((name, unit), ratio))
    return tuple(found)


def _by_name(values: Mapping[str, float], extent: Extent) -> str | None:
    """The sentence with the name of the neighbour, where it has one."""
    share = next((name for name in values if name.startswith(SHARE)), None)
    if share is not None:
        joint = share.removeprefix(f"{SHARE}_")
        return (
            f"{{{share}}} times the force that joint {joint} needs is needed here too: a motor, a "
            f"belt or a cable of joint {joint} rests on this one"
        )
    name = next(name.removeprefix(DRAG) for name in values if name.startswith(DRAG))
    return name and (
        f"Joint {name[1:]} pulls along: {{{MASS}{name}}} times its acceleration and "
        f"{{{DRAG}{name}}} times its velocity"
    )


CROSS_AXIS = Effect(
    "cross_axis",
    "d(C v₂)/dt + h v₂, or c f₂",
    "neighbour",
    "The other axis pulls along: {coupling_inertia} times its acceleration and {coupling_viscous} "
    "times its velocity",
    laws=(CrossAxis, CrossForce),
    scaled=lambda scales: (CrossAxis(),),
    recorded=_neighbours,
    coordinates=("neighbour",),
    needs=frozenset({NEIGHBOUR}),
    variant=_by_name,
    confusable_with=("load_drift", "periodic_disturbance"),
    separate_by="Hold the other axis still.",
)
