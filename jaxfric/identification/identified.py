"""What an identification returns: the parameters, how sure they are, and how it ended."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .. import checks
from ..checks import Remark
from ..data.recording import Recording
from ..looks import drawing, html, text
from ..looks.text import Block
from ..models import Model
from ..units import VELOCITY, spell
from . import batch, constant_load, curves, documents, tabulate, uncertainty
from .breakaway import breakaway
from .constant_velocity import constant_velocity
from .uncertainty import Estimate

SINGLE = (
    "It ran in single precision, whose rounding may be why: switch on 64 bits before reading, "
    'jax.config.update("jax_enable_x64", True).'
)


class Result(eqx.Enumeration):
    """Whether the parameters are determined; each member's text is the diagnosis and the remedy.

    What is certain to be wrong is not `successful`: a model that leaves most of the force, an axis
    that drives itself, signals that contradict each other. [`Identified.remarks`][] say more.
    """

    successful = "The parameters were identified."
    on_border = (
        "The cost is least on the border of a nonlinear parameter's bounds, so that this parameter "
        "is not determined. Give other bounds, or use a model without the term that it belongs to; "
        "for a Stribeck velocity excite slower motion too, as it must lie well inside the speeds "
        "that the axis slips at."
    )
    not_converged = (
        "The refinement stopped before it converged; the parameters are those of the best point "
        "found, never worse than the grid's. Usually the bump hardly shows in the data."
    )
    ambiguous = (
        "The cost has another minimum, elsewhere in the bounds, that the noise alone could have "
        "made the lowest, or friction still falls at the fastest speed, and a bump wider than the "
        "bounds would do as well: a nonlinear parameter is not singled out. Give bounds around the "
        "value that the machine's data sheet suggests, or record longer, faster and over more of "
        "the stroke."
    )
    not_described = (
        "The model leaves more than half of the force's power, so that its parameters describe the "
        "recording badly. Is it the force column of this axis, with its time? Else something large "
        "is missing from the model: jaxfric explain says what."
    )
    not_passive = (
        "Inertia or friction is negative beyond its interval, as in no passive axis. The force or "
        "the motion has the wrong sign (--scale force=-1), the force is late, or a large load is "
        "taken for friction."
    )
    contradictory = (
        "The signals of the recording contradict each other, so that no parameter can be trusted."
    )
    not_excited = (
        "This recording does not determine all parameters: the force of some is zero along it, or "
        "others give the same (linearly dependent columns, condition (15) of Kim, Kim & Ha 2004). "
        "Their standard error is infinite. Move in both directions and over a range of speeds, "
        "neither constant speed nor rest alone."
    )
    open_windows = (
        "The axis slips in no stretch that ends at the velocity at which it began, in which mass "
        "and acceleration cancel (condition (14) of Kim, Kim & Ha 2004). Record until the axis "
        "returns to a velocity that it had before (rest, or a whole period), or use the weak form."
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

    Of a batch every leaf has a leading axis. `fits[i]` is the row `i` as an `Identified` of its
    own, `fits[2:5]` a smaller batch, `len(fits)` the number of rows.

    - `model`: the sum with its parameters, a [`Model`][jaxfric.models.Model].
    - `covariance`: of `names`, shape `(P, P)`; infinite where not visible. Outside of `jax.jit` it
      holds what a force that acts up to one and a half samples late makes of the parameters, and
      one that a warning says is later (`force_late`), to first order.
    - `result`: a member of [`Result`][].
    - `windows`, `covered`: how many windows were used and which share of the slip they hold: of its
      time or, in closed windows, the root of that of its squared speed in one direction, whichever
      is least.
    - `filtered_force_error`: norm(u − û)/norm(u) of the rows of the weak form in slip, inertia
      included: what `predict` misses through the kernel that the rows have.
    - `cost`: the minimum of the reduced cost, N²·s.
    - `open_ends`: by how much the affine parameters would have been off had the whole record been
      used, open ends and all: M D⁻¹ ∫ v̇ g dt, in the order of the affine parameters, `(p,)`;
      zero in the weak form.
    - `weak`: whether it was found by the weak form and not in closed windows, as `projection` says.
    - `warnings`: the number of each of `jaxfric.checks.KINDS` that was found, NaN of the others,
      `(W,)`; all NaN inside `jax.jit`, where the signals have no values yet.
    - `rival`: the nonlinear parameters of another minimum that the data do not tell from the one
      reported, `(d,)`; NaN where there is none.
    - `border`: which nonlinear parameters lie on the border of their bounds, `(d,)`.
    """

    model: Model
    covariance: Float[Array, "P P"]
    result: Result
    windows: Float[Array, ""]
    covered: Float[Array, ""]
    filtered_force_error: Float[Array, ""]
    cost: Float[Array, ""]
    open_ends: Float[Array, " p"]
    weak: Bool[Array, ""]
    rival: Float[Array, " d"] | None = None
    warnings: Float[Array, " W"] = eqx.field(default_factory=checks.none)
    border: Bool[Array, " d"] | None = None

    def __len__(self) -> int:
        if not np.ndim(self.result._value):
            raise TypeError(
                "This is one identification, not a batch: it has no rows. Its numbers are in "
                '.parameters, as .parameters["coulomb+"].value.'
            )
        return np.shape(self.result._value)[0]

    def __bool__(self) -> bool:
        return True

    def __getitem__(self, row) -> "Identified":
        """One row of a batch by its number, counted from the end if negative; or some, by a slice
        or an array.
        """
        size = len(self)
        # An array of jax takes its last row for a number that is too large.
        if isinstance(row, int | np.integer) and not -size <= row < size:
            raise IndexError(f"There is no row {row}: the batch has {size}, from 0.")
        return jax.tree.map(lambda x: x[row], self)

    def _require_one(self, name: str) -> None:
        if np.ndim(self.result._value):
            raise ValueError(f"A batch has no {name} of its own. {text.A_ROW}")

    @property
    def diagnosis(self) -> str:
        """What the result means; for one recording: of a batch, take a row."""
        self._require_one("diagnosis")
        # By its name: equinox has no words for a member that is a number of numpy.
        said = str(Result[getattr(Result, self.result_name)])
        if self.result_name == "not_described":
            return f"{said} {float(self.filtered_force_error):.0%} of the force is left."
        if self.result_name == "ambiguous":
            return f"{said} The other one: {self._elsewhere()}."
        if self.result_name == "not_converged" and self.model.alpha.dtype == jnp.float32:
            return f"{said} {SINGLE}"
        if self.result_name == "on_border" and self.border is not None:
            return f"{said} On its border: {self._on_border()}."
        if self.result_name == "not_excited":
            return self._not_determined(said)
        return said

    @property
    def result_name(self) -> str:
        """The name of the result's member; for one recording: of a batch, take a row."""
        self._require_one("result_name")
        return result_names()[int(self.result._value)]

    def _elsewhere(self) -> str:
        """Where the rival minimum lies, in words."""
        searched, units = self.model.term.nonlinear, dict(self.model.units)
        return ", ".join(
            f"{p.name} = {float(value):.6g} {spell(p.dimension, units)}".strip()
            for p, value in zip(searched, self.rival, strict=True)
        )

    def _on_border(self) -> str:
        """The parameters on the border of their bounds."""
        names = [p.name for p in self.model.term.nonlinear]
        return ", ".join(
            n for n, there in zip(names, np.asarray(self.border), strict=True) if there
        )

    def _not_determined(self, said: str) -> str:
        """What was `said` with the parameters that the recording does not show, and why not."""
        known = np.isfinite(np.diagonal(np.asarray(self.covariance)))
        hidden = [name for name, seen in zip(self.names, known, strict=True) if not seen]
        if not hidden or len(hidden) == len(self.names):
            return said
        names = f"Not determined: {', '.join(hidden)}."
        why = constant_load.twice(hidden)
        return (
            f"This recording does not determine all parameters. {names} {why}"
            if why
            else f"{said} {names}"
        )

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is wrong with the recording or the fit, in sentences; of a batch, take a row."""
        self._require_one("remarks")
        load = constant_load.remark(self)
        return (*checks.remarks(self.warnings, dict(self.model.units)), *([load] if load else ()))

    @property
    def projection(self) -> str:
        """The way it was found, "closed_windows" or "weak_form"; "mixed" where rows differ."""
        weak = np.asarray(self.weak)
        return "weak_form" if weak.all() else "mixed" if weak.any() else "closed_windows"

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

    def __repr__(self) -> str:
        return text.shown(self, _blocks)

    def _repr_html_(self) -> str:
        return html.shown(self, _blocks, self._sketch)

    def _sketch(self, figure) -> None:
        if not np.isfinite(np.diagonal(self.covariance)).any():
            raise ValueError("Nothing was visible, so that there is no curve.")
        figure.set_size_inches(7, 4)
        self.plot(ax=figure.subplots())

    def plot(self, recording: Recording | None = None, *, ax=None):
        """The identified friction over velocity with its 95 % band, by matplotlib.

        **Arguments:** `recording` that it was identified from: then the measured force less
        inertia is drawn beside it, over the recorded speeds, the mean force at constant velocity,
        and the break-away levels; `ax`, matplotlib's axes to draw on.

        **Returns:** the axes.

        **Raises:** `ValueError` for a batch, or without matplotlib.
        """
        self._require_one("plot()")
        axes = drawing.panels(ax, 1, 4.4)[0]
        units, source = dict(self.model.units), "" if recording is None else recording.source
        if recording is None:
            sides = curves.sides(self)
        else:
            prepared = curves.prepared(recording)
            sides = curves.measured(self, prepared, curves.rows(self, prepared))
            drawing.held(axes, constant_velocity(recording, self))
            drawing.broken_away(axes, breakaway(recording, self))
        drawing.friction(axes, sides, units, spell(VELOCITY, units), curves.name(source))
        return axes

    def to_dict(self, recording: Recording | None = None) -> dict[str, Any]:
        """The identification as plain data for JSON (schema `jaxfric.identification/1`).

        **Arguments:** `recording` that it was identified from, so that its facts are in it as well.

        **Raises:** `ValueError` for a batch.
        """
        self._require_one("to_dict()")
        return documents.finite(self._document(recording))

    def report(self, recording: Recording) -> str:
        """What the command says of an identification: `print(fit)` and what needs the recording.

        That is the constant-velocity test, which may contradict the curve, and the break-away
        levels.

        **Arguments:** `recording` that it was identified from.

        **Raises:** `ValueError` for a batch.
        """
        self._require_one("report()")
        return tabulate.identification(self._document(recording), automatic=False)

    def _document(self, recording: Recording | None) -> dict[str, Any]:
        test = None if recording is None else constant_velocity(recording, self)
        stick = None if recording is None else breakaway(recording, self)
        return documents.identification(text.on_host(self), recording, test=test, stick=stick)

    def to_pandas(self):
        """The parameters with their 95 % intervals as a table of pandas.

        **Returns:** a `DataFrame` with the columns `parameter`, `value`, `standard_error`, `low`,
        `high`, `unit`; of a batch also `row` and `result`, first and last.

        **Raises:** `ValueError` if pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise ValueError("to_pandas() needs pandas: pip install pandas.") from error
        return pandas.DataFrame(batch.columns(text.on_host(self), result_names()))


def _blocks(found: Identified) -> Sequence[Block]:
    """What to say of an identification of arrays of numpy."""
    if found.covariance.ndim > 2:
        return batch.blocks(found, result_names())
    return tabulate.identified(documents.identification(found))


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
