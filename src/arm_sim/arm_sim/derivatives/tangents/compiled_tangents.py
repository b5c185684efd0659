# SPDX-License-Identifier: Apache-2.0
"""Compiled derivatives of the ticks of a scene, of those kinds that it has."""

from collections.abc import Sequence
from functools import cached_property

from arm_dynamics.codegen.one_at_a_time import built_once
from arm_sim.derivatives.tangents.tangents import Tangents
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.stepping.arm_table import Engine
from arm_sim.stepping.rollouts.equal_steps import takes_equal_steps
from arm_sim.stepping.rollouts.lane_widths import natural_width
from arm_sim.stepping.stepper import Stepper


class CompiledTangents:
    """Compiled derivatives of a scene's ticks; built when they are first used.

    Args:
        plant: The scene's equations.
        choice: Method, tick and tolerance.
        stepper: Runs its ticks and determines the modes of joints and contacts.
        backend: As for ``Kernel``.
        p_indices: Indices in p of the quantities to differentiate by.

    Attributes:
        eventful: Whether ticks may have events.
    """

    def __init__(
        self, plant: Plant, choice: Choice, stepper: Stepper, backend: str,
        p_indices: Sequence[int],
    ) -> None:  # fmt: skip
        self._plant, self._choice, self._stepper = plant, choice, stepper
        self._backend, self._p_indices = backend, p_indices
        self.eventful = plant.eventful and stepper.kernel.native

    @cached_property
    def engine(self) -> Engine | None:
        """What finds the modes of ticks of fixed length in a scene with events."""
        fixed_steps = self._choice.tolerance is None
        return Engine.of(self._stepper) if self.eventful and fixed_steps else None

    @cached_property
    def smooth_ticks(self) -> Tangents | None:
        """Code for ticks that meet neither stops nor events; None if there is none."""
        return self._free_tangents if self._has_lanes else self.event_free

    @cached_property
    def event_free(self) -> Tangents | None:
        """Code for ticks without events of a scene with events."""
        compiled = self.engine is not None and self._backend != "vm" and self.of_scene.native
        return self.of_scene if compiled else None

    @built_once
    def of_scene(self) -> Tangents:
        """Derivatives of all steps of the scene, in modes that are arguments."""
        return Tangents(self._plant, self._choice, self._backend, self._p_indices, self.engine)

    def prepare(self) -> None:
        """Compile what ticks without events need, unless that is done."""
        if self._has_lanes:
            self._free_tangents.library(natural_width())
        (self.smooth_ticks or self._free_tangents).library(1)

    @cached_property
    def _has_lanes(self) -> bool:
        """Whether arms away from their stops are differentiated side by side."""
        return takes_equal_steps(self._plant, self._choice) and self._free_tangents.native

    @cached_property
    def _free_tangents(self) -> Tangents:
        """Derivatives of ticks and steps of the arm away from its stops."""
        if self._plant.free is None:
            return self.of_scene
        return Tangents(self._plant.free, self._choice, self._backend, self._p_indices)
