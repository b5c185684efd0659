# SPDX-License-Identifier: Apache-2.0
"""Functional mock-up units of an exported library, for co-simulation by FMI 3.0 and FMI 2.0."""

from __future__ import annotations

import io
import os
import subprocess
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from uuid import NAMESPACE_URL, uuid5

from arm_dynamics import KernelError
from arm_dynamics.codegen.compiler import find_compiler
from arm_dynamics.exceptions import CompilerMissing
from arm_sim.export.fmu.model_description import (
    Unit,
    build_description,
    fmi2_description,
    fmi3_description,
)
from arm_sim.export.fmu.variables import Variable, variables
from arm_sim.export.library import named
from arm_sim.export.names import of_frames
from arm_sim.export.tick import Tick

NATIVE = Path(__file__).parents[1] / "native"
_FLAGS = ("-std=gnu11", "-O1", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC")
_DATE = (1980, 1, 1, 0, 0, 0)  # of all files: the same scene gives the same bytes
_PLATFORM = {"2": "linux64", "3": f"{os.uname().machine}-linux"}


@dataclass(frozen=True)
class Mockup:
    """What units are made of.

    Attributes:
        name: Name of the library.
        about: What it is, in a line.
        period: Length of a tick in [s].
        variables: Variables in the order of their value references.
        sources: The library's files, ``N.h`` and ``N.c``, by name.
        slopes: Whether there are derivatives of steps.
        frames: Parts of the names of the library's functions for the frames that take wrenches.
    """

    name: str
    about: str
    period: float
    variables: tuple[Variable, ...]
    sources: Mapping[str, str]
    slopes: bool
    frames: tuple[str, ...] = ()


def mockup_of(name: str, tick: Tick, sources: Mapping[str, str], frames: Sequence[str]) -> Mockup:
    """What the units of an exported library are made of.

    Args:
        name: Name of the library.
        tick: Its tick.
        sources: The files ``N.h`` and ``N.c`` by name.
        frames: Frames that take wrenches; the tick of an arm with some has external torques.
    """
    simulator = tick.simulator
    model, nominal = simulator.model, simulator.arm.plant.parameters.nominal
    parameters = list(zip(tick.parameters, map(float, nominal), strict=False))
    about = f"robot '{model.pin.name}', {model.n} joints"
    found = variables(model, simulator.state, parameters, frames)
    slopes = tick.differentiable and not frames
    return Mockup(name, about, simulator.dt, found, sources, slopes, tuple(of_frames(frames)))


def units(mockup: Mockup) -> dict[str, bytes]:
    """The files ``N.fmu`` by FMI 3.0 and ``N_fmi2.fmu`` by FMI 2.0, for this kind of machine.

    Raises:
        CompilerMissing: If there is no C compiler.
        KernelError: If it refuses the code.
    """
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        _write(folder, mockup.sources)
        _compile(folder, "-c", f"{mockup.name}.c", "-o", "library.o")
        return {
            f"{mockup.name}.fmu": _archive(mockup, "3", folder),
            f"{mockup.name}_fmi2.fmu": _archive(mockup, "2", folder),
        }


def _archive(mockup: Mockup, version: str, folder: Path) -> bytes:
    """An FMU by a version of FMI; the folder contains the library's files, compiled."""
    name, wrapper, token = mockup.name, f"fmi{version}.c", _token(mockup, version)
    text = _wrapper(mockup, wrapper, token)
    _write(folder, {wrapper: text})
    _compile(folder, "-shared", wrapper, "library.o", "-lm", "-o", "unit.so")
    unit = Unit(name, mockup.about, token, mockup.period, mockup.variables, mockup.slopes)
    compiled, sources = (wrapper, f"{name}.c"), {**mockup.sources, wrapper: text}
    if version == "3":
        description = fmi3_description(unit)
        sources["buildDescription.xml"] = build_description(unit, compiled)
    else:
        description = fmi2_description(unit, compiled)
    return _zipped({
        "modelDescription.xml": description,
        f"binaries/{_PLATFORM[version]}/{name}.so": (folder / "unit.so").read_bytes(),
        **{f"sources/{file}": content for file, content in sources.items()},
    })  # fmt: skip


def _token(mockup: Mockup, version: str) -> str:
    """Text that identifies what the unit was made of."""
    parts = version, *map(repr, mockup.variables), *mockup.sources.values()
    return f"{{{uuid5(NAMESPACE_URL, ''.join(parts))}}}"


def _wrapper(mockup: Mockup, file: str, token: str) -> str:
    """The source of the functions of FMI."""
    parameters = [v.name for v in mockup.variables if v.variability == "tunable"]
    starts = ", ".join(repr(0.0 if v.start is None else v.start) for v in mockup.variables)
    values = {
        "JOINTS": str(sum(v.name.endswith(".position") for v in mockup.variables)),
        "PARAMETERS": str(len(parameters)),
        "NAMES": ", ".join(f'"{name}"' for name in parameters) or "0",
        "PERIOD": repr(mockup.period),
        "DEFAULTS": f"{{{starts}}}",
        "TOKEN": f'"{token}"',
        "FRAMES": str(len(mockup.frames)),
    }
    if mockup.slopes:
        values["SLOPES"] = "1"
    if mockup.frames:
        jacobians = (f"{mockup.name}_jacobian_{frame}" for frame in mockup.frames)
        values["JACOBIANS"] = ", ".join(jacobians)
        values["EXTERNAL"] = str(parameters.index("external[0]"))
    defined = "".join(f"#define {key} {value}\n" for key, value in values.items())
    common = (NATIVE / "instance.h").read_text()
    for line in ("#pragma once\n", '#include "library.h"\n'):
        common = common.replace(line, "")
    text = (NATIVE / file).read_text().replace('#include "instance.h"\n', common)
    return f'{defined}#include "{mockup.name}.h"\n\n{named(mockup.name, text)}'


def _write(folder: Path, files: Mapping[str, str]) -> None:
    for file, text in files.items():
        (folder / file).write_text(text, encoding="utf-8")


def _compile(folder: Path, *arguments: str) -> None:
    """Run the compiler in a folder."""
    command = find_compiler()
    if command is None:
        raise CompilerMissing("an FMU contains a shared library, and there is no C compiler")
    done = subprocess.run(
        [*command, *_FLAGS, *arguments], cwd=folder, check=False, capture_output=True, text=True,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip
    if done.returncode != 0:
        raise KernelError(f"{command[0]} refused the code of an FMU:\n{done.stderr[-2000:]}")


def _zipped(files: Mapping[str, str | bytes]) -> bytes:
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as opened:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, _DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            opened.writestr(entry, content)
    return archive.getvalue()
