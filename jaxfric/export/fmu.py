"""FMI 2.0: a source-code FMU for model exchange and co-simulation, from motion to force."""

import hashlib
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from importlib import resources
from io import BytesIO
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from ..models import Model
from . import c
from .outcome import Exported, exact
from .parts import constants, divided, unwritten, without_levels
from .syntax import C, identifier, literal

SOURCE = "fmu.c"
# A zip knows no earlier date; the same model gives the same bytes.
EPOCH = (1980, 1, 1, 0, 0, 0)
INPUTS = ("position", "velocity", "acceleration")
OUTPUTS = {"friction": "in slip", "force": "that the motion needs"}


def export(model: Model, name: str = "axis") -> Exported:
    """An FMU with inputs position, velocity, acceleration and outputs friction, force; exact in
    what it holds.

    The parameters of the model are parameters of the FMU. `text` is its C source, `data` the
    archive. Terms with memory or channels, and a delay, are left out and named.

    **Raises:** `ValueError` for a name that is none in C.
    """
    c.check_name(name)
    values = _source(model, name)
    guid = "{" + hashlib.sha256(str(sorted(values.items())).encode()).hexdigest()[:32] + "}"
    text = _filled(values | {"guid": guid})
    description = _description(model, name, guid)
    remarks = (
        "Source code: tools that load compiled FMUs only take it after a C compiler has been over "
        "it, for instance by fmpy: fmpy compile FILE.",
        *without_levels(model),
    )
    data = _archive({"modelDescription.xml": description, f"sources/{SOURCE}": text})
    return Exported(text, exact(model), unwritten(model), remarks, data=data)


def _source(model: Model, name: str) -> dict[str, str]:
    """What the C text of the FMU says of this model."""
    taken = divided(model)
    known = constants(model, taken)
    first = len(INPUTS) + len(OUTPUTS)
    rows = [
        f"    const double {identifier(key)} = real[{first + i}];\n"
        for i, (key, _, _) in enumerate(known)
    ]
    start = ["0.0"] * first + [literal(value) for _, value, _ in known]
    return {
        "name": name,
        "force": c.comment(dict(model.units)["force"]),
        "position": c.comment(dict(model.units)["position"]),
        "lacks": c.lacks(unwritten(model)),
        "count": str(len(start)),
        "start": ", ".join(start),
        "helper": C.helpers["sign_of"],
        "parameters": "".join(rows),
        "friction": c.body(taken.slip),
        "rest": c.whole(taken),
    }


def _filled(values: Mapping[str, str]) -> str:
    template = resources.files(__package__) / "assets" / "fmi2.c"
    text = template.read_text(encoding="utf-8")
    return re.sub(r"@(\w+)@", lambda found: values[found[1]], text)


def _description(model: Model, name: str, guid: str) -> str:
    """The text of modelDescription.xml."""
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=name,
        guid=guid,
        description="Force of an axis, identified by jaxfric",
        generationTool="jaxfric",
        variableNamingConvention="flat",
        numberOfEventIndicators="0",
    )
    able = {"modelIdentifier": name, "canGetAndSetFMUstate": "true"}
    steps = {"canHandleVariableCommunicationStepSize": "true"}
    for kind, more in (
        ("ModelExchange", {"completedIntegratorStepNotNeeded": "true"}), ("CoSimulation", steps)
    ):  # fmt: skip
        sources = ET.SubElement(ET.SubElement(root, kind, able | more), "SourceFiles")
        ET.SubElement(sources, "File", name=SOURCE)
    rows = _variables(model)
    units = ET.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(row["unit"] for row in rows if row["unit"]):
        ET.SubElement(units, "Unit", name=unit)
    variables = ET.SubElement(root, "ModelVariables")
    for number, row in enumerate(rows):
        _variable(variables, number, row)
    structure = ET.SubElement(root, "ModelStructure")
    for section in ("Outputs", "InitialUnknowns"):
        unknowns = ET.SubElement(structure, section)
        for i in range(len(OUTPUTS)):
            ET.SubElement(unknowns, "Unknown", index=str(len(INPUTS) + 1 + i))
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _variables(model: Model) -> list[dict[str, str]]:
    """Name, unit, causality, start and description of each value, in the order of the C text."""
    units = dict(model.units)
    moving = zip(INPUTS, ("", "/s", "/s²"), strict=True)
    rows = [
        {"name": key, "unit": units["position"] + per, "causality": "input", "start": "0.0"}
        for key, per in moving
    ]
    rows += [
        {"name": key, "unit": units["force"], "causality": "output", "description": text}
        for key, text in OUTPUTS.items()
    ]
    rows += [
        {
            "name": identifier(key),
            "unit": unit,
            "causality": "parameter",
            "start": literal(value),
            "description": key,
        }
        for key, value, unit in constants(model, divided(model))
    ]
    return rows


def _variable(parent: ET.Element, number: int, row: Mapping[str, str]) -> None:
    fixed = {"variability": "tunable"} if row["causality"] == "parameter" else {}
    named = {key: row[key] for key in ("name", "causality", "description") if key in row}
    variable = ET.SubElement(
        parent, "ScalarVariable", named | {"valueReference": str(number)} | fixed
    )
    ET.SubElement(variable, "Real", {key: row[key] for key in ("unit", "start") if row.get(key)})


def _archive(files: Mapping[str, str]) -> bytes:
    buffer = BytesIO()
    with ZipFile(buffer, "w", ZIP_DEFLATED) as archive:
        for path, text in files.items():
            archive.writestr(ZipInfo(path, EPOCH), text, ZIP_DEFLATED)
    return buffer.getvalue()
