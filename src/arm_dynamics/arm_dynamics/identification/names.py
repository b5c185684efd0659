# SPDX-License-Identifier: Apache-2.0
"""Joints of a recording under the names of a scene."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from arm_dynamics.arrays import read_only
from arm_dynamics.exceptions import InvalidInput, did_you_mean, known_names
from arm_dynamics.identification.data import JointRecord


def mapped(
    record: JointRecord, joints: Sequence[str], names: Mapping[str, str] | None = None
) -> JointRecord:
    """The joints of a scene in a recording that may call them something else.

    A joint is found under its own name, under one that ends in it or that it ends in, as with a
    prefix of the robot's, or under one that is the same but for the part before the first ``_`` or
    ``/``, as ``fer_joint1`` is ``panda_joint1``.

    Args:
        record: The recording.
        joints: Of the scene.
        names: What the recording calls them, by the scene's names, where that says it all.

    Returns:
        The recording with these joints under these names, in this order, and with a note where
        they had others.

    Raises:
        InvalidInput: If one of them is not to be found, or might be several.
    """
    given = dict(names or {})
    if unknown := [name for name in given if name not in joints]:
        raise InvalidInput(
            f"the scene has no joint '{unknown[0]}' to be called '{given[unknown[0]]}'"
            f"{did_you_mean(unknown[0], joints)}; its joints: {known_names(joints)}"
        )
    found = {joint: given.get(joint) or _found(record, joint) for joint in joints}
    if missing := [joint for joint in joints if found[joint] is None]:
        raise InvalidInput(
            f"{record.name}: it has no joint {known_names(missing)}, which the scene has, but "
            f"{known_names(record.joint_names)}; lock joints that do not move in the scene, or "
            "say what they are called"
        )
    called = [str(found[joint]) for joint in joints]
    if len(set(called)) < len(called):
        raise InvalidInput(
            f"{record.name}: two joints of the scene would be the same one of the recording: "
            f"{known_names(called)}; say which is which"
        )
    notes = record.notes
    if called != list(joints):
        notes = (*notes, f"its joints {known_names(called)} are taken for {known_names(joints)}")
    return replace(record.joints(called), joint_names=tuple(joints), notes=notes)


def _found(record: JointRecord, joint: str) -> str | None:
    if joint in record.joint_names:
        return joint
    bare = _without_prefix(joint)
    names = record.joint_names
    longer = [name for name in names if name.endswith(joint) or joint.endswith(name)]
    alike = [name for name in names if bare and _without_prefix(name) == bare]
    return next((found[0] for found in (longer, alike) if len(found) == 1), None)


def _without_prefix(name: str) -> str:
    return re.sub(r"^[^_/]*[_/]", "", name) if re.search(r"[_/]", name) else ""


def unwrapped(record: JointRecord, turning: Sequence[bool]) -> JointRecord:
    """The same where joints that turn do not jump by whole turns, as some encoders tell.

    Args:
        record: The recording.
        turning: Of each joint, whether it turns.
    """
    q = np.array(record.q)
    for column, turns in zip(q.T, turning, strict=True):
        told = np.isfinite(column)
        if turns and told.any():
            column[told] = np.unwrap(column[told])
    if np.array_equal(q, record.q, equal_nan=True):
        return record
    note = "positions that jump by whole turns are put together"
    return replace(record, q=read_only(q), notes=(*record.notes, note))
