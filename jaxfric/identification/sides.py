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

    def fitted(
        self, unit: Float[Array, "2 d"], samples: compress.Straightened
    ) -> tuple[Float[Array, " 2"], Float[Array, "2 2"]]:
        """Height, N, of each direction's bump in the best fit, and the line, N and N·s/m, that the
        bump of that height makes of its own, `(2,)` and `(2, 2)`.

        **Arguments:** `unit`, a point of each unit cube; `samples` that the places stand for.
        """

        def side(item):
            unit, box, line, along, loads, weights = item
            contrast = rest = self.at(unit, box)
            shares = jnp.zeros(2, rest.dtype)
            for _ in range(2):  # once more for rounding
                more = along @ rest
                rest, shares = rest - more @ line, shares + more
            size, whole = weights @ rest**2, weights @ (1 + contrast) ** 2
            # A bump that is a straight line there has no height.
            visible = size > (100 * jnp.finfo(rest.dtype).eps) ** 2 * whole
            return jnp.where(visible, loads @ rest / jnp.where(visible, size, 1.0), 0.0), shares

        lines, against = samples.lines(self.places), self.moments.against
        rows = lines, against[:, :2], against[:, 2], self.moments.weights
        height, shares = jax.vmap(side)((unit, self.boxes, *rows))
        return height, height[:, None] * samples.lines.straight(shares)

    def gained(self, unit: Float[Array, "2 d"], samples: compress.Straightened):
        """What the best fit on the places takes off the cost of the samples, N²·s."""
        low, high = (
            reduced.decode(*pair, self.logarithmic) for pair in zip(unit, self.boxes, strict=True)
        )

        def bump(speed, side):
            beta = jnp.where(side[:, None] == 1, high[None, :], low[None, :])
            return jax.vmap(self.bump)(beta, speed)

        return samples.gained(bump, *self.fitted(unit, samples))

    def refined(self, start: Float[Array, "2 d"], cell: Float[Array, "2 d"]):
        """The minimiser of each direction near its start, `(2, d)`, and which converged."""
        from . import refine  # optimistix takes long to import, and a kept program does without

        def side(rows, box, start, cell):
            return refine.descend(lambda y: -rows.gains(self.at(y, box)[None])[0, 0], start, cell)

        return reduced.each(side, self.moments, self.boxes, start, cell)
