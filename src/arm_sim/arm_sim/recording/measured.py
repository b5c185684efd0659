# SPDX-License-Identifier: Apache-2.0
"""A scene for a recording without one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.arrays import read_only
from arm_dynamics.exceptions import ARM, SceneError, known_names
from arm_sim.plant.plant import Plant
from arm_sim.recording.contents import Contents
from arm_sim.recording.origin import Origin


def with_scene(contents: Contents, scene: Any) -> Contents:
    """A recording with a scene: joints in the scene's order, without others.

    Args:
        contents: A recording of a robot.
        scene: Anything ``load_scene`` accepts.

    Raises:
        SceneError: If the scene cannot be used, or the recording lacks one of its joints.
    """
    loaded = load_scene(scene)
    model = ArmModel(loaded)
    names = contents.joint_names
    if missing := [name for name in model.joint_names if name not in names]:
        raise SceneError(
            f"the recording is of another robot than the scene: it has no joint "
            f"{known_names(missing)}, but {known_names(names)}"
        )
    if contents.origin is not None:
        raise SceneError(
            "the recording contains its own scene, which cannot be replaced "
            f"({ARM} replay --scene repeats it with another one)"
        )
    order = [names.index(name) for name in model.joint_names]
    plant, rows = Plant(model), len(contents.time)
    q, v, command = (part[:, order] for part in (contents.q, contents.v, contents.command))
    z = [plant.laws.initial(*pair) for pair in zip(q, v, strict=True)] if plant.nz else []
    dt = float(np.median(np.diff(contents.time))) if rows > 1 else loaded.sim.dt
    nominal = plant.parameters.nominal
    return replace(
        contents, q=read_only(q), v=read_only(v), command=read_only(command),
        z=read_only(np.reshape(z, (rows, plant.nz))), joint_names=model.joint_names,
        p=read_only(np.tile(nominal, (rows, 1))), origin=Origin(loaded, "rk4", dt, None),
        left=(*contents.left, *(name for name in names if name not in model.joint_names)),
    )  # fmt: skip
