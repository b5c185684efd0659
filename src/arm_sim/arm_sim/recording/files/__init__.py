# SPDX-License-Identifier: Apache-2.0
"""Files of recordings: the suite's own (MCAP and NumPy), bags of robots, and tables.

Depends on the contents of a recording, but not on ROS: messages are serialized here. Public are
``save`` and ``load``, and the writers used by the recorder of a running system.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput
from arm_sim.exceptions import NoRecording
from arm_sim.recording.contents import Contents
from arm_sim.recording.files import measured, npz, ticks
from arm_sim.recording.files.bags import BAGS, read_bag
from arm_sim.recording.files.container import MESSAGE, McapWriter
from arm_sim.recording.files.messages import CHANGE, JOINT_STATE, LOG, TICK
from arm_sim.recording.files.ticks import TickFile

__all__ = [
    "MESSAGE",
    "SUFFIXES",
    "McapWriter",
    "TickFile",
    "complete",
    "load",
    "new_file",
    "save",
]

SUFFIXES = (".csv", ".npz", *BAGS)
"""Suffixes of files that ``load`` reads."""


def save(contents: Contents, path: str | os.PathLike[str], efforts: Callable[[], Array]) -> Path:
    """Write a recording; see ``Recording.save``.

    Args:
        contents: The recording.
        path: Path of the file or folder.
        efforts: Returns the torques on the joints from each time, shape (k+1, n).
    """
    path = _path(path)
    if path.suffix == ".npz":
        _check_folder(path)
        part = _part_of(path)
        try:
            npz.write(contents, part)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        return path
    file, folder = where(path)
    part = _part_of(file)
    try:
        mcap = ticks.write(contents, efforts(), part)
        mcap.close()
        part.replace(file)
    finally:
        part.unlink(missing_ok=True)
    complete(mcap, file, folder)
    return path


def _part_of(path: Path) -> Path:
    """A file of this process, which replaces another one when it is complete."""
    return path.with_name(f"{path.name}.{os.getpid()}.part")


def _check_folder(path: Path) -> None:
    if not path.parent.is_dir():
        raise NoRecording(f"'{path}': there is no folder '{path.parent}'")


def where(path: Path) -> tuple[Path, Path | None]:
    """The MCAP file of a path, and the bag's folder, which is created, if the path is one.

    Raises:
        InvalidInput: If it is neither.
        OSError: If the file's folder does not exist, or the bag's cannot be created.
    """
    if path.suffix == ".mcap":
        _check_folder(path)
        return path, None
    if path.suffix:
        raise InvalidInput(
            f"'{path}' ends in '{path.suffix}'; allowed: .npz, .mcap, and a folder's name"
        )
    path.mkdir(parents=True, exist_ok=True)
    if strange := [file.name for file in path.iterdir() if file.suffix not in (*BAGS, ".yaml")]:
        raise InvalidInput(f"'{path}' is not the folder of a bag: it contains '{strange[0]}'")
    return path / f"{path.name}_0.mcap", path


def new_file(path: Path) -> tuple[Path, Path | None]:
    """``where`` of a path that does not exist; the file is created, so that it is one's own.

    Raises:
        InvalidInput: If it exists, even since a moment ago.
    """
    try:
        if path.exists():
            raise FileExistsError
        file, folder = where(path)
        file.touch(exist_ok=False)
    except FileExistsError:
        raise InvalidInput(
            f"'{path}' exists, and may be being written by another recorder; recordings are not "
            "overwritten; allowed: a new name"
        ) from None
    return file, folder


def complete(mcap: McapWriter, file: Path, folder: Path | None) -> None:
    """Write the ``metadata.yaml`` of a file's bag, if any; layout of rosbag2, version 9."""
    if folder is None:
        return
    first, last = mcap.span
    span = {
        "duration": {"nanoseconds": last - first},
        "starting_time": {"nanoseconds_since_epoch": first},
        "message_count": sum(mcap.messages.values()),
    }
    topics = [
        {
            "topic_metadata": {
                "name": topic, "type": kind, "serialization_format": "cdr",
                "offered_qos_profiles": yaml.safe_load(profile) or [],
                "type_description_hash": "",
            },
            "message_count": count,
        }
        for topic, kind, profile, count in mcap.topics
    ]  # fmt: skip
    content = {
        "version": 9, "storage_identifier": "mcap", **span, "topics_with_message_count": topics,
        "compression_format": "", "compression_mode": "", "relative_file_paths": [file.name],
        "files": [{"path": file.name, **span}], "custom_data": None,
        "ros_distro": os.environ.get("ROS_DISTRO", "jazzy"),
    }  # fmt: skip
    text = yaml.safe_dump({"rosbag2_bagfile_information": content}, sort_keys=False)
    (folder / "metadata.yaml").write_text(text, encoding="utf-8")


def _path(given: Any) -> Path:
    if not isinstance(given, str | os.PathLike):
        raise InvalidInput(f"path = {given!r}; the path of a file or folder is expected")
    return Path(given)


def load(path: str | os.PathLike[str], topic: str | None = None) -> Contents:
    """Read a recording; see ``Recording.load``."""
    path = _path(path)
    if not path.exists():
        raise NoRecording(f"no recording '{path}'")
    if path.suffix == ".npz":
        return npz.read(path)
    if path.suffix == ".csv":
        return measured.from_table(path)
    if path.suffix not in BAGS and not path.is_dir():
        raise InvalidInput(
            f"'{path}' ends in '{path.suffix}'; allowed: .npz, .mcap, .db3, .csv, and a bag's "
            "folder"
        )
    ours, kinds = (TICK, CHANGE, LOG), (TICK, CHANGE, LOG, JOINT_STATE)
    found = read_bag(path, lambda name, kind: kind in (kinds if topic else ours))
    if topic is None and found.of(CHANGE) and ticks.FACTS in found.facts:
        contents = ticks.read(found)
        if contents.origin is None or contents.origin.scene.sensors is None:
            return contents
        seen = read_bag(path, lambda name, kind: kind == JOINT_STATE).of(JOINT_STATE)
        return ticks.with_measured(contents, next(iter(seen.values()), []))
    found = found if topic else read_bag(path, lambda name, kind: kind == JOINT_STATE)
    return measured.from_bag(found, topic, path)
