# SPDX-License-Identifier: Apache-2.0
"""A recording as input of an identification: measurements by joint names."""

from __future__ import annotations

import os
from pathlib import Path

from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.identification import JointRecord
from arm_sim.recording.recording import Recording


def joint_record(recording: Recording, name: str = "recording") -> JointRecord:
    """Motion and torques of a recording; see ``JointRecord.from_recording``."""
    return JointRecord.from_recording(recording, name)


def read_joint_record(path: str | os.PathLike[str], topic: str | None = None) -> JointRecord:
    """Read a file of any kind that ``Recording.load`` opens; see there.

    Raises:
        InvalidInput: If it is not a recording, or too damaged to be used.
        OSError: If it cannot be read.
    """
    path = Path(path)
    try:
        return joint_record(Recording.load(path, topic=topic), path.name)
    except InvalidInput as error:
        told = str(error)
        raise InvalidInput(told if str(path) in told else f"'{path}': {told}") from None
