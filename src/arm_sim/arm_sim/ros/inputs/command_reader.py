# SPDX-License-Identifier: Apache-2.0
"""Reads commands by joint name, with efforts clipped to their limits."""

from collections.abc import Callable
from math import copysign

from arm_dynamics import ArmModel
from arm_dynamics.arrays import any_beyond
from arm_dynamics.ros.joint_state import Clip, Expected, JointStateReader, Numbers, Read, parsed
from arm_sim.ros.commands.joint_commands import JointCommands
from arm_sim.simulation.saturation import clipping_message


class CommandReader:
    """Two readers of serialized JointStates, of which each reads some of the commands.

    Attributes:
        efforts: Reads efforts, of messages that have nothing else.
        references: Reads efforts, positions and velocities, of all others.
    """

    def __init__(
        self, model: ArmModel, joints: JointCommands, warn: Callable[[str], object]
    ) -> None:
        self._model, self._warn = model, warn
        self._limits = model.command_limit.tolist()
        names, clip = model.joint_names, Clip(self._limits, self.clip)
        efforts = Expected(names, ("effort",), partial=True)
        every = Expected(names, ("effort", "position", "velocity"), partial=True, gaps=True)
        self.efforts = JointStateReader(efforts, joints.admit, clip)
        self.references = JointStateReader(every, joints.note, clip)

    def read(self, raw: bytes) -> Read:
        """See ``JointStateReader.read``; one row of numbers, or three."""
        for reader in (self.efforts, self.references):
            if (values := reader.read_known(raw)) is not None:
                return values
        message = parsed(raw)
        reader = self.references if message.position or message.velocity else self.efforts
        return reader.read_new(message)

    def clip(self, efforts: Numbers) -> Numbers:
        """Efforts of all joints, clipped, with a warning of the first beyond its limit."""
        if not any_beyond(efforts, self._limits):
            return efforts
        pairs = list(zip(efforts, self._limits, strict=True))
        joint = next(i for i, (effort, limit) in enumerate(pairs) if abs(effort) > limit)
        self._warn(clipping_message(self._model, joint, efforts[joint]))
        return tuple(copysign(limit, x) if abs(x) > limit else x for x, limit in pairs)
