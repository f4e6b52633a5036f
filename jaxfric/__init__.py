"""Friction of drive axes identified without mass and without acceleration; and what is missing.

The public names are loaded when they are first used, so that `import jaxfric` is quick and changes
nothing; in particular, jax's configuration is left alone.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import (
        export as export,
        fleet as fleet,
        models as models,
        online as online,
        programs as programs,
        signals as signals,
        simulators as simulators,
        terms as terms,
    )
    from .data.io import read as read
    from .data.recording import Recording as Recording, pad as pad, stack as stack
    from .explanation import Earlier as Earlier, Explanation as Explanation, explain as explain
    from .identification import devices as devices
    from .identification.breakaway import BreakAway as BreakAway, breakaway as breakaway
    from .identification.constant_velocity import (
        ConstantVelocity as ConstantVelocity,
        constant_velocity as constant_velocity,
    )
    from .identification.identified import Identified as Identified, Result as Result
    from .identification.identifying import identify as identify
    from .identification.presliding import Presliding as Presliding, presliding as presliding
    from .identification.projections import ClosedWindows as ClosedWindows, WeakForm as WeakForm
    from .identification.selection import Selection as Selection, select as select
    from .identification.uncertainty import Estimate as Estimate
    from .models import Model as Model
    from .simulation import scenario as scenario
    from .simulation.control import PD as PD, PID as PID, Cascade as Cascade, Encoder as Encoder
    from .simulation.prediction import predict as predict
    from .simulation.simulating import simulate as simulate

# Public modules and names, by the package or module that holds them.
_MODULES = {
    "devices": "identification.devices",
    "export": "export",
    "fleet": "fleet",
    "models": "models",
    "online": "online",
    "programs": "programs",
    "scenario": "simulation.scenario",
    "signals": "signals",
    "simulators": "simulators",
    "terms": "terms",
}
_NAMES = {
    "data.io": ("read",),
    "data.recording": ("Recording", "pad", "stack"),
    "explanation": ("Earlier", "Explanation", "explain"),
    "identification.breakaway": ("BreakAway", "breakaway"),
    "identification.constant_velocity": ("ConstantVelocity", "constant_velocity"),
    "identification.identified": ("Identified", "Result"),
    "identification.identifying": ("identify",),
    "identification.presliding": ("Presliding", "presliding"),
    "identification.projections": ("ClosedWindows", "WeakForm"),
    "identification.selection": ("Selection", "select"),
    "identification.uncertainty": ("Estimate",),
    "models": ("Model",),
    "simulation.control": ("PD", "PID", "Cascade", "Encoder"),
    "simulation.prediction": ("predict",),
    "simulation.simulating": ("simulate",),
}
_HOME = {name: module for module, names in _NAMES.items() for name in names}

__all__ = sorted((*_MODULES, *_HOME))


def __getattr__(name: str):
    if name in _HOME:
        value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    elif name in _MODULES:
        value = import_module(f".{_MODULES[name]}", __name__)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__():
    return __all__
