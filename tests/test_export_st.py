"""Structured Text: accepted by a parser of the standard, and the same force as the library's."""

import math
import re

import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import models, terms
from jaxfric.export import export, st

from .test_export import everything, force_of, model, motion

# What the language calls its functions; it knows no upper and lower case.
FUNCTIONS = {
    "abs": abs, "exp": math.exp, "sin": math.sin, "cos": math.cos, "min": min, "max": max,
    "expt": lambda base, power: base**power, "sel": lambda which, no, yes: yes if which else no,
    "axis_sign": lambda value: float((value > 0) - (value < 0)),
}  # fmt: skip


def interpreted(text):
    """The block as a Python function; statements and precedence are the same in both languages."""
    plain = re.sub(r"\(\*.*?\*\)", "", text.lower(), flags=re.DOTALL)
    block = plain[plain.index("function_block axis") :]
    constants = re.search(r"var constant(.*?)end_var", block, re.DOTALL)[1]
    values = {
        name: float(number) for name, number in re.findall(r"(\w+) : lreal := (\S+);", constants)
    }
    assert len(values) == len(re.findall(":=", constants))
    body = block[block.rindex("end_var") + len("end_var") : block.index("end_function_block")]
    lines, depth = [], 0
    for statement in filter(None, map(str.strip, re.split(r";|(?<=then)", body))):
        if statement == "end_if":
            depth -= 1
        elif condition := re.fullmatch(r"if (.*) then", statement):
            lines.append("    " * depth + f"if {condition[1]}:")
            depth += 1
        else:
            lines.append("    " * depth + statement.replace(":=", "="))
    code = compile("\n".join(lines), "block", "exec")

    def call(position, velocity, acceleration, elapsed):
        names = {"position": position, "velocity": velocity}
        names |= {"acceleration": acceleration, "elapsed": elapsed}
        space = FUNCTIONS | values | names
        exec(code, {"__builtins__": {}}, space)
        return space["friction"], space["force"]

    return call


@pytest.mark.slow
def test_a_block_computes_the_library_s_force_and_friction():
    signals, whole = motion(), everything()
    call = interpreted(export(whole, "st").text)
    rows = zip(*(np.asarray(signal).tolist() for signal in signals), strict=True)
    friction, force = np.array([call(*row) for row in rows]).T
    wanted = np.asarray(force_of(whole, *signals))
    np.testing.assert_allclose(force, wanted, rtol=1e-12, atol=1e-12 * np.abs(wanted).max())
    slip = np.asarray(whole.friction(signals[1]))
    np.testing.assert_allclose(friction, slip, rtol=1e-12, atol=1e-12 * np.abs(slip).max())


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e12])
def test_a_parser_of_the_standard_accepts_the_text(scale):
    """All terms, and how numbers are spelled, for which those of one model will do."""
    blark = pytest.importorskip("blark", reason="parses Structured Text")
    small = models.gaussian()
    values = {p.name: 2.0 for p in (*small.affine, *small.nonlinear)}
    whole = everything() if scale == 1.0 else models.from_parameters(small, values)
    whole = models.Model(whole.term, scale * whole.alpha, whole.units)
    text = export(whole, "st", name="stage_1").text
    parsed = blark.parse_source_code(text)
    assert parsed.exception is None and parsed.tree is not None
    wrong = blark.parse_source_code(text.replace("END_IF;", "END;", 1))
    assert wrong.exception is not None  # it does look


def test_at_standstill_friction_goes_by_the_commanded_velocity():
    term = models.named("gaussian")
    values = {p.name: 2.0 for p in (*term.affine, *term.nonlinear)}
    found = export(models.from_parameters(term, values), "st")
    call = interpreted(found.text)
    assert call(0.0, 0.0, 0.0, 0.0)[0] == 0.0
    for v in (1e-9, -1e-9):  # Coulomb and the whole bump, before the axis moves
        assert call(0.0, v, 0.0, 0.0)[0] == pytest.approx(math.copysign(4.0, v))
    assert "commanded" in found.remarks[-1] and found.force_error.rms == 0


@pytest.mark.parametrize("name", ["if", "Force", "2nd", "a__b", "axis_", "END_IF", "x", "ä"])
def test_a_name_that_the_language_takes_otherwise_is_refused(name):
    with pytest.raises(ValueError, match="--name"):
        export(model(terms.Coulomb()), "st", name=name)


def test_a_unit_cannot_break_out_of_a_comment():
    text = export(model(terms.Coulomb(), units={"force": "N *) evil (*"}), "st").text
    assert "*) evil" not in text


def test_numbers_have_a_point_before_the_exponent():
    assert st._real("1e-05 * x + 2.5e+20 - p_1e") == "1.0e-05 * x + 2.5e+20 - p_1e"


@pytest.mark.parametrize("target", ["c", "st", "modelica"])
@pytest.mark.parametrize("name", ["gaussian", "symmetric-lorentzian", "generalised"])
def test_a_force_that_divides_by_zero_is_refused(target, name):
    """At rest 0/0: the library has no bump of no width, the text would give no number."""
    term = models.named(name)
    values = {p.name: 0.0 if "velocity" in p.name else 1.0 for p in (*term.affine, *term.nonlinear)}
    with pytest.raises(ValueError, match="stribeck_velocity.* is 0, and the force divides by it"):
        export(models.from_parameters(term, values), target)


@pytest.mark.parametrize("target", ["c", "st", "modelica", "mujoco", "urdf", "table"])
def test_a_direction_that_was_not_seen_is_refused(target):
    lacking = {"inertia": 1.0, "coulomb+": 20.0, "viscous+": 3.0}
    lacking |= {"coulomb-": jnp.nan, "viscous-": jnp.nan}
    found = models.from_parameters(models.coulomb_viscous(), lacking)
    with pytest.raises(ValueError, match="no value for coulomb-, viscous-.*both directions"):
        export(found, target)
