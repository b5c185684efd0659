# SPDX-License-Identifier: Apache-2.0
"""Export of a scene."""

from __future__ import annotations

import logging
from collections.abc import Collection, Sequence
from os import PathLike
from pathlib import Path

from arm_dynamics import ArmModel, InvalidInput
from arm_dynamics.attributes import frozen
from arm_dynamics.dynamics.built import arm_model
from arm_dynamics.model.pinocchio_terms import check_moving
from arm_dynamics.scene import scene_text
from arm_dynamics.scene.load import SceneSource, naming
from arm_sim.export import library
from arm_sim.export.amalgamated import OWN
from arm_sim.export.check_program import check_program
from arm_sim.export.description import about, readme
from arm_sim.export.expected import Expected, test_points
from arm_sim.export.fmu import units
from arm_sim.export.folder import check_folder, write_folder
from arm_sim.export.names import from_title, library_name
from arm_sim.export.terms import DERIVATIVES, TERMS, chosen, terms_of
from arm_sim.export.tick import Tick, tick_of
from arm_sim.recording.origin import SCENE_FILE, URDF_FILE

_log = logging.getLogger(__name__)


@frozen
class Exported:
    """What was exported.

    Attributes:
        folder: The folder.
        name: Name of the library, the prefix of its functions.
        files: Names of the files.
    """

    folder: Path
    name: str
    files: tuple[str, ...]


def export(
    scene: SceneSource | ArmModel,
    out: str | Path,
    name: str | None = None,
    terms: Collection[str] = TERMS,
    tick: bool = True,
    fmu: bool = False,
    frames: Sequence[str] = (),
    servo: bool = False,
) -> Exported:
    """Write a scene as a C library into a folder that needs nothing of the suite.

    Args:
        scene: A scene, anything ``load_scene`` accepts, or an existing arm model.
        out: The folder: a new or empty one, or one that was exported before, whose files are
            replaced.
        name: Name of the library, a C identifier; None for one made from the name of the scene
            file, or of a robot description from that of the robot.
        terms: Names out of ``TERMS`` and ``DERIVATIVES``; with one of the latter, the tick has
            derivatives, too, unless its error is controlled, which a warning says.
        tick: Whether to export the simulator's tick, too.
        fmu: Whether to add functional mock-up units for co-simulation, ``N.fmu`` by FMI 3.0 and
            ``N_fmi2.fmu`` by FMI 2.0, which need the tick.
        frames: Frames whose poses and Jacobians are wanted, and on which wrenches may act in the
            units.
        servo: Whether to add the servos, which track positions and velocities, to the tick.

    Raises:
        InvalidInput: If an argument is not allowed; nothing is written.
        CompilerMissing: If units are wanted and there is no C compiler; likewise.
        SceneError: If the scene cannot be used; likewise.
        KernelError: If a function differs from Pinocchio; likewise.
        OSError: If the folder cannot be written; likewise.
    """
    if not isinstance(out, str | Path):
        raise InvalidInput(f"out = {out!r}; the path of a folder is expected")
    folder, wanted = Path(out), chosen(terms)
    for asked, what in ((fmu, "fmu = True"), (servo, "servo = True")):
        if asked and not tick:
            raise InvalidInput(f"{what} with tick = False; allowed: {what} with the tick")
    called = None if name is None else library_name(name)
    check_folder(folder)
    model = arm_model(scene)
    called = called or from_title(_title(scene, model))
    for frame in frames if fmu else ():
        check_moving(model, frame)  # on any other no wrench acts
    with naming(scene):
        slopes = any(name in DERIVATIVES for name in wanted)
        made = tick_of(model, fmu and bool(frames), servo, slopes) if tick else None
        files = _files(model, called, wanted, made, fmu, frames)
    if made and slopes and not made.differentiable:
        _log.warning("the tick has no derivatives: its error is controlled, with tolerance = "
                     "%g; a scene with a method of fixed steps has them",
                     made.simulator.choice.tolerance)  # fmt: skip
    write_folder(folder, files)
    return Exported(folder, called, tuple(files))


def _title(scene: SceneSource | ArmModel, model: ArmModel) -> str:
    """Name of a scene file; of a robot description that of the robot."""
    given = Path(scene) if isinstance(scene, str | PathLike) and "<" not in str(scene) else None
    is_scene = given is not None and given.suffix in ("", ".yaml", ".yml")
    return given.stem if given and is_scene else model.pin.name


def _files(
    model: ArmModel,
    name: str,
    wanted: Collection[str],
    tick: Tick | None,
    fmu: bool,
    frames: Sequence[str],
) -> dict[str, str | bytes]:
    """Contents of all files of a library by name."""
    expected, points = Expected(model), test_points(model)
    terms = terms_of(model, wanted, frames)
    expected.verify(terms, points)
    made = library.Library(name, about(name, model), model, terms, tick)
    header, source = library.header(made), library.source(made)
    code = {f"{name}.h": header, f"{name}.c": source}
    return {
        **code,
        **(units(name, tick, code, frames) if fmu and tick else {}),
        f"test_{name}.c": check_program(made, expected, points),
        "CMakeLists.txt": (OWN / "CMakeLists.txt")
        .read_text(encoding="utf-8")
        .replace("@NAME@", name),
        "README.md": readme(made),
        SCENE_FILE: scene_text(model.scene, URDF_FILE),
        URDF_FILE: model.scene.robot.urdf,
    }
