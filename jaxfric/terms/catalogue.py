"""What a model can leave out, one entry each; [`jaxfric.terms.effects`][] looks them up.

The names are public (they stand in the JSON of an explanation); the terms live in
[`jaxfric.terms`][]. `coordinates` are those of `jaxfric.explain.locate`.
"""

from collections.abc import Callable
from typing import NamedTuple

from .. import terms as laws
from .base import AbstractTerm
from .sample import Scales

# A step in friction cannot be dated better than to about one kernel of the weak form, some
# thousandths of the record.
RAMP_SHARE = 0.005


class Effect(NamedTuple):
    """One kind of missing physics.

    - `name`: its public name.
    - `equation`: as displayed to the user.
    - `coordinates`: where the residual shows it, the most telling first.
    - `confusable_with`: effects that leave nearly the same trace on an unlucky recording.
    - `shapes`: the terms that model it, each a rival of the others, from the [`Scales`][] of a
      recording (with values, outside jit); none where no term is missing.
    - `needs`: signals beside time, velocity and force that a recording must have.
    - `first_order`: whether its terms are but the first order of the effect, or one law of many.
    - `separate_by`: the experiment that tells it from the confusable ones.
    - `positive`: whether its affine parameters are magnitudes, so that a fit with another sign is
      something else (friction dissipates, a delay is late, a stop pushes back).
    """

    name: str
    equation: str
    coordinates: tuple[str, ...]
    confusable_with: tuple[str, ...]
    shapes: Callable[[Scales], tuple[AbstractTerm, ...]]
    needs: frozenset[str] = frozenset()
    first_order: bool = False
    separate_by: str = ""
    positive: bool = False


def _fixed(*terms: AbstractTerm) -> Callable[[Scales], tuple[AbstractTerm, ...]]:
    """Shapes that do not depend on the recording."""
    return lambda scales: terms


def _middle(scales: Scales) -> float:
    return float(0.5 * (scales.low + scales.high))


def _viscous_shapes(scales):
    power = laws.PowerLaw(unit_speed=float(scales.fastest))
    return laws.QuadraticDrag(), laws.ShearThinning(), power


def _thermal_shapes(scales):
    start = float(scales.start)
    kinds = (laws.Viscous(), laws.Coulomb())
    return tuple(laws.ThermalDrift(kind, start=start) for kind in kinds)


def _step_shapes(scales):
    return (laws.FrictionStep(laws.Coulomb(), ramp=RAMP_SHARE * float(scales.duration)),)


def _payload_shapes(scales):
    return (laws.PayloadChange(ramp=RAMP_SHARE * float(scales.duration)),)


def _gain_step_shapes(scales):
    return (laws.GainStep(ramp=RAMP_SHARE * float(scales.duration)),)


def _drift_shapes(scales):
    start, duration = float(scales.start), float(scales.duration)
    return tuple(laws.LoadDrift(start, duration, degree) for degree in (1, 3))


_POSITION = frozenset({"position"})
_FORCE = frozenset({"predicted_force"})
_SLOWER = "Repeat the motion at half the speed: a delay scales with force rate, a gap does not."

CATALOGUE = (
    Effect(
        "parameter_mismatch",
        "θ = θ₀ + Δθ",
        (),
        (),
        _fixed(),
    ),
    Effect(
        "asymmetric_friction",
        "ΔFc abs(sign v) + ΔFv abs(v)",
        ("velocity",),
        ("load_drift",),
        _fixed(laws.FrictionAsymmetry()),
        separate_by="Let the axis stick: a constant force shifts both break-away levels alike.",
    ),
    Effect(
        "stribeck",
        "F_b sign(v) exp(−(v/v_s)²), 1/(1 + (v/v_s)²) or exp(−abs(v)/v_s)",
        ("velocity",),
        ("presliding", "frictional_lag", "viscous_nonlinearity"),
        _fixed(
            *(
                laws.Directional(bump())
                for bump in (laws.Gaussian, laws.Lorentzian, laws.Exponential)
            )
        ),
        separate_by="Hold several constant slow speeds: a Stribeck curve stays, a transient goes.",
        positive=True,
    ),
    Effect(
        "viscous_nonlinearity",
        "c v abs(v), b v/(1 + abs(v)/v₀) or k sign(v) abs(v)ⁿ",
        ("velocity",),
        ("thermal_drift", "stribeck"),
        _viscous_shapes,
        separate_by="Run to the top speed from cold and again warm.",
    ),
    Effect(
        "gravity_unbalance",
        "A sin(2πx/L + φ)",
        ("position",),
        ("spring", "hardening_spring", "cogging"),
        _fixed(laws.GravityUnbalance()),
        _POSITION,
        separate_by="Use the whole stroke: an unbalance is periodic, a spring is not.",
    ),
    Effect(
        "cogging",
        "Σ A_n sin(2πn x/p + φ_n)",
        ("position_lines", "position"),
        ("periodic_disturbance", "gravity_unbalance"),
        lambda scales: tuple(laws.Cogging(harmonics=n) for n in (1, 2, 3)),
        _POSITION,
        separate_by="Change the speed: a line in position keeps its pitch, a tone its frequency.",
    ),
    Effect(
        "spring",
        "k (x − x₀)",
        ("position",),
        ("gravity_unbalance", "hardening_spring", "end_stop"),
        lambda scales: (laws.Spring(_middle(scales)),),
        _POSITION,
        separate_by="Use the whole stroke: the shapes part at its ends.",
    ),
    Effect(
        "hardening_spring",
        "k₃ (x − x₀)³",
        ("position",),
        ("spring", "end_stop", "gravity_unbalance"),
        _fixed(laws.HardeningSpring()),
        _POSITION,
        separate_by="Use the whole stroke: the shapes part at its ends.",
    ),
    Effect(
        "end_stop",
        "k max(x − x_s, 0)",
        ("position",),
        ("hardening_spring", "spring"),
        _fixed(laws.EndStop(), laws.LowerEndStop()),
        _POSITION,
        separate_by="Turn the motion round shortly before the suspected stop.",
        positive=True,
    ),
    Effect(
        "position_dependent_friction",
        "sign(v) A sin(2πx/L + φ)",
        ("position_by_direction",),
        ("sticky_spot", "asymmetric_friction"),
        _fixed(laws.PositionDependentFriction()),
        _POSITION,
        separate_by="Cross the stroke slowly, both ways.",
    ),
    Effect(
        "sticky_spot",
        "sign(v) A exp(−(x − x₀)²/(2w²))",
        ("position_by_direction",),
        ("position_dependent_friction", "disturbance_pulses"),
        _fixed(laws.StickySpot()),
        _POSITION,
        separate_by="Cross the place slowly, both ways, several times.",
        positive=True,
    ),
    Effect(
        "position_dependent_inertia",
        "d(M₁v)/dt − ½ M₁′v², M₁ = A sin(2πx/L + φ)",
        ("position_by_acceleration",),
        ("gravity_unbalance",),
        _fixed(laws.PositionDependentInertia()),
        _POSITION,
        separate_by="Cross the stroke at two accelerations: a weight does not scale with them.",
    ),
    Effect(
        "load_dependent_friction",
        "μ abs(N) sign(v)",
        ("predicted_force_by_direction", "predicted_force"),
        ("gain_asymmetry", "actuator_saturation"),
        _fixed(laws.LoadDependentFriction()),
        _FORCE,
        separate_by="Record the load, or repeat with another payload.",
        positive=True,
    ),
    Effect(
        "presliding",
        "F_p (z − sign v), dz = (dx/x_d)(1 − z sign(dx))",
        ("distance_since_reversal",),
        ("backlash", "compliance", "frictional_lag", "stribeck"),
        _fixed(laws.Dahl()),
        first_order=True,
        separate_by="Reverse slowly over a few micrometres: presliding is elastic before it slips.",
        positive=True,
    ),
    Effect(
        "frictional_lag",
        "F_b sign(v) (exp(−(s/v_s)²) − exp(−(v/v_s)²)), s = abs v(t − τ) or filtered",
        ("time_since_reversal", "acceleration"),
        ("actuator_lag", "presliding", "transport_delay"),
        _fixed(*(laws.FrictionalLag(poles=poles) for poles in (0, 1, 2))),
        frozenset(),
        False,
        "Cycle at low speed without a reversal: the loop in force over speed remains.",
        positive=True,
    ),
    Effect(
        "backlash",
        "−F_L sign(v) inside the gap 2δ, or F_L (T − sign v) − M_L a, T what the flanks push",
        ("distance_since_reversal",),
        ("presliding", "compliance", "transport_delay"),
        _fixed(laws.Backlash(), laws.ElasticBacklash()),
        _POSITION,
        True,
        _SLOWER,
        positive=True,
    ),
    Effect(
        "compliance",
        "M_L r̈, r̈ + 2ζω ṙ + ω² r = −a − (F_L/M_L) sign(v)",
        ("acceleration", "time_since_reversal"),
        ("transport_delay", "actuator_lag", "backlash", "presliding"),
        _fixed(
            *(laws.Compliance(driven=by) for by in ("inertia", "friction", "both")),
            laws.DryCompliance(),
        ),
        frozenset(),
        False,
        "Excite with a sweep up to the resonance, or measure on the load side.",
        positive=True,
    ),
    Effect(
        "transport_delay",
        "u = f(t + τ)",
        ("force_rate",),
        ("actuator_lag", "frictional_lag", "compliance"),
        _fixed(laws.TransportDelay()),
        _FORCE,
        True,
        "Excite faster: a delay turns the phase without bound, a lag by a quarter turn.",
        positive=True,
    ),
    Effect(
        "actuator_lag",
        "u = f + T df/dt",
        ("force_rate",),
        ("transport_delay", "frictional_lag", "compliance"),
        _fixed(laws.ActuatorLag()),
        _FORCE,
        False,
        "Excite faster: a delay turns the phase without bound, a lag by a quarter turn.",
        positive=True,
    ),
    Effect(
        "actuator_deadband",
        "δ sign(f)",
        ("predicted_force",),
        ("load_dependent_friction", "gain_asymmetry"),
        _fixed(laws.ActuatorDeadband()),
        _FORCE,
        separate_by="Decelerate hard, so that force and velocity have opposite signs.",
        positive=True,
    ),
    Effect(
        "actuator_saturation",
        "c max(abs(f) − U, 0) sign(f)",
        ("predicted_force",),
        ("gain_asymmetry", "load_dependent_friction"),
        _fixed(laws.ActuatorSaturation()),
        _FORCE,
        separate_by="Repeat at half the acceleration, below the knee.",
        positive=True,
    ),
    Effect(
        "gain_asymmetry",
        "κ max(f, 0)",
        ("predicted_force",),
        ("load_dependent_friction", "actuator_saturation", "asymmetric_friction"),
        _fixed(laws.GainAsymmetry()),
        _FORCE,
        separate_by="Accelerate hard both ways: inertia is the same in both directions.",
    ),
    Effect(
        "thermal_drift",
        "β g(v) exp(−(t − t₀)/τ), g viscous or Coulomb",
        ("time_by_velocity", "time_by_direction"),
        ("friction_step", "viscous_nonlinearity"),
        _thermal_shapes,
        separate_by="Repeat from cold: warming repeats, a step does not.",
    ),
    Effect(
        "friction_step",
        "ΔF sign(v) 1(t > t_c)",
        ("time_by_direction",),
        ("thermal_drift",),
        _step_shapes,
        separate_by="Repeat from cold: warming repeats, a step does not.",
    ),
    Effect(
        "payload_change",
        "(ΔM a + ΔF) 1(t > t_c)",
        ("time",),
        ("gain_step", "load_drift", "friction_step"),
        _payload_shapes,
        separate_by="Move the same way with and without the payload, each in a recording.",
    ),
    Effect(
        "gain_step",
        "κ f 1(t > t_c)",
        ("predicted_force", "time"),
        ("payload_change", "friction_step"),
        _gain_step_shapes,
        _FORCE,
        separate_by="Coast: a gain changes the force, not how friction brakes the free axis.",
    ),
    Effect(
        "load_drift",
        "Σ F_n P_n(t)",
        ("time",),
        ("periodic_disturbance", "cross_axis", "friction_step"),
        _drift_shapes,
        separate_by="Record longer.",
    ),
    Effect(
        "periodic_disturbance",
        "A sin(2πf t + φ)",
        ("time_lines", "time"),
        ("cogging", "load_drift"),
        _fixed(laws.PeriodicDisturbance()),
        separate_by="Change the speed: a line in position keeps its pitch, a tone its frequency.",
    ),
    Effect(
        "disturbance_pulses",
        "Σ A_i pulse(t − t_i)",
        ("time",),
        ("sticky_spot",),
        # Where the pulses are, the locating step has to say: there is no shape without it.
        _fixed(),
        separate_by="Repeat the motion: what belongs to the machine comes again.",
    ),
    Effect(
        "cross_axis",
        "d(C v₂)/dt + h v₂",
        ("neighbour",),
        ("load_drift", "periodic_disturbance"),
        _fixed(laws.CrossAxis()),
        frozenset({"neighbour_velocity"}),
        separate_by="Hold the other axis still.",
    ),
)
