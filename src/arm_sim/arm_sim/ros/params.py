# SPDX-License-Identifier: Apache-2.0
"""Parameters of the sim node."""

from __future__ import annotations

from dataclasses import dataclass

from arm_dynamics.ros.params import SCENE, parameter
from arm_sim.ros.commands import POLICIES, ZERO


@dataclass(frozen=True)
class SimParams:
    """Parameters of the sim node."""

    scene: str = parameter("", f"{SCENE}; what is simulated")
    integrator: str = parameter("", "Integration method; empty: as the scene says")
    dt: float = parameter(0.0, "Length of a tick [s]; 0: as the scene says", low=0.0, high=1.0)
    tolerance: float = parameter(
        0.0, "Error allowed inside a tick; 0: as the scene says", low=0.0, high=1.0
    )
    realtime: bool = parameter(True, "Tick by the clock; false: only when somebody calls tick()")
    paused: bool = parameter(False, "Start paused")
    publish_every: int = parameter(1, "Ticks from joint state to joint state", low=1, high=100_000)
    publish_clock: bool = parameter(False, "Publish simulated time on clock")
    frame_id: str = parameter("", "frame_id of the joint states")
    energy_period: float = parameter(
        0.02, "Time between messages on ~/energy [s]", low=0.001, high=10.0
    )
    command_timeout: float = parameter(
        0.1,
        "Simulated time after which a command is old [s]; 0: never",
        low=0.0,
        high=3600.0,
        read_only=False,
    )
    stale_policy: str = parameter(
        ZERO,
        "What acts without a command or with an old one: zero torque, hold of the last torque, or "
        "the torque that carries the arm's weight",
        choices=POLICIES,
        read_only=False,
    )
