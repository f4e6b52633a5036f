"""What `simulate` refuses, and the remedy."""

import jax
import numpy as np

from .. import signals
from ..data.recording import described, require
from ..models import require as require_model
from . import actuator as faults
from .control import AbstractController
from .memory import carried, holds, lost, rigid
from .substeps import rates


def check(model, reference, controller, encoder, force_noise, key):
    """Raise `ValueError` where an argument of `simulate` is no such thing, or lacks something."""
    require_model(model, "simulate")
    require(reference, "simulate")
    if not isinstance(controller, AbstractController | None):
        raise ValueError(
            f"controller is {described(controller)}; give jaxfric.PD(...), PID(...), Cascade(...), "
            "one of your own, or None for an open loop."
        )
    name = reference.source or "the reference"
    aimless = reference.position is None and "reference" not in reference.channels
    if controller is not None and aimless:
        raise ValueError(
            f"simulate with a controller needs a set-point; {name} has neither a channel "
            "'reference' nor a position. Add one, or leave out the controller to drive by force."
        )
    if lacking := [] if signals.is_traced(model) else _lacking(model):
        raise ValueError(
            f"simulate needs every parameter, and the model has no value for {', '.join(lacking)}, "
            "which its recording did not show. Record motion in both directions, or give them: "
            "model.with_parameters({...})."
        )
    if not signals.is_traced(model):
        faults.check(model)
    if not signals.is_traced((model, reference)) and _massless(model, reference):
        if load := carried(model):
            raise ValueError(
                f"simulate moves motor and load each by its own inertia, and a load of {load:.4g} "
                "leaves the motor none of the model's. Give it less, or identify the model anew."
            )
        raise ValueError(
            "simulate needs an inertia to accelerate, and the model's is not positive: it has "
            f"{', '.join(model.parameters)}. Add jaxfric.terms.Inertia() with a positive mass."
        )
    noisy = _positive(force_noise) or (encoder is not None and _positive(encoder.noise))
    if noisy and key is None:
        raise ValueError("simulate with noise needs a key=jax.random.key(seed) to draw it from.")


def check_memory(model, smooth):
    """Raise `ValueError` for a memory that is not held, or not with `smooth`."""
    if unheld := lost(model):
        raise ValueError(
            "simulate holds a memory whose states follow the motion, and "
            f"{', '.join(unheld)} gives none. Derive it from jaxfric.terms.AbstractStates, or "
            "simulate without that term."
        )
    if smooth is not None and holds(model):
        raise ValueError(
            "smooth= blends friction that is a function of the velocity; the model has a memory "
            "(bristles, a load, a gap or a lag). Leave smooth out."
        )


def _positive(value) -> bool:
    return not isinstance(value, jax.core.Tracer) and bool(np.any(np.asarray(value) > 0))


def _lacking(model) -> list[str]:
    """The parameters without a finite value."""
    with jax.ensure_compile_time_eval():
        return [n for n, value in model.parameters.items() if not np.isfinite(np.asarray(value))]


def _massless(model, reference) -> bool:
    if not rigid(model):
        return True
    # Inside jax.jit a computation on known numbers is put off too, unless one insists.
    with jax.ensure_compile_time_eval():
        return not bool(np.all(np.asarray(rates(model, reference, None)[0]) > 0))
