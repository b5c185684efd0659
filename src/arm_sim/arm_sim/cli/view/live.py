# SPDX-License-Identifier: Apache-2.0
"""Running arms, received over ROS topics by a separate process."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import partial
from typing import Any, Self

import numpy as np
from rclpy.serialization import deserialize_message

from arm_dynamics import ArmModel, Scene, load_scene
from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import known_names
from arm_dynamics.ros.interfaces import CONTROLLER_STATE, JOINT_STATES, ROBOT_DESCRIPTION
from arm_dynamics.scene.load import scene_from_urdf
from arm_sim.cli.robot.listener import Listener
from arm_sim.exceptions import ViewError
from arm_sim.ros.interfaces import ENERGY
from arm_sim.view import News, View, show_followed

_WAIT = 5.0  # [s] for joint states and for a description


class RunningArm:
    """One running arm.

    Only the bytes of the newest joint state are kept, which arrive a thousand times a second;
    they are deserialized when a picture is drawn.

    Args:
        listener: Takes part in the ROS graph.
        namespace: Namespace of the nodes; empty for none.
    """

    def __init__(self, listener: Listener, namespace: str) -> None:
        self._listener, self.namespace = listener, namespace.strip("/")
        self.topic = self._name(JOINT_STATES.name)
        self._bytes: Any = None  # here and below: the newest message
        self._description: Any = None
        self._error: Any = None
        self._energy: Any = None
        self._model: ArmModel | None = None
        keep = partial(partial, setattr, self)
        listener.hear(JOINT_STATES, self.topic, keep("_bytes"), raw=True)
        described = self._name(ROBOT_DESCRIPTION.name)
        listener.hear(ROBOT_DESCRIPTION, described, keep("_description"))
        listener.hear(CONTROLLER_STATE, self._name("controller/state"), keep("_error"))
        listener.hear(ENERGY, self._name("sim/energy"), keep("_energy"))

    @property
    def name(self) -> str:
        """Its name on the page: its namespace, else the robot's."""
        robot = "arm" if self._model is None else self._model.pin.name
        return self.namespace.replace("/", " ") or robot

    def meet(self, scene: str | None) -> ArmModel:
        """Wait for the arm and determine its scene.

        Args:
            scene: Its scene; None for that of its robot description.

        Raises:
            ViewError: If no joint states arrive in time, or it is another robot.
        """
        if not self._listener.until(lambda: self._bytes is not None, _WAIT):
            raise ViewError(
                f"no joint states on {self.topic} (waited {_WAIT:g} s)\n  start a robot: "
                "./arm sim SCENE; --live=NAMESPACE follows one in a namespace\n  "
                f"{self._listener.where()}"
            )
        told = self._state().name
        self._model = model = ArmModel(self._scene(scene, told))
        if missing := [name for name in model.joint_names if name not in told]:
            raise ViewError(
                f"{self.topic} is of another robot than the scene: it has no joint "
                f"{known_names(missing)}, but {known_names(told)}"
            )
        return model

    def newest(self) -> News | None:
        """The newest state; None if there is nothing new since the last call."""
        assert self._model is not None
        if self._bytes is None:
            return None
        state, names = self._state(), self._model.joint_names
        self._bytes = None
        places = {name: i for i, name in enumerate(state.name)}
        if not all(name in places and places[name] < len(state.position) for name in names):
            return None
        order = [places[name] for name in names]
        now = state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec
        effort = np.asarray(state.effort)
        torque = effort[order] if len(effort) == len(state.name) else np.zeros(len(names))
        q = np.asarray(state.position)[order]
        if not np.isfinite(q).all():
            return None
        energy = self._energy
        energies = [0.0] * 5 if energy is None else [
            energy.kinetic, energy.potential, energy.total, energy.input, energy.dissipated
        ]  # fmt: skip
        return News(now, q, torque, self._errors(names), np.array(energies))

    def _errors(self, names: Sequence[str]) -> Array:
        if self._error is None:
            return np.zeros(len(names))
        told = dict(zip(self._error.joint_names, self._error.position_error, strict=False))
        return np.array([told.get(name, 0.0) for name in names])

    def _scene(self, scene: str | None, told: Sequence[str]) -> Scene:
        """Its scene; joints of the description without joint states are locked."""
        if scene is not None:
            return load_scene(scene)
        if not self._listener.until(lambda: self._description is not None, _WAIT):
            topic = self._name(ROBOT_DESCRIPTION.name)
            raise ViewError(
                f"no robot description on {topic} for the joint states on {self.topic}; name the "
                "scene: ./arm view SCENE --live"
            )
        urdf = self._description.data
        names = ArmModel(scene_from_urdf(urdf)).joint_names
        silent = [name for name in names if name not in told]
        if len(silent) == len(names):
            raise ViewError(
                f"{self.topic} is of another robot than {self._name(ROBOT_DESCRIPTION.name)}: it "
                f"has none of its joints {known_names(names)}, but {known_names(told)}"
            )
        return load_scene({"robot": {"urdf": urdf, "lock": silent}})

    def _state(self) -> Any:
        return deserialize_message(self._bytes, JOINT_STATES.type)

    def _name(self, topic: str) -> str:
        return f"/{self.namespace}/{topic}" if self.namespace else f"/{topic}"


class RunningArms:
    """Receives running arms in a thread of its own; use it in a ``with`` statement."""

    def __init__(self, namespaces: Sequence[str]) -> None:
        """Take part in the ROS graph."""
        self._listener = Listener()
        self._ended = threading.Event()
        self._thread = threading.Thread(
            target=lambda: self._listener.until(self._ended.is_set, float("inf")),
            name="arm view: topics", daemon=True,
        )  # fmt: skip
        self.arms = [RunningArm(self._listener, namespace) for namespace in namespaces]

    def __enter__(self) -> Self:
        """Use it in a ``with`` statement."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the graph."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)
        self._listener.__exit__()

    def show(self, scenes: Sequence[str], host: str, port: int | None) -> View:
        """A page that follows the arms.

        Args:
            scenes: Their scenes: one for each, one for all, or none.
            host: Address to listen on.
            port: Port.

        Raises:
            ViewError: If an arm sends no joint states, or is another robot.
        """
        if len(scenes) not in (0, 1, len(self.arms)):
            raise ViewError(
                f"{len(scenes)} scenes for {len(self.arms)} running arms; none, one or "
                f"{len(self.arms)} are expected"
            )
        chosen = [None] * len(self.arms) if not scenes else [*scenes] * len(self.arms)
        models = [arm.meet(scene) for arm, scene in zip(self.arms, chosen, strict=False)]
        self._thread.start()
        return show_followed(self.arms, [arm.name for arm in self.arms], models, host, port)
