# SPDX-License-Identifier: Apache-2.0
"""Functional mock-up units of an exported library, for co-simulation by FMI 3.0 and FMI 2.0."""

import io
import os
import subprocess
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from arm_dynamics import KernelError
from arm_dynamics.codegen.compiler import find_compiler
from arm_dynamics.exceptions import CompilerMissing
from arm_sim.export.amalgamated import OWN, amalgamated
from arm_sim.export.fmu import model_description
from arm_sim.export.fmu.variables import variables
from arm_sim.export.library import named
from arm_sim.export.names import of_frames
from arm_sim.export.tick import Tick

_FLAGS = ("-std=gnu11", "-O1", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC")
_DATE = (1980, 1, 1, 0, 0, 0)  # of all files: the same scene gives the same bytes
_PLATFORM = {"2": "linux64", "3": f"{os.uname().machine}-linux"}


def build_fmus(
    name: str, tick: Tick, sources: Mapping[str, str], frames: Sequence[str]
) -> dict[str, bytes]:
    """The files ``N.fmu`` by FMI 3.0 and ``N_fmi2.fmu`` by FMI 2.0, for this kind of machine.

    Args:
        name: Name of the library.
        tick: Its tick.
        sources: The files ``N.h`` and ``N.c`` by name.
        frames: Frames that take wrenches; the tick of an arm with some has external torques.

    Raises:
        CompilerMissing: If there is no C compiler.
        KernelError: If it refuses the code.
    """
    simulator = tick.simulator
    model, nominal = simulator.model, simulator.arm.plant.parameters.nominal
    parameters = list(zip(tick.parameters, map(float, nominal), strict=False))
    fmu = model_description.Fmu(
        name, f"robot '{model.pin.name}', {model.n} joints", simulator.dt,
        variables(model, simulator.state, parameters, frames), sources,
        tick.differentiable and not frames, of_frames(frames),
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        _write(folder, sources)
        _compile(folder, "-c", f"{name}.c", "-o", "library.o")
        return {
            f"{name}.fmu": _archive(fmu, "3", folder),
            f"{name}_fmi2.fmu": _archive(fmu, "2", folder),
        }


def _archive(fmu: model_description.Fmu, version: str, folder: Path) -> bytes:
    """An FMU by a version of FMI; the folder contains the library's files, compiled."""
    name, wrapper = fmu.name, f"fmi{version}.c"
    text = _wrapper(fmu, wrapper, fmu.token(version))
    _write(folder, {wrapper: text})
    _compile(folder, "-shared", wrapper, "library.o", "-lm", "-o", "unit.so")
    compiled, sources = (wrapper, f"{name}.c"), {**fmu.sources, wrapper: text}
    if version == "3":
        description = model_description.fmi3_description(fmu)
        sources["buildDescription.xml"] = model_description.build_description(fmu, compiled)
    else:
        description = model_description.fmi2_description(fmu, compiled)
    return _zipped({
        "modelDescription.xml": description,
        f"binaries/{_PLATFORM[version]}/{name}.so": (folder / "unit.so").read_bytes(),
        **{f"sources/{file}": content for file, content in sources.items()},
    })  # fmt: skip


def _wrapper(fmu: model_description.Fmu, file: str, token: str) -> str:
    """The source of the functions of FMI."""
    parameters = [v.name for v in fmu.variables if v.variability == "tunable"]
    starts = ", ".join(repr(0.0 if v.start is None else v.start) for v in fmu.variables)
    values = {
        "JOINTS": str(sum(v.name.endswith(".position") for v in fmu.variables)),
        "PARAMETERS": str(len(parameters)),
        "NAMES": ", ".join(f'"{name}"' for name in parameters) or "0", "PERIOD": repr(fmu.period),
        "DEFAULTS": f"{{{starts}}}", "TOKEN": f'"{token}"', "FRAMES": str(len(fmu.frames)),
    }  # fmt: skip
    if fmu.directional_derivatives:
        values["SLOPES"] = "1"
    if fmu.frames:
        jacobians = (f"{fmu.name}_jacobian_{frame}" for frame in fmu.frames)
        values["JACOBIANS"] = ", ".join(jacobians)
        values["EXTERNAL"] = str(parameters.index("external[0]"))
    definitions = "".join(f"#define {key} {value}\n" for key, value in values.items())
    text = amalgamated((OWN / file).read_text(encoding="utf-8"), {"library.h"})
    return f'{definitions}#include "{fmu.name}.h"\n\n{named(fmu.name, text)}'


def _write(folder: Path, files: Mapping[str, str]) -> None:
    for file, text in files.items():
        (folder / file).write_text(text, encoding="utf-8")


def _compile(folder: Path, *arguments: str) -> None:
    """Run the compiler in a folder."""
    if (command := find_compiler()) is None:
        raise CompilerMissing("an FMU contains a shared library, and there is no C compiler")
    process = subprocess.run(
        [*command, *_FLAGS, *arguments], cwd=folder, check=False, capture_output=True, text=True,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip
    if process.returncode != 0:
        raise KernelError(f"{command[0]} refused the code of an FMU:\n{process.stderr[-2000:]}")


def _zipped(files: Mapping[str, str | bytes]) -> bytes:
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as contents:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, _DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            contents.writestr(entry, content)
    return archive.getvalue()
