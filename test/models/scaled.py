# SPDX-License-Identifier: Apache-2.0
"""The same arm, larger or smaller and heavier or lighter, whose motions are similar.

Under the same gravity, lengths L and masses M times as large make torques M L, forces M and rates
1/√L times as large (Buckingham's theorem). By powers of two, with L one of four, floating-point
numbers change their exponents only, so results are similar to the last bit unless an absolute
number is compared with them.
"""

from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import numpy as np

from arm_dynamics import ArmModel, Scene
from arm_dynamics.scene.urdf.xml import xml_root


@dataclass(frozen=True)
class Scale:
    """Factors of lengths and masses."""

    length: float
    mass: float

    @property
    def rate(self) -> float:
        """Factor of angular velocities; its inverse is that of times."""
        return float(self.length**-0.5)

    def positions(self, model: ArmModel) -> np.ndarray:
        """Factor of each joint's position."""
        return np.where(slides(model), self.length, 1.0)

    def torques(self, model: ArmModel) -> np.ndarray:
        """Factor of each joint's torque or force."""
        return np.where(slides(model), self.mass, self.mass * self.length)

    def scene(self, scene: Scene) -> dict[str, Any]:
        """The scaled scene; its joints may have no entries, its constraints no heights."""
        content = scene.model_dump(exclude_unset=True, mode="json")
        root = xml_root(scene.robot.urdf)
        for link in root.findall("link"):
            self._scale_link(link)
        kinds = {joint.get("name"): joint.get("type") for joint in root.findall("joint")}
        for joint in root.findall("joint"):
            self._scale_joint(joint)
        content["robot"]["urdf"] = ElementTree.tostring(root, encoding="unicode")
        far = {name: self.length if kind == "prismatic" else 1.0 for name, kind in kinds.items()}
        initial = content.get("initial", {})
        for key, rate in (("position", 1.0), ("velocity", self.rate)):
            for name, value in initial.get(key, {}).items():
                initial[key][name] = value * rate * far[name]
        for tie in content.get("constraints", []):
            tie["points"] = (self.length * np.array(tie["points"])).tolist()
        return content

    def _scale_link(self, link: ElementTree.Element) -> None:
        for inertial in link.findall("inertial"):
            for part in inertial:
                factor = {"mass": self.mass, "inertia": self.mass * self.length**2}.get(part.tag)
                scale(part, *([] if factor is None else part.keys()), by=factor or 1.0)
                scale(part, "xyz", by=self.length)

    def _scale_joint(self, joint: ElementTree.Element) -> None:
        far, torque = 1.0, self.mass * self.length
        if joint.get("type") == "prismatic":
            far, torque = self.length, self.mass
        for part in joint:
            if part.tag == "origin":
                scale(part, "xyz", by=self.length)
            scale(part, "lower", "upper", by=far)
            scale(part, "velocity", by=far * self.rate)
            scale(part, "effort", "friction", by=torque)
            scale(part, "damping", by=torque / (far * self.rate))


def slides(model: ArmModel) -> np.ndarray:
    return np.array([kind == "prismatic" for kind in model.joint_types])


def scale(part: ElementTree.Element, *keys: str, by: float) -> None:
    """Multiply the numbers of some attributes of an element."""
    for key in keys:
        if key in part.keys():
            numbers = [by * float(word) for word in part.get(key, "").split()]
            part.set(key, " ".join(map(repr, numbers)))
