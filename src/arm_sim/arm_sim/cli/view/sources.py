# SPDX-License-Identifier: Apache-2.0
"""Pages for the argument WHAT."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from arm_dynamics.control import GravityCompensation
from arm_sim import Recording, Simulator
from arm_sim.cli.view.wish import Wish
from arm_sim.exceptions import ViewError
from arm_sim.recording import film_of
from arm_sim.view import Film, View, show_films, show_rigs

RECORDINGS = (".mcap", ".db3", ".npz", ".csv")


def shown(what: Sequence[str], wish: Wish) -> View:
    """A page of scenes, or of recordings.

    Raises:
        ArmError: If one of them cannot be used, or they are mixed.
    """
    names, folder = [_name(thing) for thing in what], _folder(wish.scene or what[0])
    recorded = [thing for thing in what if _is_recording(thing)]
    if recorded:
        if len(recorded) < len(what):
            other = next(thing for thing in what if thing not in recorded)
            raise ViewError(
                f"'{recorded[0]}' is a recording and '{other}' is not; allowed: several "
                "arguments of one kind"
            )
        return show_films([_loaded(path, wish) for path in what], wish.host, wish.port, folder)
    simulators = [Simulator(scene) for scene in what]
    if not wish.over:
        rigs = [simulator.rig() for simulator in simulators]
        return show_rigs(rigs, names, wish.host, wish.port, folder)
    pairs = zip(simulators, names, strict=True)
    films = [_moved(*pair, wish.duration, wish.control) for pair in pairs]
    return show_films(films, wish.host, wish.port, folder)


def _is_recording(what: str) -> bool:
    path = Path(what)
    return path.suffix.lower() in RECORDINGS or path.is_dir()


def _loaded(path: str, wish: Wish) -> Film:
    recording = Recording.load(path, topic=wish.topic)
    if recording.scene is None and wish.scene is None:
        raise ViewError(f"'{path}' contains no scene, so its arm is unknown; name it by --scene")
    if recording.scene is None:
        recording = recording.of(wish.scene)
    return film_of(recording, _name(path))


def _moved(simulator: Simulator, name: str, duration: float, control: str) -> Film:
    carried = GravityCompensation(simulator.dynamics).torque if control == "weight" else None
    return film_of(simulator.run(duration, control=carried), name)


def _name(what: str) -> str:
    return Path(what).stem


def _folder(what: str) -> Path:
    """Folder of meshes with relative names: that of the file, else the current one."""
    return Path(what).parent if Path(what).is_file() else Path.cwd()
