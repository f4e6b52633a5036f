"""The physics: one law, one class, one displayed equation."""

from .base import (
    AbstractLaw as AbstractLaw,
    AbstractTerm as AbstractTerm,
    Directional as Directional,
    Sum as Sum,
)
from .effects.actuator_deadband import ActuatorDeadband as ActuatorDeadband
from .effects.actuator_saturation import (
    ActuatorSaturation as ActuatorSaturation,
    SoftSaturation as SoftSaturation,
)
from .effects.asymmetric_friction import (
    CoulombAsymmetry as CoulombAsymmetry,
    FrictionAsymmetry as FrictionAsymmetry,
)
from .effects.backlash import (
    Backlash as Backlash,
    DampedBacklash as DampedBacklash,
    ElasticBacklash as ElasticBacklash,
    OiledBacklash as OiledBacklash,
)
from .effects.cogging import Cogging as Cogging, ForceRipple as ForceRipple
from .effects.compliance import Compliance as Compliance, DryCompliance as DryCompliance
from .effects.cross_axis import CrossAxis as CrossAxis, CrossForce as CrossForce
from .effects.disturbance_force import DisturbanceForce as DisturbanceForce
from .effects.disturbance_pulses import DisturbancePulses as DisturbancePulses
from .effects.encoder_error import EncoderError as EncoderError
from .effects.end_stop import EndStop as EndStop, LowerEndStop as LowerEndStop
from .effects.frictional_lag import FrictionalLag as FrictionalLag
from .effects.gain_asymmetry import GainAsymmetry as GainAsymmetry
from .effects.gain_drift import GainDrift as GainDrift
from .effects.gravity_unbalance import GravityUnbalance as GravityUnbalance
from .effects.late import (
    ActuatorLag as ActuatorLag,
    ClockOffset as ClockOffset,
    SensorFilter as SensorFilter,
    TransportDelay as TransportDelay,
)
from .effects.load_dependent_friction import (
    LoadDependentFriction as LoadDependentFriction,
    ReactionFriction as ReactionFriction,
)
from .effects.load_drift import LoadDrift as LoadDrift
from .effects.local_force import LocalForce as LocalForce
from .effects.parameter_step import ParameterStep as ParameterStep
from .effects.periodic_disturbance import PeriodicDisturbance as PeriodicDisturbance
from .effects.position_dependent_force_constant import (
    PositionDependentForceConstant as PositionDependentForceConstant,
)
from .effects.position_dependent_friction import (
    PositionDependentFriction as PositionDependentFriction,
)
from .effects.position_dependent_inertia import PositionDependentInertia as PositionDependentInertia
from .effects.presliding import Dahl as Dahl, LuGre as LuGre, MaxwellSlip as MaxwellSlip
from .effects.springs import HardeningSpring as HardeningSpring, Spring as Spring
from .effects.steps import (
    FrictionRamp as FrictionRamp,
    FrictionStep as FrictionStep,
    GainStep as GainStep,
    PayloadChange as PayloadChange,
)
from .effects.sticky_spot import StickySpot as StickySpot
from .effects.thermal_drift import ThermalDrift as ThermalDrift
from .effects.viscous_nonlinearity import (
    PowerLaw as PowerLaw,
    QuadraticDrag as QuadraticDrag,
    ShearThinning as ShearThinning,
)
from .friction import (
    Coulomb as Coulomb,
    Exponential as Exponential,
    Gaussian as Gaussian,
    Generalised as Generalised,
    Lorentzian as Lorentzian,
    SmoothCrossing as SmoothCrossing,
    Viscous as Viscous,
)
from .inertia import Inertia as Inertia, Offset as Offset
from .known import (
    KNOWN as KNOWN,
    KNOWN_FEEDBACK as KNOWN_FEEDBACK,
    KNOWN_FORCE as KNOWN_FORCE,
    KNOWN_FRICTION as KNOWN_FRICTION,
    KNOWN_MASKED as KNOWN_MASKED,
    KNOWN_MOMENTUM as KNOWN_MOMENTUM,
    KNOWN_REST as KNOWN_REST,
    KnownColumns as KnownColumns,
    KnownForce as KnownForce,
    KnownGain as KnownGain,
    at_other_times as at_other_times,
    channels_of as channels_of,
)
from .position import Gravity as Gravity
from .presliding import (
    AbstractMemory as AbstractMemory,
    AbstractStates as AbstractStates,
    Instant as Instant,
    States as States,
)
from .sample import Parameter as Parameter, Resolution as Resolution, Sample as Sample
from .table import Table as Table
from .time import AbstractModulated as AbstractModulated
