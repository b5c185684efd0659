# SPDX-License-Identifier: Apache-2.0
"""Commands by position, velocity and effort: a servo at every joint.

Contains the command, the reference that follows from a stream of commands, and the servo that
computes the commands of the drives. Depends on models, the actuation of drives and the tunable
quantities; not on integration. Names are imported when they are first used.
"""

from typing import TYPE_CHECKING

from arm_dynamics.lazy import on_demand

if TYPE_CHECKING:
    from arm_sim.servo.command import JointCommand
    from arm_sim.servo.rest import Balance, Rest
    from arm_sim.servo.servo import Servo

__all__ = ["Balance", "JointCommand", "Rest", "Servo"]
__getattr__, __dir__ = on_demand(__name__, __file__)
