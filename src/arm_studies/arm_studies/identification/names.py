# SPDX-License-Identifier: Apache-2.0
"""Matching the joint names of a recording with those of a scene."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from arm_dynamics.arrays import read_only
from arm_dynamics.exceptions import InvalidInput, did_you_mean, known_names
from arm_dynamics.model.arm import ArmModel
from arm_studies.identification.data import JointRecord, records_of


def mapped(
    record: JointRecord, joints: Sequence[str], names: Mapping[str, str] | None = None
) -> JointRecord:
    """Select the joints of a scene from a recording that may use other names.

    A joint matches its own name, a name of which one ends in the other, as with a prefix of the
    robot, or a name that differs only before the first ``_`` or ``/``, as ``fer_joint1`` and
    ``panda_joint1``.

    Args:
        record: The recording.
        joints: Joint names of the scene.
        names: Joint names of the recording by those of the scene, where they do not match.

    Returns:
        The recording with these joints under these names, in this order, and with a note if they
        were renamed.

    Raises:
        InvalidInput: If a joint is missing or ambiguous.
    """
    names = names or {}
    if unknown := [name for name in names if name not in joints]:
        raise InvalidInput(
            f"names: '{unknown[0]}' = '{names[unknown[0]]}', but the scene has no joint "
            f"'{unknown[0]}'{did_you_mean(unknown[0], joints)}; its joints: {known_names(joints)}"
        )
    matches = {joint: names.get(joint) or _match(record, joint) for joint in joints}
    if missing := [joint for joint in joints if matches[joint] is None]:
        unused = [name for name in record.joint_names if name not in matches.values()]
        pairs = [f" --map {pair}" for pair in map("=".join, zip(missing, unused, strict=False))]
        raise InvalidInput(
            f"{record.name}: no joint matches {known_names(missing)} of the scene; it has "
            f"{known_names(record.joint_names)}: lock joints of the scene that do not move, or "
            f"map their names, such as{''.join(pairs)}"
        )
    called = [str(matches[joint]) for joint in joints]
    if len(set(called)) < len(called):
        raise InvalidInput(
            f"{record.name}: two joints of the scene match the same joint of the recording: "
            f"{known_names(called)}; map their names"
        )
    notes = record.notes
    if called != list(joints):
        notes = (*notes, f"joints {known_names(called)} are matched with {known_names(joints)}")
    return replace(record.joints(called), joint_names=tuple(joints), notes=notes)


def _match(record: JointRecord, joint: str) -> str | None:
    names = record.joint_names
    if joint in names:
        return joint
    bare = _without_prefix(joint)
    longer = [name for name in names if name.endswith(joint) or joint.endswith(name)]
    alike = [name for name in names if bare and _without_prefix(name) == bare]
    return next((only[0] for only in (longer, alike) if len(only) == 1), None)


def _without_prefix(name: str) -> str:
    return re.sub(r"^[^_/]*[_/]", "", name) if re.search(r"[_/]", name) else ""


def unwrapped(record: JointRecord, joint_types: Sequence[str]) -> JointRecord:
    """The recording without jumps by whole turns, as some encoders report them.

    Args:
        record: The recording.
        joint_types: Type of each joint, see ``ArmModel``.
    """
    q = np.array(record.q)
    for column, kind in zip(q.T, joint_types, strict=True):
        measured = np.isfinite(column)
        if kind != "prismatic" and measured.any():
            column[measured] = np.unwrap(column[measured])
    if np.array_equal(q, record.q, equal_nan=True):
        return record
    note = "positions that jump by whole turns are unwrapped"
    return replace(record, q=read_only(q), notes=(*record.notes, note))


def joint_records(
    recordings: Any, model: ArmModel, names: Mapping[str, str] | None = None
) -> list[JointRecord]:
    """The joints of an arm from one or several recordings of any kind.

    Raises:
        InvalidInput: If there is none, or it is something else, or a joint is missing.
    """
    return [
        unwrapped(mapped(record, model.joint_names, names), model.joint_types)
        for record in records_of(recordings)
    ]
