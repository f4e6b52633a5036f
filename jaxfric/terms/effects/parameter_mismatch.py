"""Wrong values of the baseline."""

from ..effect import Effect

MISMATCH = "parameter_mismatch"
PARAMETER_MISMATCH = Effect(MISMATCH, "θ = θ₀ + Δθ", "values")
