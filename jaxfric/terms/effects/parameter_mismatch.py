"""Wrong values of the baseline."""

from ..effect import Effect

PARAMETER_MISMATCH = Effect("parameter_mismatch", "θ = θ₀ + Δθ", "values")
