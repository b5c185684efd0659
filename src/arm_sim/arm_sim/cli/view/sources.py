# SPDX-License-Identifier: Apache-2.0
"""Pages for the argument WHAT."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from arm_dynamics.control import GravityCompensation
from arm_sim import Recording, Simulator
from arm_sim.cli.output import checked, console
from arm_sim.exceptions import ViewError
from arm_sim.recording.files import SUFFIXES
from arm_sim.view import View, show
from arm_sim.view.view import simulator_of


def shown(
    what: Sequence[str],
    host: str,
    port: int | None,
    motion: tuple[float, str] | None = None,
    scene: str | None = None,
    topic: str | None = None,
) -> View:
    """A page of scenes, or of recordings.

    Args:
        what: Scenes or recordings.
        host: Address to listen on.
        port: Port; None for the default one or the next free one.
        motion: Shows scenes as motions, not as interactive simulations: their duration in [s], and
            what holds the arms, ``nothing`` or ``weight``.
        scene: Scene of recordings without one.
        topic: Topic of the joint states of bags with several.

    Raises:
        ArmError: If one of them cannot be used, or they are mixed.
    """
    names, folder = [Path(thing).stem for thing in what], _folder(scene or what[0])
    recorded = [thing for thing in what if _is_recording(thing)]
    things: list[Recording | Simulator]
    if recorded:
        if len(recorded) < len(what):
            other = next(thing for thing in what if thing not in recorded)
            raise ViewError(
                f"'{recorded[0]}' is a recording and '{other}' is not; allowed: several "
                "arguments of one kind"
            )
        things = [_loaded(path, scene, topic) for path in what]
    else:
        things = [simulator_of(thing) for thing in what]
        if motion:
            things = [_moved(simulator, *motion) for simulator in things]
    return show(*things, name=names, host=host, port=port, folder=folder)


def _is_recording(what: str) -> bool:
    path = Path(what)
    return path.suffix.lower() in SUFFIXES or path.is_dir()


def _loaded(path: str, scene: str | None, topic: str | None) -> Recording:
    recording = Recording.load(path, topic=topic)
    if recording.scene is None and scene is None:
        raise ViewError(f"'{path}' contains no scene, so its arm is unknown; name it by --scene")
    return recording.of(scene) if recording.scene is None else recording


def _moved(simulator: Simulator, duration: float, control: str) -> Recording:
    carried = GravityCompensation(simulator.dynamics).torque if control == "weight" else None
    motion = simulator.run(duration, control=carried)
    console().print(checked(motion), markup=False)
    return motion


def _folder(what: str) -> Path:
    """Folder of meshes with relative names: that of the file, else the current one."""
    return Path(what).parent if Path(what).is_file() else Path.cwd()
