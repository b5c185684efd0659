# SPDX-License-Identifier: Apache-2.0
"""Reads commands by joint name, with efforts clipped to their limits."""

from collections.abc import Callable
from math import copysign

from arm_dynamics import ArmModel
from arm_dynamics.arrays import any_beyond
from arm_dynamics.ros.joint_state import Clip, JointStateFormat, JointStateReader, Numbers, parsed
from arm_sim.ros.commands.arbiter import Arbiter
from arm_sim.ros.commands.joint_commands import JointMessage
from arm_sim.simulation.saturation import clipping_message


class CommandReader:
    """Two readers of serialized JointStates, of which each reads some of the commands.

    Attributes:
        efforts: Reads efforts, of messages that have nothing else.
        references: Reads efforts, positions and velocities, of all others.
    """

    def __init__(self, model: ArmModel, arbiter: Arbiter, warn: Callable[[str], object]) -> None:
        self._model, self._arbiter, self._warn = model, arbiter, warn
        self._source, self._joints = "", frozenset[int]()
        self._limits = model.command_limit.tolist()
        names, clip = model.joint_names, Clip(self._limits, self.clip)
        efforts = JointStateFormat(names, ("effort",), may_lack_joints=True)
        fields = ("effort", "position", "velocity")
        references = JointStateFormat(names, fields, may_lack_joints=True, may_have_gaps=True)
        self.efforts = JointStateReader(efforts, self._admit, clip)
        self.references = JointStateReader(references, self._note, clip)

    def read(self, raw: bytes) -> JointMessage:
        """The content of a serialized JointState.

        Raises:
            InvalidInput: See ``JointStateReader.read``; also if the source of efforts may not
                command these joints.
        """
        for reader in (self.efforts, self.references):
            if (values := reader.read_known(raw)) is not None:
                break
        else:
            message = parsed(raw)
            reader = self.references if message.position or message.velocity else self.efforts
            values = reader.read_new(message)
        return JointMessage(*values, self._source, self._joints)

    def _note(self, source: str, joints: frozenset[int]) -> None:
        """Note whose message is being read, and which joints it names."""
        self._source, self._joints = source, joints

    def _admit(self, source: str, joints: frozenset[int]) -> None:
        self._arbiter.admit(source, joints)
        self._note(source, joints)

    def clip(self, efforts: Numbers) -> Numbers:
        """Efforts of all joints, clipped, with a warning of the first beyond its limit."""
        if not any_beyond(efforts, self._limits):
            return efforts
        pairs = list(zip(efforts, self._limits, strict=True))
        joint = next(i for i, (effort, limit) in enumerate(pairs) if abs(effort) > limit)
        self._warn(clipping_message(self._model, joint, efforts[joint]))
        return tuple(copysign(limit, x) if abs(x) > limit else x for x, limit in pairs)
