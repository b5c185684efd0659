# SPDX-License-Identifier: Apache-2.0
"""Files of recordings that are being written: MCAP, alone or in the folder of a bag."""

import os
from pathlib import Path
from typing import NamedTuple

import yaml
from mcap.reader import make_reader
from mcap.writer import Writer

from arm_dynamics.exceptions import InvalidInput, NotWritten
from arm_dynamics.writing import writing
from arm_sim.exceptions import NoRecording
from arm_sim.recording.files.reader import BAGS


class Place(NamedTuple):
    """An MCAP file, and the folder of its bag, if it is in one."""

    file: Path
    folder: Path | None


class McapWriter(Writer):
    """Writes a file, which is that of a failure at any time up to there.

    Args:
        place: The file, which is overwritten, and its folder.

    Attributes:
        file: The file, open.

    Raises:
        OSError: If it cannot be written, as in all methods.
    """

    def __init__(self, place: Place) -> None:
        self._place, self._kinds = place, dict[str, int]()
        self.file = place.file.open("wb")
        super().__init__(self.file)
        self.start("ros2", "arm_sim")

    def channel(self, topic: str, kind: str, text: str, profile: str = "") -> int:
        """Add a channel for messages of a type that ``text`` defines; return its number."""
        if kind not in self._kinds:
            self._kinds[kind] = self.register_schema(kind, "ros2msg", text.encode())
        about = {"offered_qos_profiles": profile}
        return self.register_channel(topic, "cdr", self._kinds[kind], about)

    def close(self) -> None:
        """Write the index for readers, close the file, and describe the bag."""
        with self.file:
            self.finish()  # type: ignore[no-untyped-call]
        complete(self._place)


def place_of(path: Path) -> Place:
    """The MCAP file of a path, and the bag's folder, which is created, if the path is one.

    Raises:
        InvalidInput: If it is neither.
        NoRecording: If the file's folder does not exist.
        NotWritten: If the bag's cannot be created.
    """
    if path.suffix == ".mcap":
        check_folder(path)
        return Place(path, None)
    if path.suffix:
        raise InvalidInput(
            f"'{path}' ends in '{path.suffix}'; allowed: .mcap, or a folder's name; a table: "
            "pandas.DataFrame(recording.to_dict()).to_csv(…)"
        )
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise NotWritten(f"'{path}' cannot be created: {error.strerror}") from None
    if foreign := [file.name for file in path.iterdir() if file.suffix not in (*BAGS, ".yaml")]:
        raise InvalidInput(f"'{path}' is not the folder of a bag: it contains '{foreign[0]}'")
    return Place(path / f"{path.name}_0.mcap", path)


def check_folder(path: Path) -> None:
    """Refuse a file in a folder that does not exist."""
    if not path.parent.is_dir():
        raise NoRecording(f"'{path}': there is no folder '{path.parent}'")


def new_file(path: Path) -> Place:
    """``place_of`` a path that does not exist; the file is created, so that no other writer is.

    Raises:
        InvalidInput: If it exists, even since a moment ago.
        NotWritten: If the system does not let it be created.
    """
    exists = InvalidInput(
        f"'{path}' exists, and another recorder may be writing it; recordings are not "
        "overwritten; allowed: a new name"
    )
    if path.exists():
        raise exists
    place = place_of(path)
    with writing(path):
        try:
            place.file.touch(exist_ok=False)
        except FileExistsError:
            raise exists from None
    return place


def complete(place: Place) -> None:
    """Write the ``metadata.yaml`` of a file's bag, if any; layout of rosbag2, version 9."""
    file, folder = place
    if folder is None:
        return
    with file.open("rb") as raw:
        summary = make_reader(raw).get_summary()
    assert summary is not None and summary.statistics is not None
    statistics = summary.statistics
    start, end = statistics.message_start_time, statistics.message_end_time
    span = {
        "duration": {"nanoseconds": end - start}, "message_count": statistics.message_count,
        "starting_time": {"nanoseconds_since_epoch": start},
    }  # fmt: skip
    topics = [
        {
            "topic_metadata": {
                "name": channel.topic, "type": summary.schemas[channel.schema_id].name,
                "serialization_format": "cdr",
                "offered_qos_profiles":
                    yaml.safe_load(channel.metadata["offered_qos_profiles"]) or [],
                "type_description_hash": "",
            },
            "message_count": statistics.channel_message_counts.get(number, 0),
        }
        for number, channel in summary.channels.items()
    ]  # fmt: skip
    content = {
        "version": 9, "storage_identifier": "mcap", **span, "topics_with_message_count": topics,
        "compression_format": "", "compression_mode": "", "relative_file_paths": [file.name],
        "files": [{"path": file.name, **span}], "custom_data": None,
        "ros_distro": os.environ.get("ROS_DISTRO", "jazzy"),
    }  # fmt: skip
    text = yaml.safe_dump({"rosbag2_bagfile_information": content}, sort_keys=False)
    (folder / "metadata.yaml").write_text(text, encoding="utf-8")
