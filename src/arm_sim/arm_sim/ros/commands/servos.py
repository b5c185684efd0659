# SPDX-License-Identifier: Apache-2.0
"""The servos of a running arm, which take a while to build."""

from arm_dynamics.ros.common.threads.background import Background
from arm_sim.simulation.simulated_arm import SimulatedArm


class Servos:
    """The servos of an arm, built when first needed, by ``background`` while the loop goes on.

    Attributes:
        in_background: Whether there is one; else the loop waits while they are built.
    """

    def __init__(self, arm: SimulatedArm, background: Background | None) -> None:
        self._arm, self._background = arm, background
        self.in_background = background is not None

    def request(self, wait: bool = False) -> bool:
        """Begin to build them unless they are there; return whether they can be used now.

        If they could not be built in the background, the next request raises the reason. With
        ``wait``, they are built at once, while time stands still.
        """
        compiled, background = self._arm.compiled, self._background
        if compiled.has_servo:
            return True
        if wait or background is None:
            _ = compiled.servo  # built on first use
            return True
        if not background.busy:
            background.start(lambda: compiled.servo, lambda result: result())
        background.deliver()  # raises why they could not be built
        return False
