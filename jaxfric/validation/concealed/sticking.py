"""How a healthy machine's dry friction holds at rest, by definition."""

from .nominal import Nominal
from .variants import LUGRE

# tanh(v/v0) creeps by v0/2 under half the Coulomb force: a five-hundredth of the top speed, as
# simulators that have it advise.
_SMOOTH = 2e-3
# Integration steps a sample with which a stable bristle is shorter than a hundredth of F/M dt²: the
# axis, turned round by twice its friction F, passes it in a tenth of a sample.
_STIFF = 43


def fewest(name: str) -> int:
    """Integration steps a sample that a definition of `stick` takes at least."""
    return _STIFF if name == "bristles" else 1


def sticking(name: str, n: Nominal) -> dict[str, float]:
    """The simulator's parameters of a definition of `stick`; none of the usual one."""
    level = max(n.physics[f"coulomb{s}"] + n.physics[f"bump{s}"] for s in "+-")
    if name == "smooth":
        return {"smooth_speed": _SMOOTH * n.top, "still": 3 * _SMOOTH * n.top}
    if name == "bristles":
        stable = 1.6 * level / n.mass * (n.substep / 0.3) ** 2
        return {
            "presliding": 1.0, "presliding_shape": LUGRE, "bristle_damping": 0.7,
            "presliding_distance": max(1e-6 * n.plan.stroke, stable),
        }  # fmt: skip
    return {}
