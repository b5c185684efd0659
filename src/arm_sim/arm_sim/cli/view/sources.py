# SPDX-License-Identifier: Apache-2.0
"""Pages for the argument WHAT."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from arm_dynamics.control import GravityCompensation
from arm_sim import Recording, Simulator
from arm_sim.cli.output import checked, console
from arm_sim.exceptions import ViewError
from arm_sim.view import View, show
from arm_sim.view.view import is_recording, simulator_of


def shown(
    what: Sequence[str], host: str, port: int | None, motion: tuple[float, str] | None = None,
    scene: str | None = None, topic: str | None = None,
) -> View:  # fmt: skip
    """A page of scenes, or of recordings; ``motion`` moves scenes for so many [s], held so."""
    known = scene or what[0]  # meshes with relative names are in the folder of its file
    folder = Path(known).parent if Path(known).is_file() else Path.cwd()
    recorded = [thing for thing in what if is_recording(thing) or Path(thing).is_dir()]
    things: list[Recording | Simulator] = []
    if recorded and len(recorded) < len(what):
        other = next(thing for thing in what if thing not in recorded)
        raise ViewError(
            f"'{recorded[0]}' is a recording and '{other}' is not; allowed: several arguments of "
            "one kind"
        )
    for thing in what:
        if recorded:
            recording = Recording.load(thing, topic=topic)
            if recording.scene is None and scene is None:
                raise ViewError(
                    f"'{thing}' contains no scene, so its arm is unknown; name it by --scene"
                )
            things.append(recording.of(scene) if recording.scene is None else recording)
        elif motion:
            things.append(_moved(simulator_of(thing), *motion))
        else:
            things.append(simulator_of(thing))
    names = [Path(thing).stem for thing in what]
    return show(*things, name=names, host=host, port=port, folder=folder)


def _moved(simulator: Simulator, duration: float, control: str) -> Recording:
    carried = GravityCompensation(simulator.dynamics).torque if control == "weight" else None
    motion = simulator.run(duration, control=carried)
    console().print(checked(motion), markup=False)
    return motion
