"""Looking up the physics that can be missing, by name or by term; amplitude and phase of waves."""

from collections.abc import Mapping
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from .. import terms as laws
from ..data.nearest import meant
from .base import AbstractTerm
from .catalogue import CATALOGUE, Effect as Effect

EFFECTS: Mapping[str, Effect] = {effect.name: effect for effect in CATALOGUE}

_OF_TERM: Mapping[type, str] = {
    laws.FrictionAsymmetry: "asymmetric_friction",
    laws.Gaussian: "stribeck",
    laws.Lorentzian: "stribeck",
    laws.Exponential: "stribeck",
    laws.Generalised: "stribeck",
    laws.QuadraticDrag: "viscous_nonlinearity",
    laws.ShearThinning: "viscous_nonlinearity",
    laws.PowerLaw: "viscous_nonlinearity",
    laws.GravityUnbalance: "gravity_unbalance",
    laws.Cogging: "cogging",
    laws.Spring: "spring",
    laws.HardeningSpring: "hardening_spring",
    laws.EndStop: "end_stop",
    laws.LowerEndStop: "end_stop",
    laws.PositionDependentFriction: "position_dependent_friction",
    laws.StickySpot: "sticky_spot",
    laws.PositionDependentInertia: "position_dependent_inertia",
    laws.LoadDependentFriction: "load_dependent_friction",
    laws.Dahl: "presliding",
    laws.LuGre: "presliding",
    laws.FrictionalLag: "frictional_lag",
    laws.Backlash: "backlash",
    laws.ElasticBacklash: "backlash",
    laws.Compliance: "compliance",
    laws.DryCompliance: "compliance",
    laws.TransportDelay: "transport_delay",
    laws.ActuatorLag: "actuator_lag",
    laws.ActuatorDeadband: "actuator_deadband",
    laws.ActuatorSaturation: "actuator_saturation",
    laws.GainAsymmetry: "gain_asymmetry",
    laws.ThermalDrift: "thermal_drift",
    laws.FrictionStep: "friction_step",
    laws.PayloadChange: "payload_change",
    laws.GainStep: "gain_step",
    laws.LoadDrift: "load_drift",
    laws.PeriodicDisturbance: "periodic_disturbance",
    laws.DisturbancePulses: "disturbance_pulses",
    laws.CrossAxis: "cross_axis",
}


def effect(name: str) -> Effect:
    """The effect of that name; raises `ValueError`, with the names there are, for another."""
    if name not in EFFECTS:
        near = meant(name, EFFECTS)
        raise ValueError(f"No effect is called {name!r}; there are {', '.join(EFFECTS)}.{near}")
    return EFFECTS[name]


def effect_of(term: AbstractTerm) -> str | None:
    """The name of the effect that a term models; `None` for inertia, offset, Coulomb, tables."""
    inner = term.positive if isinstance(term, laws.Directional) else term
    return _OF_TERM.get(type(inner))


class Wave(NamedTuple):
    """Amplitude and phase, rad, of a pair of sine and cosine columns, with standard errors."""

    amplitude: Float[Array, ""]
    amplitude_error: Float[Array, ""]
    phase: Float[Array, ""]
    phase_error: Float[Array, ""]


def wave(sine: Float[Array, ""], cosine: Float[Array, ""], covariance: Float[Array, "2 2"]) -> Wave:
    """Amplitude and phase of a_s sin θ + a_c cos θ = A sin(θ + φ), by the delta method.

    **Arguments:** the amplitudes of sine and cosine, and their covariance, `(2, 2)`.
    """
    amplitude = jnp.hypot(sine, cosine)
    size = jnp.where(amplitude > 0, amplitude, 1.0)
    along = jnp.stack([sine, cosine]) / size
    across = jnp.stack([-cosine, sine]) / size
    spread = [jnp.sqrt(direction @ covariance @ direction) for direction in (along, across)]
    return Wave(amplitude, spread[0], jnp.arctan2(cosine, sine), spread[1] / size)
