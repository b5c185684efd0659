# SPDX-License-Identifier: Apache-2.0
"""Linkages of any length, and constraints as good as dependent."""

from typing import Any

from models.linkages import inline


def chain(loops: int) -> dict[str, Any]:
    """Parallelograms one on top of the other, each standing on the last one's coupler."""
    links, ties, ground = "", [], "ground"
    for i in range(loops):
        foot = "0 0 0" if i == 0 else "0.1 0 0"
        far = f"{0.4 + float(foot.split()[0])} 0 0"
        links += _rod(f"crank{i}", ground, foot, "0 0 0.15")
        links += _rod(f"coupler{i}", f"crank{i}", "0 0 0.3", "0.2 0 0")
        links += _rod(f"rocker{i}", ground, far, "0 0 0.15")
        frames = [f"coupler{i}", f"rocker{i}"]
        ties.append({"type": "point", "frames": frames, "points": [[0.4, 0, 0], [0, 0, 0.3]]})
        ground = f"coupler{i}"
    return inline(links, *ties)


def nearly_parallel(angle: float) -> dict[str, Any]:
    """A point of an arm of three joints on two planes that are ``angle`` [rad] from parallel."""
    links, ground = "", "ground"
    for name in ("upper", "lower", "hand"):
        links += _rod(name, ground, "0 0 0" if name == "upper" else "0 0 0.3", "0 0 0.15")
        ground = name
    tip = {"frames": ["hand", "world"], "points": [[0, 0, 0.3], [0.1, 0, 0.7]], "type": "plane"}
    bent = {"upper_joint": 0.4, "lower_joint": -0.9, "hand_joint": 0.8}
    planes = [{**tip, "normal": [1, 0, 0]}, {**tip, "normal": [1, 0, angle]}]
    return inline(links, *planes, initial={"position": bent})


def _rod(name: str, parent: str, foot: str, centre: str) -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="{centre}"/><mass value="1"/>'
        '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>'
        f'<joint name="{name}_joint" type="continuous"><parent link="{parent}"/>'
        f'<child link="{name}"/><origin xyz="{foot}"/><axis xyz="0 1 0"/></joint>'
    )
