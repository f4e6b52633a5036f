"""What drives' and robots' tools write in place of a signal's name: object numbers, codes, paths.

A code beside a name (`r0063 Actual speed`) says nothing that the name does not; one that stands
alone is its name in the maker's list.
"""

import re

# Code, in small letters -> the signal's name.
_NAMES = {
    # CiA 402 (IEC 61800-7-201), objects as 6064h and 0x6064
    "6062": "position demand", "6064": "position actual", "606b": "velocity demand",
    "606c": "velocity actual", "6071": "target torque", "6074": "torque demand",
    "6077": "torque actual", "6078": "actual current", "607a": "target position",
    "60ff": "target velocity",
    # Sercos (IEC 61800-7-204)
    "s-0-0036": "velocity command", "s-0-0040": "velocity feedback",
    "s-0-0047": "position command", "s-0-0051": "position feedback",
    "s-0-0080": "torque command", "s-0-0084": "effort feedback",  # in a unit of its own
    # SINAMICS
    "r0062": "speed setpoint", "r0063": "actual speed", "r0078": "actual current",
    "r0079": "torque setpoint", "r0080": "actual torque", "r0482": "actual encoder",
    "r2521": "actual position",
    # Kollmorgen AKD: position, velocity and current loop
    "pl.fb": "position feedback", "vl.fb": "velocity feedback", "il.fb": "current feedback",
    "pl.cmd": "position command", "vl.cmd": "velocity command", "il.cmd": "current command",
    # Elmo
    "px": "position", "vx": "velocity",
}  # fmt: skip
# Parts of the motor's rated torque and current; steps of the encoder.
_UNITS = {"6077": "permille", "6078": "permille", "r0482": "counts"}
_CODE = re.compile(
    r"(?<![A-Za-z0-9])(?:"
    r"0[xX](?P<hex>6[\dA-Fa-f]{3})(?::\w+)?|(?P<object>6[\dA-Fa-f]{3})h(?:[:.]\w+)?"
    r"|(?P<sercos>[Ss]-0-\d{4})|(?P<sinamics>[rR]\d{2,4})(?:\[\d+\])?"
    r"|(?P<loop>[PVI]L\.(?:FB|CMD))|(?P<elmo>PX|VX)"
    r")(?![\w.])"
)
_FLAT = re.compile(r"field\.(?:.*\.)?([A-Za-z_]+)\d*")
_BRACKET = re.compile(r"[\[({][^\])}]*[\])}]")


def named(name: str) -> str:
    """A column's name without its maker's code or path; the code's own name where it stands alone.

    `/joint_states/elbow/position` (a topic of ROS) and `field.position0` (rostopic's table) are a
    `position`: of several joints there are several.
    """
    name = name.removeprefix("%")  # as rostopic begins its table
    if name.startswith("/") and (last := name.rsplit("/", 1)[1]):
        return "timestamp" if name.endswith("/header/stamp") else last
    if flat := _FLAT.fullmatch(name):
        return flat[1]
    code = _CODE.search(name)
    if not code:
        return name
    known = next(filter(None, code.groups())).lower()
    before, after = name[: code.start()], name[code.end() :]
    unit = "" if _BRACKET.search(after) else _UNITS.get(known, "")
    if re.search(r"[^\W\d_]", _BRACKET.sub("", after)):
        return f"{before}{after} {unit}".strip()
    own = _NAMES.get(known)
    return f"{own} {after} {unit}".strip() if own else name
