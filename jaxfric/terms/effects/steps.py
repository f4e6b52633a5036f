"""What changes at one moment: friction, the load, a gain."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from ..base import AbstractTerm, Sum, summands
from ..effect import GRID, Effect, Extent, View, even
from ..friction import Coulomb
from ..inertia import Inertia
from ..known import KnownColumns
from ..position import Gravity
from ..sample import Scales
from ..time import FrictionStep, GainStep, PayloadChange

# A step in friction cannot be dated better than to about one kernel of the weak form, some
# thousandths of the record.
RAMP_SHARE = 0.005
# Machines whose mass or gain changes while they run are not drawn: of a seed of `prove` every case
# stays what it was before these effects.


def _ramp(scales: Scales) -> float:
    return RAMP_SHARE * float(scales.duration)


def moments(term: AbstractTerm, view: View) -> np.ndarray:
    """Dates, as near to each other as a ramp is long."""
    return even(term, view, 8 * GRID)


FRICTION_STEP = Effect(
    "friction_step",
    "ΔF sign(v) 1(t > t_c)",
    "time",
    "At t = {step_time} Coulomb friction changes by {step_coulomb}",
    laws=(FrictionStep,),
    scaled=lambda scales: (FrictionStep(Coulomb(), ramp=_ramp(scales)),),
    coordinates=("time_by_direction",),
    confusable_with=("thermal_drift",),
    separate_by="Repeat from cold: warming repeats, a step does not.",
    momentary=True,
    grid=moments,
    moment="step_time",
)


def hanging(term: PayloadChange, base: AbstractTerm, turn: float | None) -> AbstractTerm:
    """On a turning axis the load's weight goes with the angle; of another simulator's axis it is
    more mass of the last body, which has the load's place.
    """
    for part in summands(base):
        masses = [i for i, n in enumerate(getattr(part, "names", ())) if n.endswith("/mass")]
        if isinstance(part, KnownColumns) and masses:
            last = masses[-1]
            load = KnownColumns((part.names[last],), (part.spelled[last],), part.first + last)
            return dataclasses.replace(term, load=load)
    if turn is None:
        return term
    return dataclasses.replace(term, load=Sum((Inertia(), Gravity(turn))))


def weighed(values: Mapping[str, float], extent: Extent) -> str | None:
    """The sentence with the load's weight, where it has one."""
    mass = next((name for name in values if name.endswith("/mass")), None)
    if mass is not None:
        body = mass.split("/")[1]
        return f"At t = {{step_time}} the mass of body {body} changes by {{{mass}}}: {PICKED}"
    weight = next((name for name in ("amplitude", "payload_offset") if name in values), None)
    if weight is None:
        return None
    return f"{PAYLOAD_CHANGE.sentence}, and its weight by {{{weight}}}: {PICKED}"


PICKED = "something was picked up or put down"


PAYLOAD_CHANGE = Effect(
    "payload_change",
    "(ΔM a + ΔF) 1(t > t_c)",
    "time",
    "At t = {step_time} the load changes: its inertia by {payload_inertia}",
    laws=(PayloadChange,),
    scaled=lambda scales: (PayloadChange(ramp=_ramp(scales)),),
    suited=hanging,
    coordinates=("time",),
    confusable_with=("gain_step", "load_drift", "friction_step"),
    separate_by="Move the same way with and without the payload, each in a recording.",
    momentary=True,
    grid=moments,
    variant=weighed,
    moment="step_time",
    drawn=False,
)
GAIN_STEP = Effect(
    "gain_step",
    "κ f 1(t > t_c)",
    "time",
    "At t = {step_time} the force needed for the same motion changes by {step_gain} of it: a gain, "
    "a torque constant or a transmission that switched",
    laws=(GainStep,),
    scaled=lambda scales: (GainStep(ramp=_ramp(scales)),),
    coordinates=("predicted_force", "time"),
    needs=frozenset({"predicted_force"}),
    confusable_with=("payload_change", "friction_step"),
    separate_by="Coast: a gain changes the force, not how friction brakes the free axis.",
    momentary=True,
    grid=moments,
    moment="step_time",
    drawn=False,
)
