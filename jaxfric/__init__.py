"""Friction of drive axes identified without mass and without acceleration; and what is missing.

The public names are loaded when they are first used, so that `import jaxfric` is quick and changes
nothing; in particular, jax's configuration is left alone.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import (
        devices as devices,
        export as export,
        fleet as fleet,
        models as models,
        scenario as scenario,
        signals as signals,
        terms as terms,
    )
    from .control import PD as PD, PID as PID, Cascade as Cascade, Encoder as Encoder
    from .explanation import Explanation as Explanation, explain as explain
    from .identification import identify as identify
    from .identified import Identified as Identified, Result as Result
    from .io import read as read
    from .models import Model as Model
    from .prediction import predict as predict
    from .projections import ClosedWindows as ClosedWindows, WeakForm as WeakForm
    from .recording import Recording as Recording, pad as pad, stack as stack
    from .selection import Selection as Selection, select as select
    from .simulation import simulate as simulate
    from .uncertainty import Estimate as Estimate

_MODULES = ("devices", "export", "fleet", "models", "scenario", "signals", "terms")
_NAMES = {
    "control": ("PD", "PID", "Cascade", "Encoder"),
    "explanation": ("Explanation", "explain"),
    "identification": ("identify",),
    "identified": ("Identified", "Result"),
    "io": ("read",),
    "models": ("Model",),
    "prediction": ("predict",),
    "projections": ("ClosedWindows", "WeakForm"),
    "recording": ("Recording", "pad", "stack"),
    "selection": ("Selection", "select"),
    "simulation": ("simulate",),
    "uncertainty": ("Estimate",),
}
_HOME = {name: module for module, names in _NAMES.items() for name in names}

__all__ = sorted((*_MODULES, *_HOME))


def __getattr__(name: str):
    if name in _HOME:
        value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    elif name in _MODULES:
        value = import_module(f".{name}", __name__)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # A function may bear its module's name (identify): the public name is the function.
    globals()[name] = value
    return value


def __dir__():
    return __all__
