# SPDX-License-Identifier: Apache-2.0
"""Plain URDF text: masses, inertias and joints, and nothing that simulators treat differently.

No meshes, no collision bodies, no limits, no friction: every simulator that reads it holds the
same differential equation.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pinocchio as pin

AXES = {"RX": (1, 0, 0), "RY": (0, 1, 0), "RZ": (0, 0, 1)}


@contextmanager
def in_file(urdf: str) -> Iterator[str]:
    """The path of a temporary file with this text, for readers that want a file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(urdf)
        yield str(path)


def plain_urdf(model: pin.Model) -> str:
    """Write a Pinocchio model as URDF: fixed base, revolute joints about coordinate axes."""
    parts = [f'<?xml version="1.0"?>\n<robot name="{model.name}">', '<link name="link0"/>']
    for i in range(1, model.njoints):
        parts += [_link(i, model.inertias[i]), _joint(model, i)]
    return "\n".join([*parts, "</robot>\n"])


def single_coordinate(urdf: str) -> str:
    """The same robot for readers that give a joint without limits two coordinates."""
    limit = '<limit lower="-1e9" upper="1e9" effort="1e9" velocity="1e9"/></joint>'
    return urdf.replace('type="continuous"', 'type="revolute"').replace("</joint>", limit)


def chain_urdf(links: int, length: float = 0.2, mass: float = 1.0, radius: float = 0.03) -> str:
    """A hanging chain of equal rods, whose joint axes alternate by 90°."""
    rod = pin.Inertia.FromCylinder(mass, radius, length)
    body = pin.Inertia(mass, np.array([0.0, 0.0, -length / 2]), rod.inertia)
    model = pin.Model()
    model.name = f"chain{links}"
    for i in range(links):
        joint = pin.JointModelRX() if i % 2 else pin.JointModelRY()
        offset = pin.SE3(np.eye(3), np.array([0.0, 0.0, -length if i else 0.0]))
        index = model.addJoint(i, joint, offset, f"joint{i + 1}")
        model.appendBodyToJoint(index, body, pin.SE3.Identity())
    return plain_urdf(model)


def _link(i: int, inertia: pin.Inertia) -> str:
    m = inertia.inertia
    com = _triple(inertia.lever)
    return (
        f'<link name="link{i}"><inertial><origin xyz="{com}" rpy="0 0 0"/>'
        f'<mass value="{float(inertia.mass)!r}"/>'
        f'<inertia ixx="{float(m[0, 0])!r}" ixy="{float(m[0, 1])!r}" ixz="{float(m[0, 2])!r}" '
        f'iyy="{float(m[1, 1])!r}" iyz="{float(m[1, 2])!r}" izz="{float(m[2, 2])!r}"/>'
        "</inertial></link>"
    )


def _joint(model: pin.Model, i: int) -> str:
    place = model.jointPlacements[i]
    axis = AXES[model.joints[i].shortname()[-2:]]
    return (
        f'<joint name="{model.names[i]}" type="continuous">'
        f'<parent link="link{model.parents[i]}"/><child link="link{i}"/>'
        f'<origin xyz="{_triple(place.translation)}" '
        f'rpy="{_triple(pin.rpy.matrixToRpy(place.rotation))}"/>'
        f'<axis xyz="{_triple(axis)}"/></joint>'
    )


def _triple(values: object) -> str:
    return " ".join(repr(float(x)) for x in np.asarray(values))
