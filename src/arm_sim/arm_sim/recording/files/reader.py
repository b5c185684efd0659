# SPDX-License-Identifier: Apache-2.0
"""Bags of ROS 2, read without ROS as far as they are intact: MCAP, SQLite, or a folder of them."""

import sqlite3
import struct
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple
from urllib.parse import quote

from arm_dynamics.exceptions import InvalidInput, known_names

try:
    from mcap import records
    from mcap.opcode import Opcode
    from mcap.reader import SeekingReader
    from mcap.stream_reader import StreamReader, breakup_chunk
    from mcap.writer import MCAP0_MAGIC
except ModuleNotFoundError as error:
    raise InvalidInput(
        f"files of recordings require the module '{error.name}': pip install mcap"
    ) from None

BAGS = (".mcap", ".db3")
SQLITE = b"SQLite format 3\0"
# Name of the metadata with the damage that a repaired file had
REPAIRED = "repaired"
_HEAD = struct.Struct("<BQ")  # of a record: opcode and length
_READ = (
    Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.ATTACHMENT,
    Opcode.METADATA,
)  # fmt: skip


class BagMessage(NamedTuple):
    """A message of a bag."""

    place: int  # in the order of all messages
    time: int  # of its log in [ns]
    data: bytes


@dataclass
class BagContents:
    """Content of a bag, or of its readable part.

    Attributes:
        topics: Type of each topic.
        attachments: Attached files, as text.
        metadata: By name.
        messages: Those of each requested topic.
        damage: Description of unreadable parts.
        count: Number of messages, also of topics that are not requested.
        not_empty: Topics that have messages.
    """

    topics: dict[str, str] = field(default_factory=dict)
    attachments: dict[str, str] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    messages: dict[str, list[BagMessage]] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)
    count: int = 0
    not_empty: set[str] = field(default_factory=set)

    def besides(self, *topics: str) -> tuple[str, ...]:
        """Topics with messages other than these."""
        return tuple(name for name in self.topics if name in self.not_empty and name not in topics)

    def of(self, kind: str) -> dict[str, list[BagMessage]]:
        """Messages of a type, by topic."""
        return {name: x for name, x in self.messages.items() if self.topics[name] == kind}

    def listing(self) -> str:
        """Topics and types, for an error message."""
        return known_names(f"{topic} ({kind})" for topic, kind in self.topics.items())

    def add_topic(self, topic: str, kind: str, keep: bool) -> None:
        """Add a topic of a type; its messages are kept only if ``keep``."""
        self.topics.setdefault(topic, kind)
        if keep:
            self.messages.setdefault(topic, [])

    def add(self, topic: str, time: int, data: bytes) -> None:
        """Add a message with the time of its log in [ns]."""
        if topic in self.messages:
            self.messages[topic].append(BagMessage(self.count, time, data))
        self.count += 1
        self.not_empty.add(topic)


def read_bag(path: Path, keep: Callable[[str, str], bool]) -> BagContents:
    """Read a bag from beginning to end, or to where it is truncated.

    Args:
        path: Path of a file or folder.
        keep: Whether messages are kept, by topic and type.

    Raises:
        InvalidInput: If it is no bag.
        OSError: If it cannot be read.
    """
    contents = BagContents()
    for file in bag_files(path):
        read = _read_sqlite if file.suffix == ".db3" else _read_mcap
        read(file, contents, keep)
    return contents


def _read_mcap(path: Path, contents: BagContents, keep: Callable[[str, str], bool]) -> None:
    """Read records one after another, as far as they are readable."""
    schemas, channels = dict[int, str](), dict[int, str]()
    for record in intact_records(path, contents.damage):
        match record:
            case records.Message():
                contents.add(channels.get(record.channel_id, ""), record.log_time, record.data)
            case records.Schema():
                schemas[record.id] = record.name
            case records.Channel():
                kind = schemas.get(record.schema_id, "")
                channels[record.id] = record.topic
                readable = record.message_encoding == "cdr"
                contents.add_topic(record.topic, kind, readable and keep(record.topic, kind))
            case records.Attachment():
                contents.attachments.setdefault(record.name, record.data.decode(errors="replace"))
            case records.Metadata():
                contents.metadata.setdefault(record.name, record.metadata)
                if record.name == REPAIRED:
                    contents.damage += record.metadata.values()


def _read_sqlite(path: Path, contents: BagContents, keep: Callable[[str, str], bool]) -> None:
    """Of a file of rosbag2_storage_sqlite3: tables ``topics`` and ``messages``."""
    with path.open("rb") as file:
        if file.read(len(SQLITE)) != SQLITE:
            raise InvalidInput(f"'{path}' is not an SQLite database; allowed for .db3: a bag")
    begin, uri = contents.count, f"file:{quote(str(path))}?mode=ro&immutable=1"
    try:
        with closing(sqlite3.connect(uri, uri=True)) as base:
            base.text_factory = lambda raw: raw.decode(errors="replace")
            topics = dict[int, str]()
            for number, topic, kind in base.execute("SELECT id, name, type FROM topics"):
                topics[number] = topic
                contents.add_topic(topic, kind, keep(topic, kind))
            for number, time, data in base.execute(
                "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"
            ):
                contents.add(topics.get(number, ""), time, bytes(data))
    except sqlite3.Error as error:
        if not contents.count:
            raise InvalidInput(f"'{path}' is damaged or not a bag of ROS 2: {error}") from None
        contents.damage.append(f"it is damaged from message {contents.count - begin} on: {error}")


def bag_files(path: Path) -> list[Path]:
    """The files of a bag, in the order of their names; a file is one by itself."""
    if not path.is_dir():
        return [path]
    files = [file for suffix in BAGS for file in path.glob(f"*{suffix}")]
    if not files:
        raise InvalidInput(f"'{path}' contains no {' or '.join(BAGS)}; allowed: a bag's folder")
    return sorted(files, key=lambda file: (len(file.stem), file.stem))


def intact_records(path: Path, damage: list[str]) -> Iterator[records.McapRecord]:
    """Records of an MCAP file, and of its chunks, up to its end or to where it is truncated.

    Schemas and channels come first where the file's summary repeats them: so damage to the chunk
    that introduces a channel costs no other chunk.

    Args:
        path: Path of the file.
        damage: Receives a description of each unreadable part.

    Raises:
        InvalidInput: If it is not an MCAP file.
        OSError: If it cannot be read.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise InvalidInput(f"'{path}' is not an MCAP file: its first bytes differ")
        while len(head := file.read(_HEAD.size)) == _HEAD.size:
            opcode, length = _HEAD.unpack(head)
            start = file.tell()
            if opcode == Opcode.DATA_END:
                return
            if start + length > size:
                break
            if opcode not in _READ:
                file.seek(length, 1)
                continue
            stream = StreamReader(BytesIO(head + file.read(length)), True, emit_chunks=True)
            try:
                record, inner = next(iter(stream.records)), list[records.McapRecord]()
                if isinstance(record, records.Chunk):
                    inner = breakup_chunk(record, validate_crc=True)
            except Exception as error:  # whatever damaged bytes make of what reads them
                kind = Opcode(opcode).name.lower()
                damage.append(f"a record ({kind}) at byte {start} is damaged: {error!r}")
                continue
            if opcode != Opcode.CHUNK:
                yield record
            yield from inner
            if isinstance(record, records.Header):
                yield from _summarized(file)
                file.seek(start + length)
    damage.append("it is truncated: the end of the recording is missing")


def _summarized(file: BinaryIO) -> Iterator[records.McapRecord]:
    """Schemas and channels in the summary of a file, if it is intact."""
    summary = None
    file.seek(0)
    with suppress(Exception):  # whatever damaged bytes make of what reads them
        summary = SeekingReader(file, validate_crcs=True).get_summary()
    if summary is not None:
        yield from summary.schemas.values()
        yield from summary.channels.values()
