# SPDX-License-Identifier: Apache-2.0
"""The cases of the comparison: two arms, four plants, two tasks, two speeds."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics import ArmModel, Dynamics, Scene, Term, load_scene
from arm_dynamics.arrays import Array
from arm_dynamics.task_space import InverseKinematics, Pose, TaskSpace
from arm_dynamics.trajectory import (
    JointPath,
    Reference,
    Waypoint,
    joint_path,
    line,
    quintic,
    timed,
)

SCENES = Path(__file__).parents[2] / "src/arm_sim/arm_sim/scenes"
PLANTS = {
    "exact": "exact model",
    "payload": "20 % more payload",
    "friction": "unmodelled dry friction",
    "limits": "limited torque",
}
TASKS = ("regulation", "line")
PACES = ("slow", "fast")
STAY = 0.7  # [s] after the motion
JUMP = 3.0  # [s] simulated after a step of the set-point


@dataclass(frozen=True)
class Arm:
    """An arm of the comparison."""

    title: str  # its name in tables and figures
    scene: str  # its scene, by name or path
    frame: str  # frame that carries the payload and follows the line
    axes: tuple[str, ...] | str  # axes of the task
    payload: float  # mass in the hand in [kg]
    step: tuple[float, float, float]  # the line from the start in [m], shape (3,)
    speeds: tuple[float, float]  # peak speeds of the slow and the fast line in [m/s]
    coulomb: tuple[float, ...]  # dry friction of the joints in the plant with friction in [N m]

    @property
    def key(self) -> str:
        return Path(self.scene).stem

    @cached_property
    def nominal(self) -> Dynamics:
        return Dynamics(self._scene(self.payload))

    @cached_property
    def task(self) -> TaskSpace:
        return TaskSpace(self.nominal, self.frame, selection=self.axes)

    @cached_property
    def lines(self) -> dict[str, JointPath]:
        start = self.task.pose(self.nominal.model.q0)
        way = line(start, Pose(start.position + np.array(self.step), start.rotation))
        pace = dict(zip(PACES, self.speeds, strict=True))
        slow = joint_path(self.task, timed(way, pace["slow"], 10.0))
        return {"slow": slow, "fast": slow.slower(pace["slow"] / pace["fast"])}

    @cached_property
    def goal(self) -> Array:
        """Joint positions at the end of the line, which regulation goes to."""
        end = self.task.pose(self.lines["slow"].sample(1e9).q)
        return InverseKinematics(self.task).reach(end, self.lines["slow"].sample(1e9).q)

    @cached_property
    def limits(self) -> Array:
        """Torque limits that carry the arm all the way, with 60 % of what the fast line adds.

        No joint gets less than 5 % of its real limit.
        """
        fast = self.lines["fast"]
        q, v, a = fast.at(np.linspace(1e-9, 1.0 - 1e-9, 200) * fast.duration)
        way = np.linspace(self.nominal.model.q0, self.goal, 100)
        weight = abs(self.nominal.gravity(np.vstack([q, way]))).max(axis=0)
        moving = abs(self.nominal.inverse(q, v, a, Term.INERTIA | Term.CORIOLIS)).max(axis=0)
        return np.maximum(1.1 * weight + 0.6 * moving, 0.05 * self.nominal.model.effort_limit)

    def plant(self, name: str) -> ArmModel:
        if name == "payload":
            return ArmModel(self._scene(1.2 * self.payload))
        joints: dict[str, Any] = {}
        for i, joint in enumerate(self.nominal.joint_names):
            if name == "friction":
                joints[joint] = {"friction": {"coulomb": self.coulomb[i]}}
            if name == "limits":
                joints[joint] = {"limits": {"effort": float(self.limits[i])}}
        return ArmModel(self._scene(self.payload, joints))

    def motion(self, task: str, pace: str) -> tuple[Callable[[float], Reference], float]:
        """References over time, and how long to look, in [s]."""
        if task == "line":
            along = self.lines[pace]
            return along.sample, along.duration + STAY
        if pace == "fast":
            still = np.zeros(self.nominal.n)
            at_once = Reference(self.goal, still, still)
            return (lambda t: at_once), JUMP
        led = quintic([Waypoint(0.0, self.nominal.model.q0), Waypoint(1.5, self.goal)])
        return led.sample, 1.5 + STAY

    def _scene(self, payload: float, joints: dict[str, Any] | None = None) -> Scene:
        given = load_scene(self.scene).model_dump(exclude_none=True)
        for name, settings in (joints or {}).items():
            mine = given["joints"].setdefault(name, {})
            for key, values in settings.items():
                mine.setdefault(key, {}).update(values)
        given["payloads"] = [*given["payloads"], {"frame": self.frame, "mass": payload}]
        return load_scene(given)


ARMS = {
    "panda": Arm(
        "Panda", str(SCENES / "panda.yaml"), "panda_hand_tcp", "pose", 1.5,
        (0.1, 0.35, -0.15), (0.15, 0.5), (1.2, 1.2, 1.0, 1.0, 0.4, 0.4, 0.3),
    ),
    "two_link": Arm(
        "2R arm", str(SCENES / "two_link.yaml"), "tip", ("x", "z"), 0.8,
        (-0.3, 0.0, 0.35), (0.3, 1.0), (1.0, 0.4),
    ),
}  # fmt: skip
