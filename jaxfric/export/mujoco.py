"""MuJoCo: a default class for a joint, with frictionloss, damping, armature and a spring.

MuJoCo's dry friction is a soft constraint: below break-away a joint creeps. Its softness is scaled
by the weight of the bodies without the armature, so that with its default impedance a light body
with a large armature is hardly held at all (seen with MuJoCo 4.0). The impedance written here is
the hardest that MuJoCo takes.
"""

from xml.sax.saxutils import escape

from ..models import Model
from .cost import Range
from .outcome import Exported
from .simple import joint
from .syntax import literal

# Impedance of the friction constraint, constant at mjMAXIMP: width, midpoint and power then idle.
HARD = "0.9999 0.9999 0.001 0.5 2"


def export(
    model: Model, name: str = "axis", speed: Range | None = None, position: Range | None = None
) -> Exported:
    """The joint of MuJoCo nearest to the model, as an MJCF document that others can include."""
    fitted = joint(model, speed, position, spring=True)
    attributes = {"damping": fitted.damping, "frictionloss": fitted.friction}
    if fitted.inertia > 0:
        attributes["armature"] = fitted.inertia
    if fitted.stiffness > 0:
        attributes |= {"stiffness": fitted.stiffness, "springref": fitted.rest}
    written = " ".join(f'{key}="{literal(value)}"' for key, value in attributes.items())
    written += f' solimpfriction="{HARD}"' * (fitted.friction > 0)
    kind = "hinge" if fitted.rotary else "slide"
    text = f"""<mujoco model="{escape(name)}">
  <!-- Identified by jaxfric. Use it as <joint class="{escape(name)}" type="{kind}" .../>.
       armature is the whole inertia of the axis: take off what its bodies weigh already. -->
  <default>
    <default class="{escape(name)}">
      <joint {written}/>
    </default>
  </default>
</mujoco>
"""
    remarks = (
        *fitted.remarks,
        "frictionloss is a soft constraint: a loaded joint at rest creeps, the less the more of "
        "the inertia is in its bodies instead of the armature.",
    )
    return Exported(text, fitted.force_error, fitted.left_out, remarks, fitted.speed)
