# SPDX-License-Identifier: Apache-2.0
"""Repair of files that were cut off, as when a recorder is killed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from mcap.records import Attachment, Channel, Header, Message, Metadata, Schema
from mcap.writer import Writer

from arm_dynamics.exceptions import InvalidInput
from arm_sim.exceptions import NoRecording
from arm_sim.recording.files.reader import REPAIRED, bag_files, intact_records
from arm_sim.recording.files.writer import new_file


def repair(source: Path, out: Path) -> Repaired:
    """Write all that is intact of a file into another one, with the index that readers require.

    Every topic is kept, also without messages, with its type and quality of service, and so are
    attachments and metadata, whichever program wrote them.

    Args:
        source: A file (``.mcap``), or the folder of a bag of them, which become one.
        out: The file to write (``.mcap``).

    Raises:
        NoRecording: If it does not exist.
        InvalidInput: If it is another kind of file, contains nothing, or ``out`` exists.
        OSError: If it cannot be read or written.
    """
    if not source.exists():
        raise NoRecording(f"no recording '{source}'")
    files = bag_files(source)
    if out.suffix != ".mcap" or any(file.suffix != ".mcap" for file in files):
        raise InvalidInput(
            f"'{source}' to '{out}': only .mcap is repaired, into .mcap (.db3 needs no repair; "
            "ros2 bag reindex writes its metadata.yaml)"
        )
    new_file(out)
    try:
        with out.open("wb") as sink:
            copier = _Copier(Writer(sink))
            for file in files:
                copier.copy(file)
            return copier.finish(source)
    except BaseException:
        out.unlink()
        raise


@dataclass(frozen=True)
class Repaired:
    """Content of a repaired file.

    Attributes:
        count: Number of messages by topic.
        extras: Names of attachments and metadata.
        damage: Descriptions of unreadable parts.
    """

    count: dict[str, int]
    extras: tuple[str, ...]
    damage: list[str]


class _Copier:
    """Copies what is intact of files, in which channels have numbers of their own, into one."""

    def __init__(self, writer: Writer) -> None:
        self._writer, self._begun = writer, False
        self._count, self._damage = dict[str, int](), list[str]()
        self._extras = dict[str, None]()  # in this order
        self._numbers: dict[bytes, int] = {}  # of what is written once, by a digest of its content

    def copy(self, path: Path) -> None:
        channels, schemas = dict[int, tuple[int, str]](), {0: 0}
        for record in intact_records(path, self._damage):
            if not self._begun:
                head = (record.profile, record.library) if isinstance(record, Header) else ()
                self._writer.start(*head)
                self._begun = True
            match record:
                case Message(channel_id=channel):
                    if channel not in channels:
                        self._damage.append(f"a message is of channel {channel}, not described")
                        continue
                    number, topic = channels[channel]
                    more = record.publish_time, record.sequence
                    self._writer.add_message(number, record.log_time, record.data, *more)
                    self._count[topic] += 1
                case Schema():
                    schema = record.name, record.encoding, record.data
                    schemas[record.id] = self._once(self._writer.register_schema, *schema)
                case Channel(topic=topic):
                    about = topic, record.message_encoding, schemas.get(record.schema_id, 0)
                    number = self._once(self._writer.register_channel, *about, record.metadata)
                    channels[record.id] = number, topic
                    self._count.setdefault(topic, 0)
                case Attachment():
                    times = record.create_time, record.log_time
                    content = record.name, record.media_type, record.data
                    self._once(self._writer.add_attachment, *times, *content)
                    self._extras[record.name] = None
                case Metadata():
                    self._once(self._writer.add_metadata, record.name, record.metadata)
                    self._extras[record.name] = None

    def finish(self, source: Path) -> Repaired:
        if not self._begun:
            raise InvalidInput(f"'{source}' contains nothing that can be repaired")
        if self._damage:
            self._writer.add_metadata(REPAIRED, {"damage": "; ".join(dict.fromkeys(self._damage))})
        self._writer.finish()  # type: ignore[no-untyped-call]
        return Repaired(self._count, tuple(self._extras), self._damage)

    def _once(self, write: Callable[..., int | None], *content: Any) -> int:
        """Write a content unless it was written before; return its number."""
        key = sha256(repr((write.__name__, content)).encode()).digest()
        if key not in self._numbers:
            self._numbers[key] = write(*content) or 0
        return self._numbers[key]
