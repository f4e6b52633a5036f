"""The rows of the weak form that a fit is judged by."""

from typing import NamedTuple

from jaxtyping import Array, Float

# What a remark is about changes the force by a twentieth of its size, or it is no matter.
MATTERS = 0.05
# It takes half of the power that the model leaves: two parts of a record with parameters of their
# own take p of J rows' power from noise, which is far less (see ROWS).
HALF = 0.5
# The linearity of a good torque or current sensor, relative: a force below it, with respect to the
# force's root mean square, cannot be told from the sensor whatever its p-value.
LINEARITY = 2e-3


class Design(NamedTuple):
    """The rows of the weak form that a fit is judged by.

    - `columns`: derivatives of the rows by all parameters, affine ones first, `(J, P)`.
    - `target`: the force, N, and `left`, what the model leaves of it, `(J,)`.
    - `weight`: s, `(J,)`, zero where the axis does not slip one way; `time`: s, `(J,)`.
    - `shift`: by how much each parameter moves for a second by which the force is taken too late,
      `(P,)`, of the fit itself, which closed windows make of other rows than these.
    - `forward`: the columns of friction where the axis moves forward, zero elsewhere, `(J, k)`;
      `None` where the direction of the rows is not known.
    - `velocity`: m/s, `(J,)`, through the same kernel.
    """

    columns: Float[Array, "J P"]
    target: Float[Array, " J"]
    left: Float[Array, " J"]
    weight: Float[Array, " J"]
    time: Float[Array, " J"]
    shift: Float[Array, " P"]
    forward: Float[Array, "J k"] | None = None
    velocity: Float[Array, " J"] | None = None
