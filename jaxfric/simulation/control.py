"""What closes the loop around an axis: position controllers and the encoder that they read."""

from abc import abstractmethod
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray


class Feedback(NamedTuple):
    """What a controller sees at one sample; every field is a scalar.

    `interval`: time to the next sample, s. `reference`, `reference_velocity`: the set-point, m and
    m/s. `position`, `velocity`: the motion as measured, m and m/s.
    """

    interval: Float[Array, ""]
    reference: Float[Array, ""]
    reference_velocity: Float[Array, ""]
    position: Float[Array, ""]
    velocity: Float[Array, ""]


class AbstractController(eqx.Module):
    """A position controller in discrete time; its force is held until the next sample.

    `limit` is the largest magnitude of the force, N; infinite by default.
    """

    limit: eqx.AbstractVar[Float[Array, ""]]

    @abstractmethod
    def start(self) -> Any:
        """The controller's memory before the first sample, a pytree of arrays."""

    @abstractmethod
    def law(self, memory: Any, feedback: Feedback) -> tuple[Float[Array, ""], Any]:
        """The force before the limit, N, and the memory for the next sample."""

    def __call__(self, memory: Any, feedback: Feedback) -> tuple[Float[Array, ""], Any]:
        """The force, N, and the memory; the memory stands still while the force is at its limit.

        Standing still is the usual anti-windup by conditional integration (Åström & Hägglund,
        "PID Controllers", 2nd ed. 1995, section 3.5).
        """
        force, following = self.law(memory, feedback)
        limited = jnp.clip(force, -self.limit, self.limit)
        kept = jax.tree.map(
            lambda old, new: jnp.where(force == limited, new, old), memory, following
        )
        return limited, kept


_INFINITE = float("inf")


class PD(AbstractController):
    """u = kp (q_r − q) + kd (v_r − v) (the controller of Kim, Kim & Ha 2004, fig. 2).

    **Arguments:** `kp`, N/m; `kd`, N·s/m; `limit`, N.
    """

    kp: Float[Array, ""] = eqx.field(converter=jnp.asarray)
    kd: Float[Array, ""] = eqx.field(converter=jnp.asarray)
    limit: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=_INFINITE)

    def start(self):
        return ()

    def law(self, memory, feedback: Feedback):
        f = feedback
        error = f.reference - f.position
        return self.kp * error + self.kd * (f.reference_velocity - f.velocity), memory


class PID(AbstractController):
    """u = kp (q_r − q) + ki ∫(q_r − q) dt + kd (v_r − v), the integral by the rectangular rule.

    **Arguments:** `kp`, N/m; `ki`, N/(m·s); `kd`, N·s/m; `limit`, N.
    """

    kp: Float[Array, ""] = eqx.field(converter=jnp.asarray)
    ki: Float[Array, ""] = eqx.field(converter=jnp.asarray)
    kd: Float[Array, ""] = eqx.field(converter=jnp.asarray)
    limit: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=_INFINITE)

    def start(self):
        return jnp.zeros_like(self.kp)

    def law(self, memory, feedback: Feedback):
        f = feedback
        error = f.reference - f.position
        integral = memory + error * f.interval
        rate = self.kd * (f.reference_velocity - f.velocity)
        return self.kp * error + self.ki * integral + rate, integral


class Cascade(AbstractController):
    """u = kv (kp (q_r − q) − v): a velocity loop inside a position loop, without feed-forward.

    The controller of the EMPS benchmark (Janot, Gautier & Brunot 2019).

    **Arguments:** `kp`, 1/s; `kv`, N·s/m; `limit`, N.
    """

    kp: Float[Array, ""] = eqx.field(converter=jnp.asarray)
    kv: Float[Array, ""] = eqx.field(converter=jnp.asarray)
    limit: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=_INFINITE)

    def start(self):
        return ()

    def law(self, memory, feedback: Feedback):
        f = feedback
        return self.kv * (self.kp * (f.reference - f.position) - f.velocity), memory


class Encoder(eqx.Module):
    """A position sensor: white noise, then rounding to whole counts.

    **Arguments:** `resolution`, m per count; `noise`, standard deviation before rounding, m.

    The derivative of a rounded position is zero almost everywhere, which would hide every
    parameter from a gradient; the encoder therefore passes derivatives as if it did not round
    ("straight-through").
    """

    resolution: Float[Array, ""] = eqx.field(converter=jnp.asarray)
    noise: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.0)

    def __check_init__(self):
        known = not isinstance(self.resolution, jax.core.Tracer)
        if known and not bool(np.all(np.asarray(self.resolution) > 0)):
            raise ValueError(
                f"Encoder(resolution={self.resolution}): the resolution must be positive, in "
                "units of position per count; leave the encoder out for an ideal sensor."
            )

    def draw(self, key: PRNGKeyArray | None, count: int, dtype) -> Float[Array, " N"]:
        """The sensor noise of `count` samples, m; zero without a key."""
        if key is None:
            return jnp.zeros(count, dtype)
        return self.noise * jax.random.normal(key, (count,), dtype)

    def read(self, position: Float[Array, ""], noise: Float[Array, ""]) -> Float[Array, ""]:
        """The position as a whole number of counts, m."""
        exact = position + noise
        rounded = jnp.round(exact / self.resolution) * self.resolution
        return exact + jax.lax.stop_gradient(rounded - exact)
