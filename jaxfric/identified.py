"""What an identification returns: the parameters, how sure they are, and how it ended."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from . import uncertainty
from .models import Model
from .uncertainty import Estimate
from .units import spell


class Result(eqx.Enumeration):
    """Whether the parameters are determined; each member's text is the diagnosis and the remedy.

    How well the model describes the force is another question, which no further data of the kind
    would settle: a parameter of a poor model can be known exactly. `force_error` and
    [`Identified.diagnosis`][] answer it.
    """

    successful = "The parameters were identified."
    on_border = (
        "The cost is least on the border of a nonlinear parameter's bounds, so that parameter is "
        "not determined. Excite slower motion (the Stribeck velocity must lie well inside the "
        "speeds that the axis slips at), give bounds, or use a model without the bump."
    )
    not_converged = (
        "The refinement stopped before it converged; the parameters are those of the best point "
        "found, never worse than the grid's. Usually the bump hardly shows in the data."
    )
    not_excited = (
        "Condition (15) fails: some columns are linearly dependent on this recording, so that the "
        "parameters with infinite standard error are not determined. Move in both directions and "
        "over a range of speeds, neither constant speed nor rest alone."
    )
    open_windows = (
        "Condition (14) fails: no window with equal end velocities lets the axis slip. Record "
        "until the axis returns to a velocity that it had before (rest, or a whole period), or "
        "use the weak form."
    )
    no_slip = (
        "The axis never slips: its speed does not rise above its noise. Check the velocity or the "
        "column that it was read from, or move faster."
    )
    not_finite = (
        "The signals contain NaN or infinity at samples marked valid. Mask those samples "
        "(Recording(mask=...)) or repair the log."
    )


# Below this share of the force's power the model explains less than it leaves, whatever the axis.
LEAST_EXPLAINED = 0.5


class Identified(eqx.Module):
    """What identification found.

    - `model`: the sum with its parameters, a [`Model`][jaxfric.models.Model].
    - `covariance`: of `names`, shape `(P, P)`; infinite where not visible.
    - `result`: a member of [`Result`][].
    - `windows`, `covered`: how many windows were used and which share of the slip time they hold.
    - `force_error`: norm(u − û)/norm(u) of the rows of the weak form in slip, inertia included.
    - `cost`: the minimum of the reduced cost, N²·s.
    - `open_ends`: by how much the affine parameters would have been off had the whole record been
      used, open ends and all: M D⁻¹ ∫ v̇ g dt, in the order of the affine parameters, `(p,)`;
      zero in the weak form.
    - `projection`: "closed_windows" or "weak_form".
    """

    model: Model
    covariance: Float[Array, "P P"]
    result: Result
    windows: Float[Array, ""]
    covered: Float[Array, ""]
    force_error: Float[Array, ""]
    cost: Float[Array, ""]
    open_ends: Float[Array, " p"]
    projection: str = eqx.field(static=True)

    @property
    def describes(self) -> Bool[Array, ""]:
        """Whether the model explains more of the force's power than it leaves."""
        return self.force_error**2 <= 1 - LEAST_EXPLAINED

    @property
    def diagnosis(self) -> str:
        """What the result means, and a word where the model does not describe the force.

        For one recording; of a batch, take a row.
        """
        text = str(Result[self.result])
        if bool(self.describes) or not bool(jnp.isfinite(self.force_error)):
            return text
        return (
            f"{text} The model leaves {float(self.force_error):.0%} of the force: more than half "
            "of its power is neither friction of this kind nor inertia, so that these parameters "
            "describe the recording badly. jaxfric explain says what the model leaves out."
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, affine ones first."""
        term = self.model.term
        return tuple(p.name for p in (*term.affine, *term.nonlinear))

    @property
    def parameters(self) -> dict[str, Estimate]:
        """Each parameter's value, standard error and unit, by name."""
        term, units = self.model.term, dict(self.model.units)
        variances = self.covariance.diagonal(axis1=-2, axis2=-1)
        # A result moved to numpy stays there, so that reading it compiles nothing.
        numpy = isinstance(variances, np.ndarray)
        errors = np.sqrt(variances) if numpy else jnp.sqrt(variances)
        freedom = uncertainty.COSINES
        values = self.model.parameters
        return {
            p.name: Estimate(values[p.name], errors[..., i], spell(p.dimension, units), freedom)
            for i, p in enumerate((*term.affine, *term.nonlinear))
        }


def raise_unless_successful(found: Identified) -> None:
    """Raises `ValueError` with the diagnosis of the first row that is not successful."""
    fine = result_names().index("successful")
    for i, index in enumerate(jnp.ravel(found.result._value)):
        if int(index) != fine:
            row = f"Row {i}: " if jnp.ndim(found.result._value) else ""
            raise ValueError(row + Result[getattr(Result, result_names()[int(index)])])


def result_names() -> tuple[str, ...]:
    """Names of the members of [`Result`][], in the order of their numbers."""
    return tuple(Result._name_to_item)
