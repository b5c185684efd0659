# SPDX-License-Identifier: Apache-2.0
"""Bodies on rails and hinges whose motion on a table is known in closed form."""

from __future__ import annotations

from typing import Any

AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}


def contact(frame: str, **settings: Any) -> dict[str, Any]:
    """A contact of a frame with the plane z = 0, or another one."""
    return {"type": "contact", "frame": frame, **settings}


def rails(
    axes: str, mass: float = 1.0, turns: bool = False, friction: Any = None, **inertia: float
) -> dict[str, Any]:
    """Scene of a body on perpendicular rails, which may turn about y, named ``body``.

    Only the body has mass, so along every rail it moves as a point mass does.
    """
    links, joints, parent = '<link name="base"/>', "", "base"
    names = [*axes, *(["turn"] if turns else [])]
    for name in names:
        child = "body" if name == names[-1] else f"rail_{name}"
        links += (
            f'<link name="{child}">{_inertial(mass, inertia) if child == "body" else ""}</link>'
        )
        kind = "continuous" if name == "turn" else "prismatic"
        joints += f"""<joint name="{name}" type="{kind}"><parent link="{parent}"/>
          <child link="{child}"/><axis xyz="{AXES["y" if name == "turn" else name]}"/>
          <limit lower="-9" upper="9" effort="1e9" velocity="1e9"/></joint>"""
        parent = child
    urdf = f'<robot name="rails">{links}{joints}</robot>'
    settings = {"joints": {"*": {"friction": friction}}} if friction else {}
    return {"robot": {"urdf": urdf}, **settings}


def _inertial(mass: float, inertia: dict[str, float]) -> str:
    moments = {key: inertia.get(key, 1.0) for key in ("ixx", "iyy", "izz")}
    text = " ".join(f'{key}="{value}"' for key, value in moments.items())
    return f'<inertial><mass value="{mass}"/><inertia {text} ixy="0" ixz="0" iyz="0"/></inertial>'
