# SPDX-License-Identifier: Apache-2.0
"""Opens pages of simulators, scenes and recordings."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_dynamics.dynamics.arm_models import arm_model
from arm_dynamics.exceptions import ModelError
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.scene import Joint
from arm_dynamics.scene.load import SceneSource
from arm_sim.exceptions import ViewError
from arm_sim.recording import Recording
from arm_sim.recording.files import SUFFIXES
from arm_sim.simulation.simulator import Simulator
from arm_sim.view.drawn_arm import DrawnArm, lay_ground
from arm_sim.view.interactive import Interactive
from arm_sim.view.interactive_arm import InteractiveArm
from arm_sim.view.page import View
from arm_sim.view.player import Player
from arm_sim.view.server import HERE, library, open_server

if TYPE_CHECKING:
    import viser

_log = logging.getLogger(__name__)
ROTOR = 1.0  # [kg m²] or [kg] at each joint of an arm that is shown though it moves no mass
GAP = 0.6  # distance between adjacent arms, relative to the reach of the larger


def show(
    *arms: Any, name: str | Sequence[str] | None = None, host: str = HERE,
    port: int | None = None, folder: Path | None = None, together: bool = False,
) -> View:  # fmt: skip
    """Show arms in a browser, side by side.

    Simulators and scenes can be run, stepped, placed, pushed and pulled. The page runs them in a
    thread of its own; in a loop of your own, do not use its buttons, and call ``draw()`` of the
    page. Recordings play, at any time and speed, with their forces.

    Args:
        *arms: Simulators or scenes (anything that ``load_scene`` accepts), or recordings or their
            files.
        name: Name of the arms on the page, or of each; None for that of the robot.
        host: Address that the page listens on.
        port: Port; None for 8080 or the next free one.
        folder: Folder of meshes with relative names.
        together: Recordings lie on top of one another, for comparison.

    Returns:
        The page, which a notebook displays; ``close()`` ends it.

    Raises:
        ViewError: If recordings and simulations are mixed, a simulator is given twice, the
            visualization library is missing, or the address cannot be used.
        InvalidInput: If a recording has no scene.
        SceneError: If a scene cannot be used.
    """
    arms = tuple(Recording.load(arm) if is_recording(arm) else arm for arm in arms)
    labels = [name] * len(arms) if name is None or isinstance(name, str) else [*name]
    moving = [isinstance(arm, Recording) for arm in arms]
    mixed = len(set(moving)) > 1
    if not arms or len(labels) != len(arms) or mixed or (together and not moving[0]):
        raise ViewError(
            f"{len(arms)} things to show with {len(labels)} names, {sum(moving)} are recordings; "
            "allowed: simulators and scenes, or recordings, which alone can lie together"
        )
    simulators = [arm for arm in arms if isinstance(arm, Simulator)]
    if len(set(map(id, simulators))) < len(simulators):
        raise ViewError("a simulator is given twice; allowed: one of its own for each arm")
    library()  # before anything is computed
    if moving[0]:
        models = [recording.dynamics.model for recording in arms]
        page: Callable[..., View] = partial(Player, recordings=arms)
    else:
        rigs = [InteractiveArm(x if isinstance(x, Simulator) else simulator_of(x)) for x in arms]
        models = [rig.simulation.model for rig in rigs]
        page = partial(Interactive, rigs=rigs)
    names = [label or model.pin.name for label, model in zip(labels, models, strict=True)]
    return open_page(page, names, models, host, port, folder, together)


def is_recording(thing: Any) -> bool:
    """Whether it is the file of a recording."""
    return isinstance(thing, str | os.PathLike) and Path(thing).suffix.lower() in SUFFIXES


def simulator_of(scene: SceneSource) -> Simulator:
    """A simulator to be shown; of an arm with a joint that moves no mass, one with rotors."""
    model = arm_model(scene)
    try:
        return Simulator(model)
    except ModelError as error:
        joints = model.scene.joints
        rotors = joints.get("*", Joint()).model_copy(update={"armature": ROTOR})
        simulator = Simulator(model.scene.model_copy(update={"joints": {**joints, "*": rotors}}))
        _log.warning(
            "%s; shown with an armature of %g at every joint, so its motion means nothing",
            error, ROTOR,
        )  # fmt: skip
        return simulator


def open_page(
    page: Callable[[viser.ViserServer, list[DrawnArm]], View], names: Sequence[str],
    models: Sequence[ArmModel], host: str, port: int | None, folder: Path | None = None,
    together: bool = False,
) -> View:  # fmt: skip
    """A page with arms side by side, the first at the left; equal names are numbered."""
    names = [
        name if list(names).count(name) == 1 else f"{name} {1 + list(names[:i]).count(name)}"
        for i, name in enumerate(names)
    ]
    sizes = np.array([model.reach for model in models])
    gaps = np.zeros(len(sizes) - 1) if together else GAP * (sizes[:-1] + sizes[1:])
    places = np.concatenate([[0.0], np.cumsum(gaps)])
    server = open_server(", ".join(names), host, port)
    actors = [
        DrawnArm(server, model, name, (0.0, places[-1] / 2 - place, 0.0), folder)
        for name, model, place in zip(names, models, places.tolist(), strict=True)
    ]
    view = page(server, actors)
    lay_ground(server, actors, float(places[-1]))
    view.start()
    return view
