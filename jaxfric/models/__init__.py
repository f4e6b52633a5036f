"""Named sums of terms, and a sum with its parameters, which identification returns."""

from .model import (
    SCHEMA as SCHEMA,
    Model as Model,
    from_parameters as from_parameters,
    load as load,
    require as require,
    weighed as weighed,
)
from .structures import (
    NAMED as NAMED,
    coulomb_viscous as coulomb_viscous,
    exponential as exponential,
    gaussian as gaussian,
    generalised as generalised,
    listed_as as listed_as,
    lorentzian as lorentzian,
    name_of as name_of,
    named as named,
    names as names,
    symmetric as symmetric,
)
