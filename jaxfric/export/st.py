"""IEC 61131-3 Structured Text: a function block from the commanded motion to the force.

Friction at standstill goes by the sign of the commanded velocity: with its first increment the
block gives the break-away force in that direction, while the axis itself still stands.
"""

import re
from collections.abc import Sequence

from ..models import Model
from .outcome import Exported, exact
from .parts import Divided, Line, Part, constants, divided, lines, stated, unwritten, without_levels
from .syntax import Syntax, identifier, literal

_KEYWORDS = set(
    "abs acos action and any array asin at atan bool by byte case concat constant cos date delete "
    "dint div do dt dword else elsif end_case end_for end_function end_function_block end_if "
    "end_repeat end_var end_while eq exit exp expt false find for function function_block ge gt if "
    "insert int le left len limit lint ln log lreal lt lword max mid min mod move mul mux ne not "
    "of or real repeat replace return right rol ror sel shl shr sin sint sqrt string struct sub "
    "tan then time tod to true type udint uint ulint until usint var var_input var_output while "
    "word xor".split()
)
_PLAIN = str.maketrans({"·": ".", "²": "2", "³": "3", "⁴": "4", "µ": "u", "°": "deg"})
_NEEDED = "(* what a faultless actuator would have to give *)\nf := force;"
_OWN = {"position", "velocity", "acceleration", "elapsed", "friction", "force", *"xvatfr"}


def export(model: Model, name: str = "axis") -> Exported:
    """A function block `NAME` with the outputs `friction` and `force`; exact in what it holds.

    Terms with memory or channels, and a delay, are left out and named, in the text too.

    **Raises:** `ValueError` for a name that is none in Structured Text.
    """
    if not _fine(name):
        raise ValueError(
            f"{name!r} cannot name a function block: use letters, digits and single _ (--name)."
        )
    taken, missing = divided(model), unwritten(model)
    syntax = _syntax(name)
    units = {key: _comment(unit) for key, unit in dict(model.units).items()}
    text = "\n".join(
        (
            _head(name, units, missing),
            _sign(name),
            f"FUNCTION_BLOCK {name}",
            _signals(units, ", f" * bool(taken.faulty) + ", r" * (taken.borne is not None)),
            _constants(model, taken),
            "x := position;\nv := velocity;\na := acceleration;\nt := elapsed;",
            "friction := 0.0;",
            _body(syntax, taken.slip, "friction"),
            "force := friction;",
            _body(syntax, taken.rest, "force"),
            *[_NEEDED] * bool(taken.faulty),
            *_reaction(syntax, taken.borne),
            _body(syntax, taken.faulty, "force"),
            "END_FUNCTION_BLOCK\n",
        )
    )
    remark = (
        "At commanded standstill the friction is zero; from the first commanded velocity on it is "
        "the break-away force in that direction. Feed it the commanded motion, not the measured."
    )
    return Exported(text, exact(model), missing, (remark, *without_levels(model)))


def _reaction(syntax: Syntax, borne: Sequence[Part] | None) -> list[str]:
    """What friction carries, `r`, where some is a share of it."""
    if borne is None:
        return []
    return ["(* what friction carries *)\nr := 0.0;", _body(syntax, borne, "r")]


def _fine(name: str) -> bool:
    """Whether a name may stand in Structured Text, where upper and lower case are the same."""
    formed = re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name, re.ASCII)
    return bool(formed) and name.lower() not in _KEYWORDS | _OWN


def _syntax(name: str) -> Syntax:
    names = ("abs", "exp", "sin", "cos", "min", "max")
    return Syntax(
        functions={each: each.upper() for each in names} | {"sign": f"{name}_SIGN"},
        power="EXPT({0}, {1})",
        choice="SEL({0}, {2}, {1})",
        helpers={},
    )


def _comment(text: str) -> str:
    """Text as it can stand in a comment, in ASCII, which every editor of these programs reads."""
    plain = text.replace("*)", "* )").replace("(*", "( *").translate(_PLAIN)
    return " ".join(plain.encode("ascii", "replace").decode().split())


def _real(text: str) -> str:
    """Numbers with a decimal point before the exponent, as the standard asks."""
    return re.sub(r"(?<![\w.])(\d+)(e[+-]?\d+)", r"\1.0\2", text)


def _name(parameter: str) -> str:
    """A parameter's identifier: no two underscores in a row, and no word of the language."""
    plain = re.sub(r"_+", "_", identifier(parameter)).strip("_")
    return f"p_{plain}" if not _fine(plain) else plain


def _head(name: str, units, missing: Sequence[str]) -> str:
    lacks = "".join(f"\n   Left out: {_comment(text)}." for text in missing)
    return f"""(* {name}: the feed-forward force of an axis, identified by jaxfric.

   IEC 61131-3, no state. Call it each cycle with the commanded motion.
   Units: {units["force"]} (force), {units["position"]} (position), s (time).
   LREAL throughout; with REAL in its place the error is about one in ten million.{lacks} *)
"""


def _sign(name: str) -> str:
    return f"""FUNCTION {name}_SIGN : LREAL
VAR_INPUT
    signal : LREAL;
END_VAR
IF signal > 0.0 THEN
    {name}_SIGN := 1.0;
ELSIF signal < 0.0 THEN
    {name}_SIGN := -1.0;
ELSE
    {name}_SIGN := 0.0;
END_IF;
END_FUNCTION
"""


def _signals(units, more: str) -> str:
    force, position = units["force"], units["position"]
    return f"""VAR_INPUT
    position : LREAL; (* commanded, {position} *)
    velocity : LREAL; (* commanded, {position}/s *)
    acceleration : LREAL; (* commanded, {position}/s2 *)
    elapsed : LREAL; (* time, s *)
END_VAR
VAR_OUTPUT
    friction : LREAL; (* in slip, {force} *)
    force : LREAL; (* that the motion needs, friction included, {force} *)
END_VAR
VAR
    x, v, a, t{more} : LREAL;
END_VAR"""


def _constants(model: Model, taken: Divided) -> str:
    rows = [
        f"    {_name(name)} : LREAL := {_real(literal(value))}; (* {name}, {_comment(unit)} *)\n"
        for name, value, unit in constants(model, taken)
    ]
    return "VAR CONSTANT\n" + "".join(rows) + "END_VAR"


def _body(syntax: Syntax, some: Sequence[Part], result: str) -> str:
    def added(line: Line) -> str:
        return f"{result} := {result} + {_product(line)};\n"

    return "".join(
        f"(* {_comment(part.name)} *)\n"
        + stated(lines(syntax, part), added, "IF v {} 0.0 THEN\n", "END_IF;\n")
        for part in some
    )


def _product(line: Line) -> str:
    words = re.sub(r"[A-Za-z_]\w*", lambda found: _word(found[0]), _real(line.column))
    return f"{_name(line.parameter)} * {words}"


def _word(word: str) -> str:
    """A word of an expression: signals and functions as they are, parameters by their names."""
    if word in set("xvatfr") or word.isupper() or word.endswith("_SIGN"):
        return word
    return word if re.fullmatch(r"e\d*", word) else _name(word)
