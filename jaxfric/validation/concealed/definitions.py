"""The physical definitions of each effect, and of how a machine sticks and is logged.

Which are developed on and which are only scored follows from the table and from nothing that was
measured: an effect's usual definitions come first and are developed on, since all proofs before
drew them. Of the others, in the order of the alphabet, the first is only scored, the next developed
on, and so on. A new one goes to the end of its row, so that none ever changes sides.
"""

from typing import NamedTuple

from . import curves, memories, other_forces, others, places, schedule
from .nominal import Kind

DEVELOPMENT, SCORED = "development", "scored"
STICK, LOG = "stick", "log"


class Definition(NamedTuple):
    """One definition: `of` an effect, or of how every machine sticks or is logged; its `name`.

    `half`: whether it is developed on or only scored; `kind`: how the effect is concealed by it.
    """

    of: str
    name: str
    half: str
    kind: Kind | None = None


# A rounded gap has no edge, a square wave no amplitude of a sine, two time constants are not one,
# a play without a spring has no windup, and a curve of another shape has another height at rest.
UNLIKE = {
    ("stribeck", "stretched"): ("stribeck_force", "stribeck_velocity"),
    ("actuator_deadband", "smooth"): ("deadband",),
    ("periodic_disturbance", "square"): ("amplitude",),
    ("thermal_drift", "two_constants"): ("time_constant",),
    ("backlash", "ideal_play"): ("windup",),
}


def _row(of: str, usual, further) -> list[Definition]:
    halves = (SCORED, DEVELOPMENT)
    return [
        *(Definition(of, name, DEVELOPMENT, kind) for name, kind in usual.items()),
        *(Definition(of, name, halves[i % 2], k) for i, (name, k) in enumerate(further.items())),
    ]


def _forms(kind: Kind, key: str, *names: str) -> dict[str, Kind]:
    return {name: others.with_form(kind, key, name) for name in names}


DEFINITIONS: tuple[Definition, ...] = (
    # Dry friction at rest: Karnopp's exact stick; LuGre's bristles, stiffer than anybody resolves;
    # tanh(v/v0), as many simulators have it.
    *_row(STICK, {"exact": None}, {"bristles": None, "smooth": None}),
    # The log: the encoder's position; the drive's own low-passed velocity beside it; a position
    # that comes at a third of the rate of the force, and is held.
    *_row(LOG, {"position": None}, {"filtered_velocity": None, "held_position": None}),
    *_row(
        "stribeck",
        _forms(curves.STRIBECK, "shape", "gaussian", "lorentzian", "exponential"),
        {"stretched": others.STRETCHED},
    ),
    *_row(
        "viscous_nonlinearity",
        _forms(curves.VISCOUS, "form", "quadratic", "shear_thinning", "power"),
        {},
    ),
    *_row(
        "load_dependent_friction",
        {"force": curves.LOADED},
        {"reaction": others.REACTION, "recorded_load": others.NORMAL},
    ),
    *_row(
        "cogging",
        {"harmonics": places.COGGING},
        {
            "current_ripple": other_forces.RIPPLE,
            "triangle": other_forces.TRIANGLE,
            "two_pitches": other_forces.TWO_PITCHES,
        },
    ),
    *_row(
        "presliding",
        {"dahl": memories.PRESLIDING},
        {"lugre": others.BRISTLES, "maxwell_slip": others.SLIPS},
    ),
    *_row(
        "backlash",
        {"two_mass": memories.BACKLASH},
        {"dry_load": others.DRY_GAP, "free_load": others.FREE_GAP, "ideal_play": others.PLAY},
    ),
    *_row(
        "compliance",
        {"viscous_load": memories.COMPLIANCE},
        {"dry_load": others.DRY_SPRING, "rubber": others.RUBBER},
    ),
    *_row("transport_delay", {"in_loop": memories.DELAY}, {"timestamp": others.TIMESTAMP}),
    *_row(
        "actuator_lag",
        {"first_order": memories.LAG},
        {"logged_position": others.LOGGED_LAG, "two_stages": others.TWO_STAGES},
    ),
    *_row("actuator_deadband", {"hard": memories.DEADBAND}, {"smooth": others.SMOOTH_GAP}),
    *_row(
        "actuator_saturation",
        {"knee": memories.SATURATION},
        {"clip": others.CLIPPED, "tanh": others.BENT},
    ),
    *_row(
        "thermal_drift",
        {"exponential": schedule.THERMAL},
        {"two_constants": other_forces.TWO_CONSTANTS, "work": other_forces.WORK},
    ),
    *_row("friction_step", {"step": schedule.STEP}, {"ramp": other_forces.RAMP}),
    *_row("periodic_disturbance", {"sine": schedule.TONE}, {"square": other_forces.SQUARE}),
    *_row("disturbance_pulses", {"cosine": schedule.PULSES}, {"blows": other_forces.BLOWS}),
)


def definitions(half: str = "all") -> tuple[Definition, ...]:
    """Those of one half, or all.

    **Raises:** `ValueError` for a half that there is none of.
    """
    if half not in ("all", DEVELOPMENT, SCORED):
        raise ValueError(f"No definitions {half}: give all, {DEVELOPMENT} or {SCORED}.")
    return tuple(d for d in DEFINITIONS if half in ("all", d.half))


def definition(of: str, name: str) -> Definition:
    """One definition.

    **Raises:** `ValueError`, with the names there are, for one that is not there.
    """
    found = {d.name: d for d in DEFINITIONS if d.of == of}
    if name not in found:
        raise ValueError(f"No definition {name} of {of}; there are {', '.join(found) or 'none'}.")
    return found[name]


def half_of(of: str, name: str) -> str:
    """The half of a definition; of an effect that has but one, development."""
    return next((d.half for d in DEFINITIONS if (d.of, d.name) == (of, name)), DEVELOPMENT)


def unlike(of: str, name: str) -> tuple[str, ...]:
    """Parameters of a definition that the law of the library has no true value of."""
    return UNLIKE.get((of, name), ())


def usual(of: str, form: str = "") -> str:
    """The definition by which an effect is drawn where none is asked for; `form` as it was drawn.

    An effect without a row in the table has one definition, its law.
    """
    found = [d.name for d in DEFINITIONS if d.of == of]
    return form if form in found else (found or ["law"])[0]
