# SPDX-License-Identifier: Apache-2.0
"""Positions, velocities and efforts as commands, as robots take them: a servo at every joint.

Holds what a command is, the reference that a stream of commands means, and the servo that turns it
into what the drives take. Knows models, the actuation of drives and which quantities are tunable;
nothing of who integrates.
"""

from arm_sim.servo.command import JointCommand
from arm_sim.servo.servo import Servo

__all__ = ["JointCommand", "Servo"]
