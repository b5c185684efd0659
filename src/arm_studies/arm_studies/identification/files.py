# SPDX-License-Identifier: Apache-2.0
"""Measured motions from files."""

from __future__ import annotations

import os
from pathlib import Path

from arm_dynamics.exceptions import InvalidInput
from arm_sim.recording.recording import Recording
from arm_studies.identification.data import JointRecord


def read_joint_record(path: str | os.PathLike[str], topic: str | None = None) -> JointRecord:
    """Read a file of any kind that ``Recording.load`` opens; see there.

    Raises:
        InvalidInput: If it is not a recording, or too damaged to be used.
        OSError: If it cannot be read.
    """
    path = Path(path)
    try:
        return JointRecord.from_recording(Recording.load(path, topic=topic), path.name)
    except InvalidInput as error:
        told = str(error)
        raise InvalidInput(told if str(path) in told else f"'{path}': {told}") from None
