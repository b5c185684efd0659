# SPDX-License-Identifier: Apache-2.0
"""Reads commands by joint name: efforts alone, or efforts, positions and velocities."""

from __future__ import annotations

from arm_dynamics.ros.joint_state import JointStateReader, Read, parsed


class CommandReader:
    """Two readers of serialized JointStates, of which each reads some of the commands.

    Attributes:
        efforts: Reads efforts, of messages that have nothing else.
        references: Reads efforts, positions and velocities, of all others.
    """

    def __init__(self, efforts: JointStateReader, references: JointStateReader) -> None:
        self.efforts, self.references = efforts, references

    def read(self, raw: bytes) -> Read:
        """See ``JointStateReader.read``; one row of numbers, or three."""
        for reader in (self.efforts, self.references):
            if (values := reader.read_known(raw)) is not None:
                return values
        message = parsed(raw)
        reader = self.references if message.position or message.velocity else self.efforts
        return reader.read_new(message)
