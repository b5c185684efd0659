# SPDX-License-Identifier: Apache-2.0
"""One wheel on a vertical axis: J a + F(v) = tau, for laws of one joint."""

from typing import Any


def rotor(J: float = 0.1, effort: float = 1e9, **friction: float) -> dict[str, Any]:
    """Scene of a wheel of inertia ``J`` [kg m²] whose joint ``axle`` has the given friction."""
    urdf = f"""<robot name="rotor"><link name="base"/><link name="wheel"><inertial>
      <mass value="1"/><inertia ixx="{J}" ixy="0" ixz="0" iyy="{J}" iyz="0" izz="{J}"/>
      </inertial></link><joint name="axle" type="continuous"><parent link="base"/>
      <child link="wheel"/><axis xyz="0 0 1"/></joint></robot>"""
    joint = {"friction": friction, "limits": {"effort": effort}}
    return {"robot": {"urdf": urdf}, "joints": {"axle": joint}}
