# SPDX-License-Identifier: Apache-2.0
"""A pendulum whose equation of motion is written out: J q̈ = τ − m g l sin q − d q̇."""

from __future__ import annotations

from dataclasses import dataclass

import pytest


@dataclass(frozen=True)
class Pendulum:
    """Its numbers in SI units."""

    mass: float = 2.0
    length: float = 0.5
    inertia: float = 0.1
    damping: float = 0.3

    @property
    def about_joint(self) -> float:
        """J."""
        return self.inertia + self.mass * self.length**2

    @property
    def weight(self) -> float:
        """m g l."""
        return self.mass * 9.81 * self.length

    @property
    def urdf(self) -> str:
        """Its description."""
        return f"""<robot name="pendulum">
          <link name="base"/>
          <link name="rod"><inertial>
            <origin xyz="0 0 -{self.length}"/><mass value="{self.mass}"/>
            <inertia ixx="{self.inertia}" ixy="0" ixz="0" iyy="{self.inertia}" iyz="0"
                     izz="{self.inertia}"/>
          </inertial></link>
          <joint name="swing" type="continuous">
            <parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
            <dynamics damping="{self.damping}"/>
          </joint>
        </robot>"""


@pytest.fixture(scope="session")
def pendulum() -> Pendulum:
    """The pendulum that all tests are about."""
    return Pendulum()
