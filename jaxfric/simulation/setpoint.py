"""The set-point that a controller follows, and its velocity."""

import jax.numpy as jnp


def slope(time, signal, together):
    """Difference quotient over both neighbours, or over the one that belongs to the segment."""
    steps = jnp.where(together, jnp.diff(time), 0.0)
    rises = jnp.where(together, jnp.diff(signal), 0.0)
    span = jnp.pad(steps, (1, 0)) + jnp.pad(steps, (0, 1))
    return (jnp.pad(rises, (1, 0)) + jnp.pad(rises, (0, 1))) / jnp.where(span > 0, span, 1.0)


def set_point(reference, controller, together):
    """The set-point, m, and its velocity, m/s; without either the axis starts at rest at zero."""
    given = reference.channels
    if controller is not None and "reference" in given:
        goal, velocity = given["reference"], given.get("reference_velocity")
    elif reference.position is not None:
        goal, velocity = reference.position, reference.velocity
    else:
        goal, velocity = jnp.zeros_like(reference.time), reference.velocity
    return goal, slope(reference.time, goal, together) if velocity is None else velocity
