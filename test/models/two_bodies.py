# SPDX-License-Identifier: Apache-2.0
"""The two-link arm of lecture notes, in the vertical plane, with bodies as the notes have them."""


def two_bodies(
    length: float,
    masses: tuple[float, float],
    centres: tuple[float, float],
    moments: tuple[float, float] = (0.0, 0.0),
) -> str:
    """Its URDF, with a frame ``tip`` at the centre of mass of the lower body."""
    upper, lower = (
        f'<link name="{name}"><inertial><origin xyz="{c} 0 0"/><mass value="{m}"/>'
        f'<inertia ixx="{moment}" ixy="0" ixz="0" iyy="{moment}" iyz="0" izz="0"/>'
        "</inertial></link>"
        for name, m, c, moment in zip(("upper", "lower"), masses, centres, moments, strict=True)
    )
    return f"""<robot name="two_bodies"><link name="base"/>{upper}{lower}
  <joint name="shoulder" type="continuous">
    <parent link="base"/><child link="upper"/><axis xyz="0 -1 0"/></joint>
  <joint name="elbow" type="continuous">
    <origin xyz="{length} 0 0"/><parent link="upper"/><child link="lower"/><axis xyz="0 -1 0"/>
  </joint>
  <joint name="mount" type="fixed"><origin xyz="{centres[1]} 0 0"/><parent link="lower"/>
    <child link="tip"/></joint><link name="tip"/></robot>"""
