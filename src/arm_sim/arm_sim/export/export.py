# SPDX-License-Identifier: Apache-2.0
"""Export of a scene."""

import logging
from collections.abc import Collection, Sequence
from os import PathLike
from pathlib import Path

from arm_dynamics import ArmModel, InvalidInput
from arm_dynamics.attributes import frozen
from arm_dynamics.dynamics.arm_models import arm_model
from arm_dynamics.model.frame_motion import check_moving
from arm_dynamics.scene.load import SceneSource, naming
from arm_dynamics.scene.text import scene_text
from arm_sim.export import library
from arm_sim.export.amalgamated import OWN
from arm_sim.export.check_program import check_program
from arm_sim.export.description import about, readme
from arm_sim.export.fmu import build_fmus
from arm_sim.export.folder import check_folder, write_folder
from arm_sim.export.names import from_title, library_name
from arm_sim.export.reference_values import ReferenceResults, test_points
from arm_sim.export.terms import DERIVATIVES, TERMS, checked_names, terms_of
from arm_sim.export.tick import tick_of
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
    scene: SceneSource | ArmModel, out: str | Path, name: str | None = None,
    terms: Collection[str] = TERMS, tick: bool = True, fmu: bool = False,
    frames: Sequence[str] = (), servo: bool = False,
) -> Exported:  # fmt: skip
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
        frames: Frames whose poses and Jacobians to export, and on which wrenches may act in the
            units.
        servo: Whether to add the servos, which track positions and velocities, to the tick.

    Raises:
        InvalidInput: If an argument is not allowed; nothing is written.
        CompilerMissing: If units are requested and there is no C compiler; likewise.
        SceneError: If the scene cannot be used; likewise.
        KernelError: If a function differs from Pinocchio; likewise.
        OSError: If the folder cannot be written; likewise.
    """
    if not isinstance(out, str | Path):
        raise InvalidInput(f"out = {out!r}; the path of a folder is expected")
    folder, term_names = Path(out), checked_names(terms)
    for option, requested in (("fmu = True", fmu), ("servo = True", servo)):
        if requested and not tick:
            raise InvalidInput(f"{option} with tick = False; allowed: {option} with the tick")
    if name is not None:
        name = library_name(name)
    check_folder(folder)
    model = arm_model(scene)
    name = name or from_title(_title(scene, model))
    for frame in frames if fmu else ():
        check_moving(model, frame)  # on any other no wrench acts
    with naming(scene):
        slopes = any(term in DERIVATIVES for term in term_names)
        exported = tick_of(model, fmu and bool(frames), servo, slopes) if tick else None
        terms_in_c = terms_of(model, term_names, frames)
        lib = library.Library(name, about(name, model), model, terms_in_c, exported)
        files = _files(lib, fmu, frames)
    if exported and slopes and not exported.differentiable:
        _log.warning("the tick has no derivatives: its error is controlled, with tolerance = "
                     "%g; a scene with a method of fixed steps has them",
                     exported.simulator.choice.tolerance)  # fmt: skip
    write_folder(folder, files)
    return Exported(folder, name, tuple(files))


def _title(scene: SceneSource | ArmModel, model: ArmModel) -> str:
    """Name of a scene file; of a robot description that of the robot."""
    if isinstance(scene, str | PathLike) and "<" not in str(scene):
        path = Path(scene)
        if path.suffix in ("", ".yaml", ".yml"):
            return path.stem
    return str(model.pin.name)


def _files(lib: library.Library, fmu: bool, frames: Sequence[str]) -> dict[str, str | bytes]:
    """Contents of all files of a library by name."""
    name, model, tick = lib.name, lib.model, lib.tick
    reference, points = ReferenceResults(model), test_points(model)
    reference.verify(lib.terms, points)
    code = {f"{name}.h": library.header(lib), f"{name}.c": library.source(lib)}
    build_file = (OWN / "CMakeLists.txt").read_text(encoding="utf-8")
    return {
        **code, **(build_fmus(name, tick, code, frames) if fmu and tick else {}),
        f"test_{name}.c": check_program(lib, reference, points),
        "CMakeLists.txt": build_file.replace("@NAME@", name), "README.md": readme(lib),
        SCENE_FILE: scene_text(model.scene, URDF_FILE), URDF_FILE: model.scene.robot.urdf,
    }  # fmt: skip
