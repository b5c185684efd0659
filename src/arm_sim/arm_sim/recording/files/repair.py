# SPDX-License-Identifier: Apache-2.0
"""Repair of files that were cut off, as when a recorder is killed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
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
            repaired = Repaired(Writer(sink))
            for file in files:
                repaired.add(file)
            if not repaired.numbers:
                raise InvalidInput(f"'{source}' contains nothing that can be repaired")
            if repaired.damage:
                damage = {"damage": "; ".join(dict.fromkeys(repaired.damage))}
                repaired.writer.add_metadata(REPAIRED, damage)
            repaired.writer.finish()  # type: ignore[no-untyped-call]
            return repaired
    except BaseException:
        out.unlink()
        raise


@dataclass
class Repaired:
    """Content of a repaired file.

    Attributes:
        writer: Writes it.
        count: Number of messages by topic.
        extras: "attachment" or "metadata" for each of these, by name.
        damage: Descriptions of unreadable parts.
        numbers: Of schemas, channels and what else is written once, by content.
    """

    writer: Writer
    count: dict[str, int] = field(default_factory=dict)
    extras: dict[str, str] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)
    numbers: dict[Any, int] = field(default_factory=dict)

    def add(self, path: Path) -> None:
        """Add what is intact of a file, in which channels have numbers of their own."""
        channels, schemas = dict[int, tuple[int, str]](), {0: 0}
        for record in intact_records(path, self.damage):
            if not self.numbers:
                head = (record.profile, record.library) if isinstance(record, Header) else ()
                self.numbers["header"] = self.writer.start(*head) or 0
            match record:
                case Message(channel_id=channel):
                    if channel not in channels:
                        self.damage.append(f"a message is of channel {channel}, not described")
                        continue
                    number, topic = channels[channel]
                    more = record.publish_time, record.sequence
                    self.writer.add_message(number, record.log_time, record.data, *more)
                    self.count[topic] += 1
                case Schema():
                    schema = record.name, record.encoding, record.data
                    schemas[record.id] = self._once(self.writer.register_schema, *schema)
                case Channel(topic=topic):
                    about = topic, record.message_encoding, schemas.get(record.schema_id, 0)
                    number = self._once(self.writer.register_channel, *about, record.metadata)
                    channels[record.id] = number, topic
                    self.count.setdefault(topic, 0)
                case Attachment():
                    times = record.create_time, record.log_time
                    content = record.name, record.media_type, record.data
                    self._once(self.writer.add_attachment, *times, *content)
                    self.extras[record.name] = "attachment"
                case Metadata():
                    self._once(self.writer.add_metadata, record.name, record.metadata)
                    self.extras[record.name] = "metadata"

    def _once(self, write: Callable[..., int | None], *content: Any) -> int:
        """Write a content unless it was written before; return its number."""
        key = repr((write.__name__, content))
        if key not in self.numbers:
            self.numbers[key] = write(*content) or 0
        return self.numbers[key]
