# SPDX-License-Identifier: Apache-2.0
"""Plain URDF text: masses, inertias and joints, and nothing that simulators treat differently.

No meshes, no collision bodies, no limits, no friction: every simulator that reads it holds the
same differential equation.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

AXES = {"RX": (1, 0, 0), "RY": (0, 1, 0), "RZ": (0, 0, 1)}


def plain_urdf(model: pin.Model) -> str:
    """Write a Pinocchio model as URDF: fixed base, revolute joints about coordinate axes."""
    parts = [f'<?xml version="1.0"?>\n<robot name="{model.name}">', '<link name="link0"/>']
    for i in range(1, model.njoints):
        body, place = model.inertias[i], model.jointPlacements[i]
        moments = body.inertia[np.triu_indices(3)].tolist()
        parts.append(link(f"link{i}", body.mass, moments, body.lever))
        parts.append(joint(
            model.names[i], "continuous", f"link{model.parents[i]}", f"link{i}",
            AXES[model.joints[i].shortname()[-2:]], place.translation,
            pin.rpy.matrixToRpy(place.rotation),
        ))  # fmt: skip
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


def link(name: str, mass: float, inertia: Sequence[float], com: Any = (0, 0, 0)) -> str:
    """A link; moments xx, xy, xz, yy, yz, zz about its centre of mass."""
    keys = zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), inertia, strict=True)
    moments = " ".join(f'{key}="{float(x)!r}"' for key, x in keys)
    return (
        f'<link name="{name}"><inertial><origin xyz="{_triple(com)}"/>'
        f'<mass value="{float(mass)!r}"/><inertia {moments}/></inertial></link>'
    )


def joint(
    name: str, kind: str, parent: str, child: str, axis: Any, at: Any = (0, 0, 0),
    turn: Any = (0, 0, 0), lower: float = -1e9,
) -> str:  # fmt: skip
    """A joint; ``lower`` is its lower end where it has one."""
    limit = f'<limit lower="{lower!r}" upper="1e9" effort="0" velocity="0"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_triple(at)}" rpy="{_triple(turn)}"/><axis xyz="{_triple(axis)}"/>'
        f"{'' if kind == 'continuous' else limit}</joint>"
    )


def _triple(values: object) -> str:
    return " ".join(repr(float(x)) for x in np.asarray(values))
