"""URDF: a joint with <dynamics damping friction>."""

from xml.sax.saxutils import escape

from ..models import Model
from .cost import Range
from .outcome import Exported
from .simple import joint
from .syntax import literal


def export(
    model: Model, name: str = "axis", speed: Range | None = None, position: Range | None = None
) -> Exported:
    """The joint of URDF nearest to the model, as an element to be put into a robot."""
    fitted = joint(model, speed, position)
    kind = "continuous" if fitted.rotary else "prismatic"
    limit = "" if fitted.rotary else "\n  <!-- <limit .../> is yours to add -->"
    text = f"""<joint name="{escape(name)}" type="{kind}">
  <!-- Identified by jaxfric: put dynamics into the joint of your robot. -->
  <parent link="base_link"/>
  <child link="{escape(name)}_link"/>
  <axis xyz="{"0 0 1" if fitted.rotary else "1 0 0"}"/>{limit}
  <dynamics damping="{literal(fitted.damping)}" friction="{literal(fitted.friction)}"/>
</joint>
"""
    remarks = list(fitted.remarks)
    if fitted.inertia:
        remarks.append(f"The inertia, {fitted.inertia:.6g}, belongs to the links: not written.")
    return Exported(text, fitted.force_error, fitted.left_out, tuple(remarks), fitted.speed)
