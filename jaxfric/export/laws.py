"""Each law of [`jaxfric.terms`][] once more, as text: the columns at one sample.

The signals are `x`, `v`, `a`, `t` (position, velocity, acceleration, time). That text and law
agree is tested for every law, by compiling the one and calling the other.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

from numpy.polynomial import legendre

from .. import terms as laws
from .syntax import Syntax, literal, signed

Columns = Sequence[str]
TWO_PI = literal(6.283185307179586)


def coulomb(s: Syntax, term) -> Columns:
    """F = Fc sign(v)."""
    return (s.call("sign", "v"),)


def viscous(s: Syntax, term) -> Columns:
    """F = Fv v."""
    return ("v",)


def inertia(s: Syntax, term) -> Columns:
    """Newton: u = M a."""
    return ("a",)


def offset(s: Syntax, term) -> Columns:
    """Constant: u = F₀."""
    return ("1.0",)


def _bump(s: Syntax, shape: str) -> Columns:
    return (f"{s.call('sign', 'v')} * {shape}",)


def gaussian(s: Syntax, term, width: str) -> Columns:
    """F = F_b sign(v) exp(−(v/v_s)²)."""
    return _bump(s, s.call("exp", f"-(v / {width}) * (v / {width})"))


def lorentzian(s: Syntax, term, width: str) -> Columns:
    """F = F_b sign(v) / (1 + (v/v_s)²)."""
    return (f"{s.call('sign', 'v')} / (1.0 + (v / {width}) * (v / {width}))",)


def exponential(s: Syntax, term, width: str) -> Columns:
    """F = F_b sign(v) exp(−abs(v)/v_s)."""
    return _bump(s, s.call("exp", f"-{s.call('abs', 'v')} / {width}"))


def generalised(s: Syntax, term, width: str, exponent: str) -> Columns:
    """F = F_b sign(v) exp(−abs(v/v_s)^δ)."""
    ratio = f"{s.call('abs', 'v')} / {width}"
    return _bump(s, s.call("exp", f"-{s.raised(ratio, exponent)}"))


def asymmetry(s: Syntax, term) -> Columns:
    """F = ΔFc abs(sign v) + ΔFv abs(v)."""
    return (s.call("abs", s.call("sign", "v")), s.call("abs", "v"))


def quadratic_drag(s: Syntax, term) -> Columns:
    """F = c v abs(v)."""
    return (f"v * {s.call('abs', 'v')}",)


def power_law(s: Syntax, term, exponent: str) -> Columns:
    """F = k sign(v) abs(v/v₁)^n."""
    ratio = f"{s.call('abs', 'v')} / {literal(term.unit_speed)}"
    return (f"{s.call('sign', 'v')} * {s.raised(ratio, exponent)}",)


def shear_thinning(s: Syntax, term, scale: str) -> Columns:
    """F = b v / (1 + abs(v)/v₀)."""
    return (f"v / (1.0 + {s.call('abs', 'v')} / {scale})",)


def _waves(s: Syntax, signal: str, period: str, harmonics: int = 1) -> Columns:
    """Sine and cosine of each harmonic."""
    angles = [f"{literal(n * float(TWO_PI))} * {signal} / {period}" for n in _count(harmonics)]
    return tuple(s.call(function, angle) for angle in angles for function in ("sin", "cos"))


def _count(last: int) -> range:
    return range(1, last + 1)


def unbalance(s: Syntax, term, period: str) -> Columns:
    """F = A sin(2πx/L + φ)."""
    return _waves(s, "x", period)


def cogging(s: Syntax, term, pitch: str) -> Columns:
    """F = Σ_n A_n sin(2πn x/p + φ_n)."""
    return _waves(s, "x", pitch, term.harmonics)


def spring(s: Syntax, term) -> Columns:
    """F = k (x − x₀)."""
    return (f"(x - {signed(term.rest)})",)


def hardening_spring(s: Syntax, term, centre: str) -> Columns:
    """F = k₃ (x − x₀)³."""
    away = f"(x - {centre})"
    return (f"{away} * {away} * {away}",)


def end_stop(s: Syntax, term, place: str) -> Columns:
    """F = k max(x − x_s, 0)."""
    return (s.call("max", f"x - {place}", "0.0"),)


def lower_end_stop(s: Syntax, term, place: str) -> Columns:
    """F = k min(x − x_s, 0)."""
    return (s.call("min", f"x - {place}", "0.0"),)


def position_dependent_friction(s: Syntax, term, period: str) -> Columns:
    """F = A sin(2πx/L + φ) sign(v)."""
    return tuple(f"{s.call('sign', 'v')} * {wave}" for wave in _waves(s, "x", period))


def sticky_spot(s: Syntax, term, place: str, width: str) -> Columns:
    """F = A sign(v) exp(−(x − x₀)²/(2w²))."""
    away = f"((x - {place}) / {width})"
    return (f"{s.call('sign', 'v')} * {s.call('exp', f'-0.5 * {away} * {away}')}",)


def position_dependent_inertia(s: Syntax, term, period: str) -> Columns:
    """Lagrange, the derivative carried out: u = M₁ a + ½ M₁′ v², M₁ = A sin(2πx/L + φ)."""
    sine, cosine = _waves(s, "x", period)
    half = f"{literal(0.5 * float(TWO_PI))} / {period} * v * v"
    return (f"(a * {sine} + {half} * {cosine})", f"(a * {cosine} - {half} * {sine})")


def tone(s: Syntax, term, frequency: str) -> Columns:
    """F = A sin(2πf t + φ)."""
    angle = f"{TWO_PI} * {frequency} * t"
    return (s.call("sin", angle), s.call("cos", angle))


def load_drift(s: Syntax, term) -> Columns:
    """F = Σ_n F_n P_n(τ), P_n Legendre's polynomials in Horner's form."""
    tau = f"2.0 * (t - {signed(term.start)}) / {literal(term.duration)} - 1.0"
    place = s.clip(tau, "-1.0", "1.0")
    return tuple(_horner(legendre.leg2poly([0.0] * n + [1.0]), place) for n in _count(term.degree))


def _horner(coefficients: Sequence[float], variable: str) -> str:
    text = literal(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        text = f"({text} * {variable}"
        text += f" + {literal(coefficient)})" if coefficient else ")"
    return text


def pulses(s: Syntax, term) -> Columns:
    """F = Σ_i A_i cos²(π (t − t_i)/(2w)) for abs(t − t_i) < w."""
    half = literal(0.25 * float(TWO_PI))
    shapes = []
    for at in term.times:
        place = s.clip(f"(t - {signed(at)}) / {literal(term.width)}", "-1.0", "1.0")
        wave = s.call("cos", f"{half} * {place}")
        shapes.append(f"{wave} * {wave}")
    return tuple(shapes)


_SIGNALS = {"position": "x", "velocity": "v", "time": "t"}


def table(s: Syntax, term) -> Columns:
    """F = Σ_k F_k Λ_k(c): a hat on each knot but the first, the last one going on level."""
    if term.coordinate not in _SIGNALS:
        raise ValueError(f"a table over {term.coordinate}")
    signal, rises, hats = _SIGNALS[term.coordinate], list(pairwise(term.knots)), []
    for k, (low, top) in enumerate(rises):
        up = f"({signal} - {signed(low)}) / {literal(top - low)}"
        down = "1.0"
        if k + 1 < len(rises):
            high = rises[k + 1][1]
            down = f"({signed(high)} - {signal}) / {literal(high - top)}"
        hats.append(s.call("max", s.call("min", up, down), "0.0"))
    return tuple(hats)


COLUMNS: dict[type, Callable[..., Columns]] = {
    laws.Coulomb: coulomb,
    laws.Viscous: viscous,
    laws.Inertia: inertia,
    laws.Offset: offset,
    laws.Gaussian: gaussian,
    laws.Lorentzian: lorentzian,
    laws.Exponential: exponential,
    laws.Generalised: generalised,
    laws.FrictionAsymmetry: asymmetry,
    laws.QuadraticDrag: quadratic_drag,
    laws.PowerLaw: power_law,
    laws.ShearThinning: shear_thinning,
    laws.GravityUnbalance: unbalance,
    laws.Cogging: cogging,
    laws.Spring: spring,
    laws.HardeningSpring: hardening_spring,
    laws.EndStop: end_stop,
    laws.LowerEndStop: lower_end_stop,
    laws.PositionDependentFriction: position_dependent_friction,
    laws.StickySpot: sticky_spot,
    laws.PositionDependentInertia: position_dependent_inertia,
    laws.PeriodicDisturbance: tone,
    laws.LoadDrift: load_drift,
    laws.DisturbancePulses: pulses,
    laws.Table: table,
}


def thermal_factor(s: Syntax, term, constant: str) -> str:
    """exp(−(t − t₀)/τ)."""
    return s.call("exp", f"-(t - {signed(term.start)}) / {constant}")


def step_factor(s: Syntax, term, at: str) -> str:
    """1(t > t_c), or the ramp in its place."""
    if term.ramp == 0:
        return s.choose(f"t > {at}", "1.0", "0.0")
    return s.clip(f"(t - {at}) / {literal(term.ramp)} + 0.5", "0.0", "1.0")


FACTORS: dict[type, Callable[..., str]] = {
    laws.ThermalDrift: thermal_factor,
    laws.FrictionStep: step_factor,
}
