"""What feed-forward by a model would be worth on a machine, in closed loop: `benefit`."""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data.recording import Recording
from ..models import Model
from .control import PD, AbstractController, Feedback
from .prediction import predict
from .simulating import simulate

# Bandwidth of the default controller, rad a sample: the hold delays by half a sample, which at this
# bandwidth is 3 degrees of phase, so that the sample rate does not show in the answer.
BANDWIDTH = 0.1

ASSUMED = (
    "Assumed: the machine is this model, the sensor is exact, the force is held for one sample and "
    "not delayed otherwise, and the force of the compensating model along the set-point, inertia "
    "included, is added to the controller's, which is the same in both runs."
)
# Of feed-forward by the very model that stands for the machine: nothing of it is left to miss.
OPTIMISTIC = "This is optimistic: the machine will differ."


class Compensated(AbstractController):
    """Another controller's force and a force that is known for each sample of one segment.

    **Arguments:** `controller`, whose limit bounds the sum; `forward`, N, of shape `(N,)`.
    """

    controller: AbstractController
    forward: Float[Array, " N"]
    limit: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=float("inf"))

    def start(self):
        return jnp.asarray(0), self.controller.start()

    def law(self, memory: Any, feedback: Feedback):
        # The limit acts here: the sample's number advances while the controller's memory rests.
        number, inner = memory
        own, following = self.controller.law(inner, feedback)
        force = own + self.forward[number]
        limited = jnp.clip(force, -self.controller.limit, self.controller.limit)
        kept = jax.tree.map(
            lambda old, new: jnp.where(force == limited, new, old), inner, following
        )
        return limited, (number + 1, kept)


class Tracking(NamedTuple):
    """Of one run: root mean square and largest tracking error, m, and rms controller force, N."""

    error: float
    largest_error: float
    force: float


class Benefit(NamedTuple):
    """The runs without and with compensation, and the second of them as a recording, which holds
    the channel `compensation`, N.
    """

    without: Tracking
    compensated: Tracking
    run: Recording

    @property
    def error_removed(self) -> float:
        """The part of the rms tracking error that goes; negative where it grows."""
        return 1 - self.compensated.error / self.without.error

    @property
    def force_removed(self) -> float:
        """The part of the rms controller force that goes."""
        return 1 - self.compensated.force / self.without.force


def usual(model: Model, reference: Recording) -> PD:
    """The gains kp = M ω², kd = 2 M ω: a double pole at ω = 0.1 rad a sample.

    **Raises:** `ValueError` for a model without a constant inertia.
    """
    mass = float(model.parameters.get("inertia", np.nan))
    if not mass > 0:
        raise ValueError("the model has no inertia to choose a controller by; give a controller.")
    rate = BANDWIDTH / float(np.median(np.diff(np.asarray(reference.time))))
    return PD(kp=mass * rate**2, kd=2 * mass * rate)  # type: ignore[call-arg]


def benefit(
    machine: Model,
    reference: Recording,
    controller: AbstractController | None = None,
    drive: Model | None = None,
) -> Benefit:
    """How much tracking error and controller force feed-forward by a model would remove.

    **Arguments:** `machine`, the model that stands for the machine; `reference`, time and
    set-point, of shape `(N,)`, as [`simulate`][jaxfric.simulation.simulating.simulate] takes them;
    `controller`, by default [`usual`][]; `drive`, the model that the drive computes with, by
    default the machine's own, which is optimistic.

    **Raises:** `ValueError` for several segments, and as `simulate` and `predict` do.
    """
    if len(np.unique(np.asarray(reference.segment))) > 1:
        raise ValueError("the set-point has interruptions; give one that is continuous.")
    controller = usual(machine, reference) if controller is None else controller
    goal = reference.channels.get("reference", reference.position)
    speed = reference.channels.get("reference_velocity")
    if goal is None:
        raise ValueError("compensation needs a set-point: a column reference or position.")
    if speed is None:
        speed = jnp.asarray(jnp.gradient(goal, reference.time))
    wanted = dataclasses.replace(reference, position=goal, velocity=speed)
    forward = jnp.asarray(predict(machine if drive is None else drive, wanted))
    if not bool(jnp.all(jnp.isfinite(forward))):
        raise ValueError("the compensating model gives no finite force along the set-point.")
    plain = simulate(machine, reference, controller)
    compensated = Compensated(controller, forward)  # type: ignore[call-arg]
    helped = simulate(machine, reference, compensated)
    channels = helped.channels | {"compensation": forward}
    return Benefit(
        _tracking(plain, goal, plain.force),
        _tracking(helped, goal, helped.force - forward),
        dataclasses.replace(helped, channels=channels),
    )


def _tracking(run: Recording, goal, force) -> Tracking:
    left = np.asarray(goal) - np.asarray(run.position)
    own = np.asarray(force)
    return Tracking(
        float(np.sqrt(np.mean(left**2))),
        float(np.max(np.abs(left))),
        float(np.sqrt(np.mean(own**2))),
    )
