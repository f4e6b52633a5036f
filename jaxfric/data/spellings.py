"""How loggers spell units, in English and German, and which unit fits which signal.

A name may spell a unit in capitals and small letters, `torque_mNm`: [`apart`][] keeps it whole.
A prefix stands close to its unit: the M of `M_Nm` is a name, and `mN_m` is a product of two units.
"""

import re

from ..units import TORQUES

# Spelling in a name -> the name of the unit. Letters that are synonyms (`s` alone) still match
# as words, because a unit is only taken off where something is left in front of it.
_SPELLINGS = {
    "s": "s sec secs second seconds sek sekunde sekunden",
    "ms": "ms msec msecs milli millis millisec millisecond milliseconds millisekunde "
    "millisekunden",
    "µs": "us µs μs usec usecs µsec μsec micros microsec microsecond microseconds mikrosekunde "
    "mikrosekunden",
    "ns": "ns nsec nanos nanosec nanosecond nanoseconds nanosekunde nanosekunden",
    "min": "min mins minute minutes minuten", "h": "h hr hrs hour hours stunde stunden",
    "m": "m meter meters metre metres", "cm": "cm zentimeter centimeter centimeters centimetre "
    "centimetres", "mm": "mm millimeter millimeters millimetre millimetres",
    "µm": "um µm μm micron microns mikrometer micrometer micrometers micrometre micrometres",
    "nm": "nm nanometer nanometers nanometre nanometres", "km": "km kilometer kilometre",
    "in": "in inch inches zoll", "ft": "ft foot feet",
    "rad": "rad rads radian radians radiant bogenmaß",
    "mrad": "mrad milliradian milliradians", "µrad": "urad µrad μrad microradian microradians",
    "deg": "deg degs ° degree degrees", "mdeg": "mdeg", "arcmin": "arcmin arcminute arcminutes",
    "arcsec": "arcsec arcsecs arcsecond arcseconds",
    "rev": "rev revs revolution revolutions turn turns umdr umdr. umdrehung umdrehungen",
    "counts": "counts count cts cnt cnts inc incs increment increments ink inkr inkrement "
    "inkremente tick ticks pulse pulses",
    "N": "n newton newtons", "kN": "kn kilonewton", "daN": "dan", "cN": "cn",
    "mN": "mn millinewton", "µN": "un µn μn micronewton", "lbf": "lbf lb lbs", "kgf": "kgf kp",
    "A": "a amp amps ampere amperes arms apk", "mA": "ma milliamp milliamps milliampere",
    "µA": "ua µa μa microamp microamps", "V": "v volt volts", "mV": "mv millivolt millivolts",
    "N·m": "n·m n*m n.m n-m n_m n⋅m newtonmeter newtonmeters newtonmetre newtonmetres",
    "mN·m": "mnm mn·m mn*m", "µN·m": "unm µnm μnm", "kN·m": "knm kn·m kn*m", "N·mm": "nmm",
    "N·cm": "ncm n·cm n*cm", "cN·m": "cnm", "kgf·m": "kgfm kgm", "kgf·cm": "kgfcm kgcm",
    "ozf·in": "ozfin ozin inoz", "lbf·ft": "lbf·ft lbf*ft lbfft ftlb ft-lb ftlbf",
    "lbf·in": "lbf·in lbf*in lbfin inlb in-lb inlbf",
    "%": "% pct percent prozent", "‰": "‰ permille promille 0.1%",
    "rpm": "rpm upm 1/min min-1 min^-1 min⁻¹ u/min umdr/min umdr./min umdrehungen/min r/min "
    "rev/min revs/min revolutions/min 1/minute u_min umdr_min r_min rev_min 1_min",
    "krpm": "krpm", "m/s": "mps", "km/h": "km/h kmh km_h kph", "rev/s": "hz rps u/s umdr/s",
}  # fmt: skip
_UNITS = {word: unit for unit, words in _SPELLINGS.items() for word in words.split()}
_UNITS["n m"] = "N·m"
_PER_SECOND = re.compile(
    r"^(.+?)(?:/(?:s|sec|second|sek|sekunde)|[_ ·*]?s(?:\^?-1|⁻¹)|[_ ]per[_ ]s(?:ec|econd)?"
    r"|_s(?:ec)?|ps)$"
)
_PER_MINUTE = re.compile(
    r"^(.+?)(?:/min(?:ute)?|[_ ·*]?min(?:\^?-1|⁻¹)|[_ ]per[_ ]min(?:ute)?|_min)$"
)

# A product with a sign between its factors: a force and a length, in the order of `_UNITS`.
_FACTORS = (
    frozenset("n mn kn un µn μn cn lb lbf kg kgf oz ozf ft in".split()),
    frozenset("m mm cm in ft lb lbf oz ozf".split()),
)
# The only letter that is another prefix as a capital: a meganewton is no millinewton.
_MEGA = re.compile(r"MN(?:[_ ·⋅*.-]?m)?")
# A torque, never a nanometre. All in capitals or small letters either may be meant.
_TORQUE = re.compile(r"N[_ ·⋅*.-]?m")

# Prefix and unit of a force, in mixed case.
_MIXED = r"(?:da|[nuµμmcdkM])(?:N(?:cm|mm?|M)?|A|V)(?![^\W_])"
_JOINED = re.compile(
    rf"(?i:(?<=force)|(?<=torque)|(?<=moment)|(?<=current)|(?<=effort))(?={_MIXED})"
)
_CAMEL = re.compile(rf"(?<![^\W_]){_MIXED}|(?<=[a-z])(?=[A-Z])")

_LENGTHS = {
    "m", "mm", "µm", "nm", "cm", "km", "in", "ft", "rad", "mrad", "µrad", "deg", "mdeg", "arcmin",
    "arcsec", "rev", "counts",
}  # fmt: skip
_RATES = {f"{length}/{per}" for length in _LENGTHS for per in ("s", "min")}
_RATES |= {"km/h", "rpm", "krpm"}
FITTING = {
    "time": {"s", "ms", "µs", "ns", "min", "h"},
    "position": _LENGTHS,
    "reference": _LENGTHS,
    "velocity": _RATES,
    "neighbour_velocity": _RATES,
    "force": {f"{prefix}N" for prefix in ("", "k", "da", "c", "m", "µ", "M")}
    | {"lbf", "kgf", "A", "mA", "µA", "V", "mV", "%", "‰"}
    | TORQUES,
}
# What a row of units may say of other columns.
_OTHERS = frozenset("°c c degc celsius k kelvin °f degf - –".split())


def apart(name: str) -> str:
    """`motorTorque_mNm` as `motor_Torque_mNm`: the words of a name parted, a unit left whole."""
    return _CAMEL.sub(lambda found: found[0] or "_", _JOINED.sub("_", name))


def is_unit(text: str) -> bool:
    """Whether a text is a unit of any signal, also of a temperature or of a column without one."""
    return text.strip().lower() in _OTHERS or any(unit_of(text, role) for role in FITTING)


def unit_of(text: str, role: str) -> str | None:
    """The unit that a suffix or a bracket spells, or `None` where it is none that fits the role."""
    unit = spelt(text, role)
    return unit if unit in FITTING.get(role, (unit,)) else None


def spelt(text: str, role: str) -> str | None:
    """As [`unit_of`][]; `nm` is newton metre on a force and nanometre on a position."""
    raw, text = text.strip(), text.strip().lower()
    if role == "force" and text == "nm":
        return "N·m"
    if role == "force" and _MEGA.fullmatch(raw):
        return "MN" if raw == "MN" else "MN·m"
    if role != "force" and _TORQUE.fullmatch(raw):
        return "N·m"
    if raw == "Grad":  # German for degree; in English a gradian, which nobody logs in a capital
        return "deg"
    if text in _UNITS:
        return _UNITS[text]
    if role == "force" and (product := _product(text)):
        return product
    for pattern, per in ((_PER_SECOND, "s"), (_PER_MINUTE, "min")):
        found = pattern.match(text)
        inner = "deg" if found and raw.startswith("Grad") and found[1] == "grad" else None
        inner = inner or (_UNITS.get(found[1]) if found else None)
        if inner:
            return f"{inner}/{per}"
    return None


def _product(text: str) -> str | None:
    """The torque that a force and a length make, `mN_m`, `in_lb`; of `m_Nm` the m is none."""
    parts = re.split(r"[_ ·⋅*.-]", text)
    if len(parts) != 2 or any(
        part not in known for part, known in zip(parts, _FACTORS, strict=True)
    ):
        return None
    unit = _UNITS.get("".join(parts))
    return unit if unit in TORQUES else None


def other_prefix(before: str, text: str, role: str) -> str | None:
    """The unit that a text would spell with the end of what stands `before` it: for `drive_k_` and
    `Nm` it is kN·m, for `armNm` mN·m; `None` where the end is no prefix.
    """
    found = re.search(r"(?:da|mu|[numkMcµμ])[_ .-]?$", before)
    prefix = found[0].rstrip("_ .-").replace("mu", "u") if found else ""
    return unit_of(prefix + text, role) if prefix else None
