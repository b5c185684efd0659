# SPDX-License-Identifier: Apache-2.0
"""Running arms, received over ROS topics by a separate process, and their page."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from rclpy.serialization import deserialize_message

from arm_dynamics import ArmModel, Scene, load_scene
from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed
from arm_dynamics.exceptions import known_names
from arm_dynamics.ros.interfaces import CONTROLLER_STATE, JOINT_STATES, ROBOT_DESCRIPTION
from arm_dynamics.scene.load import scene_from_urdf
from arm_sim.cli.robot.listener import Listener
from arm_sim.exceptions import ViewError
from arm_sim.ros.interfaces import ENERGY
from arm_sim.view import View
from arm_sim.view.charts import RollingCharts, Sample
from arm_sim.view.drawn_arm import DrawnArm
from arm_sim.view.marks import Instant
from arm_sim.view.view import open_page

if TYPE_CHECKING:
    import viser

# Fields of energies in messages by their names in the plot
ENERGIES = {"kinetic": "kinetic", "potential": "potential", "total": "total", "supplied": "input",
            "dissipated": "dissipated"}  # fmt: skip
MEMORY, SAMPLE_PERIOD = 20.0, 0.05  # [s] that curves go back, and between their points
CHART_PERIOD = 0.5  # [s] between drawings of curves
LISTENING_TIME = 0.01  # [s] of listening before each picture
SILENCE = 0.5  # [s] without data after which an arm is reported as silent
_CONTROL, _ENERGY = "controller/state", "sim/energy"
_WAIT = 5.0  # [s] for joint states and for a description


class RunningArm:
    """One running arm.

    Of joint states, which arrive a thousand times a second, the newest is kept as bytes, which
    are deserialized when a picture is drawn; of other topics the newest message.
    """

    def __init__(self, listener: Listener, namespace: str) -> None:
        self._listener, self.namespace = listener, namespace.strip("/")
        self.topic = self._name(JOINT_STATES.name)
        self._newest = dict[str, Any]()  # message by topic
        self._model: ArmModel | None = None
        for topic, name in (
            (JOINT_STATES, JOINT_STATES.name), (ROBOT_DESCRIPTION, ROBOT_DESCRIPTION.name),
            (CONTROLLER_STATE, _CONTROL), (ENERGY, _ENERGY),
        ):  # fmt: skip
            keep = partial(self._newest.__setitem__, name)
            listener.subscribe(topic, self._name(name), keep, raw=topic is JOINT_STATES)

    @property
    def name(self) -> str:
        """Its name on the page: its namespace, else the robot's."""
        robot = "arm" if self._model is None else self._model.pin.name
        return self.namespace.replace("/", " ") or robot

    def connect(self, scene: str | None) -> ArmModel:
        """Wait for the arm; its scene is that of its robot description unless one is named.

        Raises:
            ViewError: If no joint states arrive in time, or it is another robot.
        """
        if not self._arrives(JOINT_STATES.name):
            raise ViewError(
                f"no joint states on {self.topic} (waited {_WAIT:g} s)\n  start a robot: "
                "./arm sim SCENE; --live=NAMESPACE follows one in a namespace\n  "
                f"{self._listener.where()}"
            )
        names = deserialize_message(self._newest[JOINT_STATES.name], JOINT_STATES.type).name
        self._model = model = ArmModel(self._scene(scene, names))
        if missing := [name for name in model.joint_names if name not in names]:
            raise ViewError(
                f"{self.topic} is of another robot than the scene: it has no joint "
                f"{known_names(missing)}, but {known_names(names)}"
            )
        return model

    def newest(self) -> tuple[float, Array, Sample] | None:
        """Time in [s], positions and sample of a state that is new since the last call, if any."""
        assert self._model is not None
        if (data := self._newest.pop(JOINT_STATES.name, None)) is None:
            return None
        state = deserialize_message(data, JOINT_STATES.type)

        def of_joints(names: Sequence[str], values: Sequence[float]) -> Array:
            by_name = dict(zip(names, values, strict=False))
            return np.array([by_name.get(name, np.nan) for name in self._model.joint_names])

        q = of_joints(state.name, state.position)
        if not np.isfinite(q).all():
            return None
        complete = len(state.effort) == len(state.name)
        torque = of_joints(state.name, state.effort if complete else ())
        control, energy = self._newest.get(_CONTROL), self._newest.get(_ENERGY)
        error = of_joints(control.joint_names, control.position_error) if control else np.nan * q
        energies = np.array([getattr(energy, field, np.nan) for field in ENERGIES.values()])
        now = state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec
        return now, q, Sample(torque, error, energies)

    def _scene(self, scene: str | None, published: Sequence[str]) -> Scene:
        """Its scene; joints of the description without joint states are locked."""
        if scene is not None:
            return load_scene(scene)
        topic = self._name(ROBOT_DESCRIPTION.name)
        if not self._arrives(ROBOT_DESCRIPTION.name):
            raise ViewError(
                f"no robot description on {topic} for the joint states on {self.topic}; name the "
                "scene: ./arm view SCENE --live"
            )
        urdf = self._newest[ROBOT_DESCRIPTION.name].data
        names = ArmModel(scene_from_urdf(urdf)).joint_names
        silent = [name for name in names if name not in published]
        if len(silent) == len(names):
            raise ViewError(
                f"{self.topic} is of another robot than {topic}: it has none of its joints "
                f"{known_names(names)}, but {known_names(published)}"
            )
        return load_scene({"robot": {"urdf": urdf, "lock": silent}})

    def _arrives(self, topic: str) -> bool:
        return self._listener.until(lambda: topic in self._newest, _WAIT)

    def _name(self, topic: str) -> str:
        return f"/{self.namespace}/{topic}" if self.namespace else f"/{topic}"


@dataclass
class _FollowedArm:
    """An arm on the page; times in [s]."""

    arm: RunningArm
    actor: DrawnArm
    begin: float = np.nan  # stamp of its first state, also after a restart
    time: float = 0.0  # since then
    received: float = -np.inf  # by the clock of this process


@sealed
class Follower(View):
    """A page that follows running arms; times count from the first data, or from a restart."""

    def __init__(
        self, server: viser.ViserServer, actors: Sequence[DrawnArm], arms: Sequence[RunningArm],
        listener: Listener,
    ) -> None:  # fmt: skip
        super().__init__(server, actors)
        self._listener = listener
        self._status = server.gui.add_markdown("waiting")
        clear = server.gui.add_button("Clear path")
        clear.on_click(lambda _: self._order(lambda: [x.clear_path() for x in self.actors]))
        for actor in actors:
            actor.draw(Instant(actor.marker.model.q0))
        joints = {actor.name: actor.marker.model.joint_names for actor in actors}
        self._charts = RollingCharts(server, joints, tuple(ENERGIES), MEMORY, SAMPLE_PERIOD)
        self._followed = [_FollowedArm(*pair) for pair in zip(arms, actors, strict=True)]

    def _update(self, passed: float) -> None:
        self._listener.until(self._ended.is_set, LISTENING_TIME)
        for followed in self._followed:
            if (newest := followed.arm.newest()) is None:
                continue
            (stamp, q, sample), actor = newest, followed.actor
            if not stamp - followed.begin >= followed.time:  # it has begun, perhaps again
                followed.begin = stamp
                self._charts.clear(actor.name)
                actor.clear_path()
            followed.time, followed.received = stamp - followed.begin, time.monotonic()
            with self._server.atomic():
                actor.draw(Instant(q), leave_path=True)
            self._charts.add(actor.name, followed.time, lambda sample=sample: sample)
        if self._charts.draw(CHART_PERIOD):
            self._report("")

    def _report(self, trouble: str) -> None:
        lines = []
        for followed in self._followed:
            silence, state = time.monotonic() - followed.received, ""
            if np.isinf(silence):
                state = ", no data yet"
            elif silence > SILENCE:
                state = f", silent for {silence:.0f} s"
            lines.append(f"{followed.actor.name}: t = {followed.time:.2f} s{state}")
        self._status.content = "\n\n".join([*lines, *([f"**{trouble}**"] if trouble else [])])


def follower_page(
    listener: Listener, namespaces: Sequence[str], scenes: Sequence[str], host: str,
    port: int | None,
) -> View:  # fmt: skip
    """A page that follows the arms in namespaces, with scenes for each, one for all, or none."""
    if len(scenes) not in (0, 1, len(namespaces)):
        raise ViewError(
            f"{len(scenes)} scenes for {len(namespaces)} running arms; none, one or "
            f"{len(namespaces)} are expected"
        )
    arms = [RunningArm(listener, namespace) for namespace in namespaces]
    of_each = [*scenes] * len(arms) if scenes else [None] * len(arms)
    models = [arm.connect(scene) for arm, scene in zip(arms, of_each, strict=False)]
    page = partial(Follower, arms=arms, listener=listener)
    return open_page(page, [arm.name for arm in arms], models, host, port)
