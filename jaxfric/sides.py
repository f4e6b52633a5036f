"""The two directions of motion, each with one bump of its own: two problems that share the rows."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from . import compress, reduced


class Sides(NamedTuple):
    """One bump as a function of β and places, the places of the moments, and each direction's
    bounds of β, `(2, 2, d)`; `alike`: whether these are known to be the same. `coarse`: what the
    grid takes for the bump.
    """

    bump: Callable[[Float[Array, " d"], Float[Array, " J"]], Float[Array, " J"]]
    coarse: Callable[[Float[Array, " d"], Float[Array, " J"]], Float[Array, " J"]]
    places: Float[Array, " J"]
    moments: reduced.Moments
    boxes: Float[Array, "2 2 d"]
    logarithmic: tuple[bool, ...]
    alike: bool = False

    def at(self, unit: Float[Array, " d"], box: Float[Array, "2 d"]) -> Float[Array, " J"]:
        """The bump at a point of one direction's unit cube."""
        return self.bump(reduced.decode(unit, box, self.logarithmic), self.places)

    def costs(self, grid: Float[Array, "G d"]) -> Float[Array, "2 G"]:
        """The cost of each direction over its own bounds."""

        def at(unit, box):
            return self.coarse(reduced.decode(unit, box, self.logarithmic), self.places)

        if self.alike:  # the bumps of one serve both
            return reduced.grid_costs(lambda unit: at(unit, self.boxes[0]), grid, self.moments)

        def side(rows, box):
            return reduced.grid_costs(lambda unit: at(unit, box), grid, rows)[0]

        return reduced.each(side, self.moments, self.boxes)

    def gains(self, units: Float[Array, "2 k d"]) -> Float[Array, "2 k"]:
        """What each direction's bump takes off its cost, at some points of its unit cube."""

        def side(rows, box, points):
            return rows.gains(jax.vmap(lambda unit: self.at(unit, box))(points))[0]

        return reduced.each(side, self.moments, self.boxes, units)

    def check(self, units: Float[Array, "2 k d"], samples: compress.Straightened):
        """The gains on the samples that the places stand for, `(2, k)`."""

        def decoded(units, box):
            return jax.vmap(lambda unit: reduced.decode(unit, box, self.logarithmic))(units)

        betas = jax.vmap(decoded)(units, self.boxes)
        values = jax.vmap(jax.vmap(self.bump, (0, None)), (0, None))(betas, self.places)
        shares = jnp.einsum("dim,dkm->dik", self.moments.against[:, :2], values)

        def bumps(speed, side):
            def one(low, high):
                beta = jnp.where(side[:, None] == 1, high[None, :], low[None, :])
                return jax.vmap(self.bump)(beta, speed)

            return jax.vmap(one)(*betas)

        return samples.gains(bumps, shares)

    def affine(
        self, unit: Float[Array, "2 d"], most: Float[Array, " 2"], samples: compress.Straightened
    ) -> Float[Array, "2 3"]:
        """Constant, N, slope, N·s/m, and height of the bump, N, of each direction's best fit.

        **Arguments:** `unit`, a point of each unit cube; `most`, the bump's values at the slowest
        speed, of which `bump` here is the ratio less one; `samples` that the places stand for.
        """

        def side(item):
            unit, box, most, line, along, loads, weights = item
            contrast = rest = self.at(unit, box)
            shares = jnp.zeros(2, rest.dtype)
            for _ in range(2):  # once more for rounding
                more = along @ rest
                rest, shares = rest - more @ line, shares + more
            size, whole = weights @ rest**2, weights @ (1 + contrast) ** 2
            limits = jnp.finfo(rest.dtype)
            # A bump that is a straight line there, or vanishes in all samples, has no height.
            visible = (size > (100 * limits.eps) ** 2 * whole) & (most > limits.tiny**0.5)
            force = jnp.where(visible, loads @ rest / jnp.where(visible, size, 1.0), 0.0)
            return shares, force, force / jnp.where(visible, most, 1.0)

        lines, against = samples.lines(self.places), self.moments.against
        rows = lines, against[:, :2], against[:, 2], self.moments.weights
        shares, force, height = jax.lax.map(side, (unit, self.boxes, most, *rows))
        straight = samples.taken - force[:, None] * samples.lines.straight(shares)
        return jnp.stack([straight[:, 0] - force, straight[:, 1], height], axis=1)

    def refined(self, start: Float[Array, "2 d"], cell: Float[Array, "2 d"]):
        """The minimiser of each direction near its start, `(2, d)`, and which converged."""
        from . import refine  # optimistix takes long to import, and a kept program does without

        def side(rows, box, start, cell):
            return refine.descend(lambda y: -rows.gains(self.at(y, box)[None])[0, 0], start, cell)

        return reduced.each(side, self.moments, self.boxes, start, cell)
