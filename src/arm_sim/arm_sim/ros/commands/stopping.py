# SPDX-License-Identifier: Apache-2.0
"""Stopping and holding an arm without commands."""

from arm_sim.ros.commands.latest import BRAKE
from arm_sim.ros.commands.servos import Servos
from arm_sim.servo import JointCommand
from arm_sim.simulation.simulated_arm import SimulatedArm

SLOW = 1e-3  # [rad/s] or [m/s], below which joints are held at once
LONGEST = 1.0  # [s] of a stop by the servos; after it brakes hold all joints


class Stopping:
    """Stops the arm by its servos, as a robot does on a stop of category 1, and then holds it.

    IEC 60204-1, section 9.2.2: a controlled stop, with power to the drives until it is achieved.
    The servos take all velocities to zero within the limits of the drives, so contacts, loops and
    flexible transmissions are simulated as in any motion. When all joints are slower than
    ``SLOW``, or after ``LONGEST``, brakes hold the joints, and the drives are off; with the policy
    servo they stay on. Without servos (they take a moment to build) brakes hold immediately.

    Attributes:
        is_active: Whether the arm is being stopped or held.
        is_locked: Whether brakes have closed.
        servos: What stops the arm, and holds it with the policy ``servo``.
    """

    def __init__(self, arm: SimulatedArm, servos: Servos) -> None:
        self._arm, self.servos = arm, servos
        self._zero_velocity = JointCommand(velocity=[0.0] * arm.n)
        self._hold_command: JointCommand | None = None
        self._first_step: int | None = None
        self.is_active, self._is_holding, self.is_locked = True, True, False

    def release(self) -> None:
        """Release the arm for a command."""
        self.is_active = self._is_holding = self.is_locked = False
        self._first_step = self._hold_command = None

    def hold(self) -> None:
        """Hold the arm at its position from now on."""
        self.is_active = self._is_holding = True
        self.is_locked, self._hold_command = False, None

    def stop(self, policy: str) -> JointCommand | None:
        """Stop or hold the arm in the next tick; return the servos' command, None for brakes."""
        self.is_active = True
        if not self._is_holding:
            arm = self._arm
            self._first_step = arm.step_count if self._first_step is None else self._first_step
            duration = (arm.step_count - self._first_step) * arm.dt
            speed = abs(arm.x[arm.n : 2 * arm.n]).max()
            if speed > SLOW and duration < LONGEST and self.servos.request():
                return self._zero_velocity
            self.hold()
        if policy == BRAKE or not self.servos.request():
            return None
        if self._hold_command is None:
            self._hold_command = JointCommand(position=self._arm.x[: self._arm.n])
        return self._hold_command
