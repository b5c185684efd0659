# SPDX-License-Identifier: Apache-2.0
"""A pendulum whose equation of motion is written out: J q̈ = τ − m g l sin q − d q̇."""

from __future__ import annotations

import pytest


class Pendulum:
    """Its numbers in SI units."""

    mass = 2.0
    length = 0.5
    inertia = 0.1
    damping = 0.3
    about_joint = inertia + mass * length**2  # J
    weight = mass * 9.81 * length  # m g l
    urdf = f"""<robot name="pendulum">
          <link name="base"/>
          <link name="rod"><inertial>
            <origin xyz="0 0 -{length}"/><mass value="{mass}"/>
            <inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/>
          </inertial></link>
          <joint name="swing" type="continuous">
            <parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
            <dynamics damping="{damping}"/>
          </joint>
        </robot>"""


@pytest.fixture(scope="session")
def pendulum() -> Pendulum:
    """The pendulum that all tests are about."""
    return Pendulum()
