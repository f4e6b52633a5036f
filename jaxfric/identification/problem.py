"""Problem (L) of Kim, Kim & Ha (2004), eq. (17), of one recording over its nonlinear parameters."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data.recording import Recording
from ..terms.base import AbstractTerm, Directional, summands
from . import reduced
from .projections import Rows


class Problem(eqx.Module):
    """Problem (L) of one recording over the unit cube of its nonlinear parameters."""

    term: AbstractTerm
    recording: Recording
    rows: Rows
    box: Float[Array, "2 d"]
    logarithmic: tuple[bool, ...] = eqx.field(static=True)
    alike: bool = eqx.field(static=True)

    def columns(self, term: AbstractTerm, unit, box=None) -> Float[Array, "J k"]:
        """The rows of the nonlinear columns of a term at a point of the unit cube, or of `box`,
        that of one direction.
        """
        one_way = box is not None
        box, logarithmic = (box, self.logarithmic_side) if one_way else (self.box, self.logarithmic)
        beta = reduced.decode(unit, box, logarithmic)
        return self.rows.columns(term.with_beta(beta), self.recording)

    @property
    def order(self) -> np.ndarray:
        """Where the parameters of each direction stand in β, where it has its own, `(2, d/2)`."""
        sides, start = (list[int](), list[int]()), 0
        for part in summands(self.term):
            if isinstance(part, Directional):
                for own, side in zip(sides, (part.positive, part.negative), strict=True):
                    own += range(start, start + len(side.nonlinear))
                    start += len(side.nonlinear)
        return np.array(sides)

    @property
    def logarithmic_side(self) -> tuple[bool, ...]:
        """Whether the scale of each parameter of one direction is a ratio."""
        return tuple(self.logarithmic[i] for i in self.order[0])

    @property
    def boxes(self) -> Float[Array, "2 2 d"]:
        """The bounds of each direction's β, where it has its own."""
        return jnp.moveaxis(self.box[:, self.order], 1, 0)

    @property
    def root(self) -> Float[Array, " J"]:
        """Square roots of the rows' weights."""
        return reduced.root(self.rows.positive + self.rows.negative)

    def thinned(self, step: int) -> "Problem":
        """The same rows from one of so many samples, for a first look."""
        rows, recording = self.rows.thinned(self.recording, step)
        return eqx.tree_at(lambda p: (p.rows, p.recording), self, (rows, recording))

    def target(self) -> Float[Array, " J"]:
        """The weighted force without the known part of the term."""
        return self.root * (self.rows.target - self.rows.offset(self.term, self.recording))

    def weighted(self, unit):
        """All weighted columns at a point of the unit cube, `(J, p)`, and the weighted force."""
        return self.root[:, None] * self.columns(self.term, unit), self.target()

    def fixed(self) -> Float[Array, "J q"]:
        """The weighted columns without β."""
        columns = self.rows.columns(reduced.part(self.term, False), self.recording)
        return self.root[:, None] * columns

    def linear(self):
        """Orthonormal weighted columns without β, root weights, and the weighted force less
        their part in it.
        """
        basis = reduced.orthonormal(self.fixed())
        return basis, self.root, reduced.project_out(basis, self.target()[:, None])[:, 0]

    def residuals(self):
        """The function from the unit cube to the residual whose squared norm is L(β)."""
        basis, root, target = self.linear()
        bumps = reduced.part(self.term, True)

        def residuals(unit):
            columns = root[:, None] * self.columns(bumps, unit)
            return reduced.residual(basis, target, columns)

        return residuals
