# SPDX-License-Identifier: Apache-2.0
"""A scene ready to run: equations, compiled ticks, and derived objects on demand."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from arm_dynamics import ArmModel
from arm_dynamics.codegen.one_at_a_time import built_once, one_at_a_time
from arm_sim.derivatives import Derivatives
from arm_sim.integrators.selection import Choice
from arm_sim.plant.actuation import CompiledControl
from arm_sim.plant.parameters import EXTERNAL
from arm_sim.plant.plant import Plant
from arm_sim.recording.physics import Physics
from arm_sim.simulation.plan import Plan
from arm_sim.stepping.rollouts.rollout import Rollouts
from arm_sim.stepping.stepper import Stepper
from arm_sim.stepping.trial import keeps_accuracy

if TYPE_CHECKING:
    from arm_sim.servo import Rest, Servo


class CompiledScene(Physics):
    """What is built from a plant and a choice of method; replaced as a whole if one changes.

    Args:
        plant: The equation of motion.
        choice: Method, tick and tolerance.
        backend: As for ``Kernel``.
    """

    @one_at_a_time
    def __init__(self, plant: Plant, choice: Choice, backend: str) -> None:
        super().__init__(lambda: plant, choice, backend)
        self.stepper = Stepper(plant, choice, backend)
        self._control_stepper: tuple[CompiledControl, Stepper] | None = None

    @classmethod
    def choose(cls, plant: Plant, choice: Choice, backend: str) -> CompiledScene:
        """Compile for a choice, or for its ``instead`` where fixed steps are too inaccurate."""
        compiled = cls(plant, choice, backend)
        if choice.instead is None or keeps_accuracy(plant, compiled.stepper, choice):
            return compiled
        return cls(plant, choice.instead, backend)

    def with_external_torques(self) -> CompiledScene:
        """Copy with external joint torques, the quantity ``external``.

        Scenes without them compute nothing for them; the equations are rebuilt here.
        """
        scene = self.plant.model.scene
        if EXTERNAL in scene.tunable:
            return self
        model = ArmModel(scene.model_copy(update={"tunable": (*scene.tunable, EXTERNAL)}))
        return CompiledScene(Plant(model), self.choice, self.backend)

    def restart(self) -> None:
        """Reset the state of the stepper."""
        self.stepper.restart()
        self._control_stepper = None
        if self.has_servo:
            self.servo.restart()

    def stepper_with(self, control: CompiledControl) -> Stepper:
        """The stepper that has ``control`` compiled in; the last one is kept."""
        if self._control_stepper is None or self._control_stepper[0] is not control:
            stepper = Stepper(self.plant, self.choice, self.backend, control)
            stepper.report = self.stepper.report
            self._control_stepper = control, stepper
        self._control_stepper[1].p[:] = self.stepper.p
        return self._control_stepper[1]

    @property
    def has_servo(self) -> bool:
        """Whether ``servo`` is built already."""
        return "servo" in vars(self)

    @built_once
    def servo(self) -> Servo:
        """The servos, for position and velocity commands; built on first use."""
        from arm_sim.servo import Servo

        return Servo(self.plant, self.choice.dt, self.backend)

    @built_once
    def rest(self) -> Rest:
        """Whether the servos hold the arm at rest."""
        from arm_sim.servo import Rest

        return Rest(self.plant, self.choice.dt)

    @built_once
    def plan(self) -> Plan:
        """The parts that a tick computes and skips, with reasons."""
        return Plan(self.plant, self.choice, self.stepper)

    @built_once
    def rollouts(self) -> Rollouts:
        """Many arms at once."""
        return Rollouts(self.plant, self.choice, self.stepper, self.backend)

    @cached_property
    def derivatives(self) -> Derivatives:
        """Derivatives of ticks and rollouts."""
        return Derivatives(self.plant, self.choice, self.stepper, self.backend)
