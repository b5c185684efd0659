# SPDX-License-Identifier: Apache-2.0
"""Bodies on rails and hinges whose motion on a table is known in closed form."""

from collections.abc import Sequence
from typing import Any

AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}


def contact(frame: str, **settings: Any) -> dict[str, Any]:
    """A contact of a frame with the plane z = 0, or another one."""
    return {"type": "contact", "frame": frame, **settings}


def rails(
    axes: str, mass: float = 1.0, turns: bool = False, friction: Any = None,
    branches: Sequence[str] = (), **inertia: float,
) -> dict[str, Any]:  # fmt: skip
    """Scene of a body on perpendicular rails, which may turn about y, named ``body``.

    Only the body has mass, so along every rail it moves as a point mass does. For branches beside
    it see ``carrier``.
    """
    joints = [(axis, "prismatic", AXES[axis]) for axis in axes]
    joints += [("turn", "continuous", AXES["y"])] if turns else []
    settings = {"joints": {"*": {"friction": friction}}} if friction else {}
    return {
        "robot": {"urdf": _robot(_chain("body", joints, mass, inertia), *branches)},
        **settings,
    }


def free_body(mass: float, moments: Any, *branches: str) -> dict[str, Any]:
    """Scene of a body on rails x, y, z that turns about its own axes: roll, pitch, yaw."""
    joints = [(axis, "prismatic", AXES[axis]) for axis in "xyz"]
    turns = zip(("roll", "pitch", "yaw"), AXES.values(), strict=True)
    joints += [(name, "continuous", axis) for name, axis in turns]
    inertia = dict(zip(("ixx", "iyy", "izz"), moments, strict=True))
    return {"robot": {"urdf": _robot(_chain("body", joints, mass, inertia), *branches)}}


def carrier(kind: str, axis: str, mass: float, **inertia: float) -> str:
    """Branch of a robot, to carry planes: a link ``tray`` on a joint ``drive``."""
    return _chain("tray", [("drive", kind, AXES[axis])], mass, inertia)


def unbalance(axis: str, mass: float, radius: float, inertia: float = 0.0) -> str:
    """Branch of a robot that has a link ``body``: a wheel ``arm`` on it, on a joint ``spin``."""
    return f"""<link name="arm"><inertial><origin xyz="{radius} 0 0"/><mass value="{mass}"/>
      <inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial>
      </link><joint name="spin" type="continuous"><parent link="body"/><child link="arm"/>
      <axis xyz="{axis}"/></joint>"""


def beside(mass: float) -> str:
    """Branch of a robot: another body, ``other``, on rails x2 and z2."""
    return _chain("other", [(f"{axis}2", "prismatic", AXES[axis]) for axis in "xz"], mass, {})


def _chain(
    body: str, joints: Sequence[tuple[str, str, str]], mass: float, inertia: dict[str, float]
) -> str:
    """Links and joints from the base to a body, the only one with mass."""
    text, parent = "", "base"
    for name, kind, axis in joints:
        child = body if name == joints[-1][0] else f"rail_{name}"
        inside = _inertial(mass, inertia) if child == body else ""
        text += f"""<link name="{child}">{inside}</link>
          <joint name="{name}" type="{kind}"><parent link="{parent}"/>
          <child link="{child}"/><axis xyz="{axis}"/>
          <limit lower="-9" upper="9" effort="1e9" velocity="1e9"/></joint>"""
        parent = child
    return text


def _robot(*chains: str) -> str:
    return f'<robot name="rails"><link name="base"/>{"".join(chains)}</robot>'


def _inertial(mass: float, inertia: dict[str, float]) -> str:
    moments = {key: inertia.get(key, 1.0) for key in ("ixx", "iyy", "izz")}
    text = " ".join(f'{key}="{value}"' for key, value in moments.items())
    return f'<inertial><mass value="{mass}"/><inertia {text} ixy="0" ixz="0" iyz="0"/></inertial>'
