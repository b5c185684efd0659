# SPDX-License-Identifier: Apache-2.0
"""The servos of an arm, compiled."""

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.kernel import Kernel
from arm_sim.plant.plant import Plant
from arm_sim.servo.command import JointCommand
from arm_sim.servo.law import servo_law
from arm_sim.servo.position_limits import PositionLimits
from arm_sim.servo.setpoints import Setpoints


class Servo:
    """Converts position and velocity commands to drive commands, at the beginning of each tick.

    Args:
        plant: The arm.
        dt: Length of a tick in [s].
        backend: As for ``Kernel``.

    Attributes:
        operations: Arithmetic operations of the law.

    Raises:
        KernelError: If compiled code is requested and unavailable.
    """

    def __init__(self, plant: Plant, dt: float, backend: str) -> None:
        kernel = Kernel([servo_law(plant, dt)], backend)
        self._call = kernel.call("servo")
        self._limits = PositionLimits(plant.model, dt)
        self._setpoints = Setpoints(plant.model.n, dt)
        self._newest: tuple[JointCommand, JointCommand] | None = None  # as sent, and as clipped
        self.operations = kernel.operations("servo")

    @property
    def at_rest(self) -> bool:
        """Whether the reference is at rest, and every joint follows it."""
        return self._setpoints.at_rest and self._setpoints.all_tracked

    def restart(self) -> None:
        """Discard earlier commands."""
        self._newest = None
        self._setpoints.restart()
        self._limits.restart()

    def command(self, command: JointCommand, x: Array, p: Array, step: int) -> Array:
        """Commands of the drives in the next tick, before limits, shape (n,).

        Args:
            command: The newest command; the same object until there is another. Its positions are
                clipped to the stops, see ``PositionLimits``.
            x: State at the beginning of the tick, shape (nx,).
            p: Tunable quantities, shape (np,).
            step: Number of ticks so far.
        """
        call, setpoints = self._call, self._setpoints
        if self._newest is None or command is not self._newest[0]:
            self._newest = command, self._limits.clip(command, x[: len(command.position)], step)
        setpoints.advance(self._newest[1], step)
        state, reference, quantities = call.inputs
        state[:], reference[:], quantities[:] = x, setpoints.rows, p
        call.run()
        return call.outputs[0]
