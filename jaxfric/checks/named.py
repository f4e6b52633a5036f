"""What the name of a fitted parameter says of its sign."""

import re

# Of these no passive axis has less than zero: not their share by direction or by a wave over the
# position (`coulomb_asymmetry`, `inertia_cos`), which has either sign.
_PASSIVE = re.compile(r"(inertia|coulomb|viscous)(_\d+)?[+-]?")
# Of a bump that is negative for sure.
NO_STRIBECK = (
    "That is no Stribeck effect; friction that passes zero speed gradually, presliding, lag or a "
    "dead time near reversals looks so."
)


def passive(name: str) -> str:
    """Which of inertia, Coulomb and viscous friction a parameter is; empty for another one."""
    match = _PASSIVE.fullmatch(name)
    return match[1] if match else ""


def is_bump(name: str) -> bool:
    """Whether a parameter is the height of a Stribeck bump."""
    return name.startswith("stribeck_force")
