"""C99: one function for the friction, one for the whole force, the parameters as constants."""

import re
from collections.abc import Sequence
from textwrap import indent

from ..models import Model
from .outcome import Exported, exact
from .parts import Divided, Line, Part, constants, divided, levels, lines, stated, unwritten
from .syntax import C, identifier, literal

_KEYWORDS = set(
    "auto break case char const continue default do double else enum extern float for goto if "
    "inline int long register restrict return short signed sizeof static struct switch typedef "
    "union unsigned void volatile while".split()
)


def export(model: Model, name: str = "axis") -> Exported:
    """A self-contained C99 text with `NAME_friction` and `NAME_force`; exact in what it holds.

    Terms with memory or channels, and a delay, are left out and named, in the text too.

    **Raises:** `ValueError` for a name that is none in C.
    """
    check_name(name)
    taken, missing = divided(model), unwritten(model)
    text = "\n".join(
        (
            _head(model, name, missing),
            _constants([*constants(model, taken), *levels(model)]),
            C.helpers["sign_of"],
            _friction(model, name, taken.slip),
            _force(model, name, taken),
            *_stick(model, name),
        )
    )
    return Exported(text, exact(model), missing)


def check_name(name: str) -> None:
    """Raise `ValueError` for a name that no name in C can begin with."""
    if not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) or name in _KEYWORDS:
        raise ValueError(f"{name!r} cannot begin a name in C: use letters, digits and _ (--name).")


def _head(model: Model, name: str, missing: Sequence[str]) -> str:
    force, position = (comment(dict(model.units)[key]) for key in ("force", "position"))
    return f"""/* {name}: the force of an axis, identified by jaxfric.
 *
 * C99, no state, no allocation. Units: {force} (force), {position} (position), s (time).
 *
 * double {name}_friction(double velocity);
 * double {name}_force(double position, double velocity, double acceleration, double time);
{lacks(missing)} */
#include <math.h>
"""


def lacks(missing: Sequence[str]) -> str:
    """Lines of a comment that say what a text leaves out."""
    return "".join(f" * Left out: {comment(text)}.\n" for text in missing)


def comment(unit: str) -> str:
    """A unit's name as it can stand in a comment."""
    return " ".join(unit.replace("*/", "* /").replace("/*", "/ *").split())


def _constants(values: Sequence[tuple[str, float, str]]) -> str:
    rows = [
        f"static const double {identifier(name)} = {literal(value)};"
        f" /* {name}, {comment(unit)} */\n"
        for name, value, unit in values
    ]
    return "".join(rows)


def _friction(model: Model, name: str, slip: Sequence[Part]) -> str:
    unit = comment(dict(model.units)["force"])
    return f"""/* Friction in slip, {unit}. At velocity 0, the constant terms alone. */
double {name}_friction(double velocity)
{{
    const double v = velocity;
    double u = 0.0;

{body(slip)}    (void)v;
    return u;
}}
"""


def _force(model: Model, name: str, taken: Divided) -> str:
    unit = comment(dict(model.units)["force"])
    return f"""/* The force that a motion needs, {unit}: friction and all the other terms. */
double {name}_force(double position, double velocity, double acceleration, double time)
{{
    const double x = position, v = velocity, a = acceleration, t = time;
    double u = {name}_friction(velocity);

{whole(taken)}    (void)x, (void)v, (void)a, (void)t;
    return u;
}}
"""


def _stick(model: Model, name: str) -> list[str]:
    """Eq. (4) of Kim, Kim & Ha (2004): friction at rest, up to the break-away levels."""
    known = {key: identifier(key) for key, _, _ in levels(model)}
    if not known:
        return []
    unit, tiny = comment(dict(model.units)["force"]), "2.3e-162"
    low = known.get("breakaway-", f"{name}_friction(-{tiny})")
    high = known.get("breakaway+", f"{name}_friction({tiny})")
    return [
        f"""/* Friction at rest, {unit}: it balances the applied force up to break-away. */
double {name}_stick(double applied)
{{
    return fmin(fmax(applied, {low}), {high});
}}
"""
    ]


def whole(taken: Divided) -> str:
    """The statements that add to slip friction `u` all else, last what the actuator makes of it."""
    if not taken.faulty:
        return body(taken.rest)
    needed = "    /* What a faultless actuator would have to give. */\n    const double f = u;\n\n"
    return f"{body(taken.rest)}{needed}{_reaction(taken.borne)}{body(taken.faulty)}    (void)f;\n"


def _reaction(borne: Sequence[Part] | None) -> str:
    """The statements that say what friction carries, `r`, where some is a share of it."""
    if borne is None:
        return ""
    inner = "".join(f"    {row}\n" if row else "\n" for row in body(borne).splitlines())
    return (
        "    /* What friction carries. */\n    double r;\n    {\n        double u = 0.0;\n"
        f"{inner}        r = u;\n    }}\n\n"
    )


def body(some: Sequence[Part]) -> str:
    """The statements that add the force of some summands to `u`."""
    texts = (stated(lines(C, part), _added, "if (v {} 0.0) {{\n", "}\n") for part in some)
    return "".join(
        f"    /* {part.name} */\n{indent(text, '    ')}"
        for part, text in zip(some, texts, strict=True)
    )


def _added(line: Line) -> str:
    return f"u += {identifier(line.parameter)} * {line.column};\n"
