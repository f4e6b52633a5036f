"""The physics: one law, one class, one displayed equation."""

from .actuator import (
    ActuatorDeadband as ActuatorDeadband,
    ActuatorLag as ActuatorLag,
    ActuatorSaturation as ActuatorSaturation,
    GainAsymmetry as GainAsymmetry,
    TransportDelay as TransportDelay,
)
from .base import (
    AbstractLaw as AbstractLaw,
    AbstractTerm as AbstractTerm,
    Directional as Directional,
    Sum as Sum,
)
from .curvature import (
    CrossAxis as CrossAxis,
    FrictionAsymmetry as FrictionAsymmetry,
    LoadDependentFriction as LoadDependentFriction,
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
    Viscous as Viscous,
)
from .inertia import Inertia as Inertia, Offset as Offset
from .known import (
    KNOWN as KNOWN,
    KNOWN_FORCE as KNOWN_FORCE,
    KNOWN_MOMENTUM as KNOWN_MOMENTUM,
    KNOWN_REST as KNOWN_REST,
    KnownColumns as KnownColumns,
    KnownForce as KnownForce,
    KnownGain as KnownGain,
    channels_of as channels_of,
)
from .position import (
    Cogging as Cogging,
    EndStop as EndStop,
    Gravity as Gravity,
    GravityUnbalance as GravityUnbalance,
    HardeningSpring as HardeningSpring,
    LowerEndStop as LowerEndStop,
    PositionDependentFriction as PositionDependentFriction,
    PositionDependentInertia as PositionDependentInertia,
    Spring as Spring,
    StickySpot as StickySpot,
)
from .presliding import (
    AbstractMemory as AbstractMemory,
    Dahl as Dahl,
    FrictionalLag as FrictionalLag,
    LuGre as LuGre,
)
from .sample import Parameter as Parameter, Resolution as Resolution, Sample as Sample
from .table import Table as Table
from .time import (
    AbstractModulated as AbstractModulated,
    DisturbancePulses as DisturbancePulses,
    FrictionStep as FrictionStep,
    GainStep as GainStep,
    LoadDrift as LoadDrift,
    PayloadChange as PayloadChange,
    PeriodicDisturbance as PeriodicDisturbance,
    ThermalDrift as ThermalDrift,
)
from .transmission import (
    Backlash as Backlash,
    Compliance as Compliance,
    DryCompliance as DryCompliance,
    ElasticBacklash as ElasticBacklash,
)
