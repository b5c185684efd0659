# SPDX-License-Identifier: Apache-2.0
"""The file ``modelDescription.xml`` of a functional mock-up unit, by FMI 2.0 and FMI 3.0."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from uuid import NAMESPACE_URL, uuid5
from xml.etree import ElementTree

from arm_sim import __version__
from arm_sim.export.fmu.variables import UNITS, Variable

Element = ElementTree.Element
_add = ElementTree.SubElement


@dataclass(frozen=True)
class Fmu:
    """A functional mock-up unit.

    Attributes:
        name: Name of the library, of the model, and of its binary.
        about: What it is, in a line.
        period: Length of a tick in [s].
        variables: Its variables in the order of their value references.
        sources: The library's files, ``N.h`` and ``N.c``, by name.
        directional_derivatives: Whether it provides directional derivatives.
        frames: Parts of the names of the library's functions for the frames that take wrenches.
    """

    name: str
    about: str
    period: float
    variables: tuple[Variable, ...]
    sources: Mapping[str, str]
    directional_derivatives: bool
    frames: Sequence[str]

    def token(self, version: str) -> str:
        """Text that identifies what the unit by a version of FMI was made of."""
        parts = version, *map(repr, self.variables), *self.sources.values()
        return f"{{{uuid5(NAMESPACE_URL, ''.join(parts))}}}"


def fmi3_description(fmu: Fmu) -> str:
    """The description by FMI 3.0 (section 2.4)."""
    root, _ = _skeleton(fmu, {"fmiVersion": "3.0", "instantiationToken": fmu.token("3")}, {
        "fixedInternalStepSize": repr(fmu.period),
        "canGetAndSetFMUState": "true", "canSerializeFMUState": "true",
        **({"providesDirectionalDerivatives": "true"} if fmu.directional_derivatives else {}),
    })  # fmt: skip
    variables = _add(root, "ModelVariables")
    for k, variable in enumerate(fmu.variables):
        _add(variables, "Float64", {**_about(k, variable), **_numbers(variable)})
    structure = _add(root, "ModelStructure")
    for tag in ("Output", "InitialUnknown"):
        for k in _outputs(fmu):
            _add(structure, tag, {"valueReference": str(k)})
    return _text(root)


def fmi2_description(fmu: Fmu, sources: Sequence[str]) -> str:
    """The description by FMI 2.0 (section 2.2), with the files in the folder ``sources``."""
    root, simulation = _skeleton(fmu, {"fmiVersion": "2.0", "guid": fmu.token("2")}, {
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true",
        **({"providesDirectionalDerivative": "true"} if fmu.directional_derivatives else {}),
    })  # fmt: skip
    files = _add(simulation, "SourceFiles")
    for name in sources:
        _add(files, "File", {"name": name})
    variables = _add(root, "ModelVariables")
    for k, variable in enumerate(fmu.variables):
        _add(_add(variables, "ScalarVariable", _about(k, variable)), "Real", _numbers(variable))
    structure = _add(root, "ModelStructure")
    for tag in ("Outputs", "InitialUnknowns"):
        unknowns = _add(structure, tag)
        for k in _outputs(fmu):
            _add(unknowns, "Unknown", {"index": str(k + 1)})
    return _text(root)


def build_description(fmu: Fmu, sources: Sequence[str]) -> str:
    """The file ``sources/buildDescription.xml`` of FMI 3.0 (section 2.5.1.4)."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = _add(root, "BuildConfiguration", {"modelIdentifier": fmu.name})
    options = {"language": "C11", "compilerOptions": "-ffp-contract=off"}
    files = _add(build, "SourceFileSet", options)
    for name in sources:
        _add(files, "SourceFile", {"name": name})
    _add(build, "Library", {"name": "m", "external": "true"})
    return _text(root)


def _skeleton(
    fmu: Fmu, versions: dict[str, str], abilities: dict[str, str]
) -> tuple[Element, Element]:
    """What both descriptions begin with, and its part on co-simulation."""
    root = Element("fmiModelDescription", {
        **versions, "modelName": fmu.name, "description": fmu.about,
        "generationTool": f"arm_sim {__version__}", "variableNamingConvention": "flat",
        "license": "Apache-2.0",
    })  # fmt: skip
    simulation = _add(root, "CoSimulation", {
        "modelIdentifier": fmu.name, "canHandleVariableCommunicationStepSize": "true",
        **abilities,
    })  # fmt: skip
    definitions = _add(root, "UnitDefinitions")
    for name in sorted({variable.unit for variable in fmu.variables if variable.unit}):
        exponents = {base: str(power) for base, power in UNITS[name].items()}
        _add(_add(definitions, "Unit", {"name": name}), "BaseUnit", exponents)
    _add(root, "DefaultExperiment", {
        "startTime": "0", "stopTime": repr(1000 * fmu.period), "stepSize": repr(fmu.period),
    })  # fmt: skip
    return root, simulation


def _about(reference: int, variable: Variable) -> dict[str, str]:
    description = {"description": variable.description} if variable.description else {}
    return {
        "name": variable.name, "valueReference": str(reference), "causality": variable.causality,
        "variability": variable.variability, **description,
    }  # fmt: skip


def _numbers(variable: Variable) -> dict[str, str]:
    """Unit, default, and limits."""
    unit = {"unit": variable.unit} if variable.unit else {}
    values = {"start": variable.start, "min": variable.min, "max": variable.max}
    finite = {key: x for key, x in values.items() if x is not None and math.isfinite(x)}
    return unit | {key: repr(value) for key, value in finite.items()}


def _outputs(fmu: Fmu) -> list[int]:
    return [k for k, variable in enumerate(fmu.variables) if variable.causality == "output"]


def _text(root: Element) -> str:
    ElementTree.indent(root)
    text = ElementTree.tostring(root, "unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'
