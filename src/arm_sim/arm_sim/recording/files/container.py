# SPDX-License-Identifier: Apache-2.0
"""MCAP files, written chunk by chunk and read as far as they are intact.

A failure thus loses at most the last chunk. Specification: https://mcap.dev/spec. The library
``mcap`` writes and reads every kind of record except messages: it takes 20 µs for one in Python,
and a recording of ten minutes has two million. Here a chunk of them is one array.
"""

from __future__ import annotations

import mmap
import os
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.exceptions import InvalidInput

try:
    import zstandard
    from mcap import records
    from mcap.data_stream import ReadDataStream, RecordBuilder
    from mcap.exceptions import McapError
    from mcap.opcode import Opcode
    from mcap.stream_reader import get_chunk_data_stream
except ModuleNotFoundError as error:
    raise InvalidInput(
        f"files of recordings require the module '{error.name}': pip install mcap"
    ) from None

MAGIC = b"\x89MCAP0\r\n"
REPAIRED = "repaired"
"""Name of the metadata with the damage that a repaired file had."""
MESSAGE = struct.Struct("<BQHIQQ")
"""Head of a message: opcode, length, channel, sequence, log time and publish time in [ns]."""
PREFIX, _CHUNK = struct.Struct("<BQ"), struct.Struct("<QQQI")
_IDS_AND_TIMES = 22  # bytes of a message record before its data
_KINDS: dict[int, Any] = {
    Opcode.HEADER: records.Header, Opcode.SCHEMA: records.Schema,
    Opcode.CHANNEL: records.Channel, Opcode.ATTACHMENT: records.Attachment,
    Opcode.METADATA: records.Metadata, Opcode.CHUNK: records.Chunk,
}  # fmt: skip
_LEVEL = 1  # of zstd; see docs/how-to/recordings.md for a comparison


class McapWriter:
    """Writes one file.

    Args:
        path: Path of the file, which is overwritten.
        library: Name of the writing library, for the header.

    Attributes:
        written: Bytes in the file.
        messages: Number of messages of each channel.

    Raises:
        OSError: If the file cannot be written, as in all methods; earlier content stays intact.
    """

    def __init__(self, path: Path, library: str = "arm_sim") -> None:
        self._file = path.open("wb", buffering=0)
        self.written, self.messages = 0, dict[int, int]()
        self._schemas, self._channels = dict[str, records.Schema](), dict[int, records.Channel]()
        # As bytes: as objects, the index of a day would take 0.2 GB.
        self._chunks, self._chunk_count, self._span = bytearray(), 0, (0, 0)
        self._attached, self._metadata = list[Any](), list[Any]()
        self._compressor = zstandard.ZstdCompressor(level=_LEVEL)
        self.put(MAGIC + _bytes(records.Header(profile="ros2", library=library)))

    def put(self, piece: bytes) -> int:
        """Append bytes completely or not at all; return their offset."""
        start, left = self.written, memoryview(piece)
        try:
            while left:
                left = left[self._file.write(left) :]
        except OSError:
            os.ftruncate(self._file.fileno(), start)
            self._file.seek(start)
            raise
        self.written += len(piece)
        return start

    def attach(self, name: str, text: str) -> None:
        """Attach a file."""
        data, kind = text.encode(), "text/plain"
        record = records.Attachment(
            create_time=0, log_time=0, name=name, media_type=kind, data=data
        )
        piece = _bytes(record)
        start = self.put(piece)
        self._attached.append(
            records.AttachmentIndex(
                offset=start, length=len(piece), log_time=0, create_time=0, data_size=len(data),
                name=name, media_type=kind,
            )
        )  # fmt: skip

    def tell(self, name: str, facts: Mapping[str, str]) -> None:
        """Add metadata by name."""
        piece = _bytes(records.Metadata(name=name, metadata=dict(facts)))
        start = self.put(piece)
        self._metadata.append(records.MetadataIndex(offset=start, length=len(piece), name=name))

    def channel(self, topic: str, kind: str, text: str, profile: str = "") -> int:
        """Add a channel for messages of a type that ``text`` defines; return its number."""
        if kind not in self._schemas:
            number, data = len(self._schemas) + 1, text.encode()
            schema = records.Schema(id=number, data=data, encoding="ros2msg", name=kind)
            self.put(_bytes(schema))
            self._schemas[kind] = schema
        number = len(self._channels) + 1
        channel = records.Channel(
            id=number, topic=topic, message_encoding="cdr",
            metadata={"offered_qos_profiles": profile}, schema_id=self._schemas[kind].id,
        )  # fmt: skip
        self.put(_bytes(channel))
        self._channels[number], self.messages[number] = channel, 0
        return number

    def chunk(self, data: bytes | memoryview, offsets: NDArray[np.int64]) -> None:
        """Write messages.

        Args:
            data: Their records, one after another.
            offsets: Offset of each record, in order of time.
        """
        if not len(offsets):
            return
        rows = np.frombuffer(data, np.uint8)
        channel = _field(rows, offsets + 9, np.uint16)
        times = _field(rows, offsets + 15, np.uint64)
        first, last = int(times.min()), int(times.max())
        packed, crc = self._compressor.compress(data), zlib.crc32(data)
        head = _CHUNK.pack(first, last, len(data), crc) + _text("zstd")
        head += struct.pack("<Q", len(packed))
        record = PREFIX.pack(Opcode.CHUNK, len(head) + len(packed)) + head + packed
        numbers, counts = (array.tolist() for array in np.unique(channel, return_counts=True))
        pieces = [_index(number, channel, times, offsets) for number in numbers]
        ends = np.cumsum([self.written + len(record), *map(len, pieces)]).tolist()
        places, tail = dict(zip(numbers, ends, strict=False)), b"".join(pieces)
        start = self.put(record + tail)
        for number, count in zip(numbers, counts, strict=True):
            self.messages[number] += count
        self._chunks += _bytes(
            records.ChunkIndex(
                chunk_length=len(record), chunk_start_offset=start, compression="zstd",
                compressed_size=len(packed), message_start_time=first, message_end_time=last,
                message_index_length=len(tail), message_index_offsets=places,
                uncompressed_size=len(data),
            )
        )  # fmt: skip
        earlier = self._span if self._chunk_count else (first, last)
        self._span = min(first, earlier[0]), max(last, earlier[1])
        self._chunk_count += 1

    @property
    def span(self) -> tuple[int, int]:
        """Times of the first and the last message in [ns]."""
        return self._span

    @property
    def topics(self) -> list[tuple[str, str, str, int]]:
        """Topic, type, quality of service and number of messages of each channel."""
        kinds = {schema.id: name for name, schema in self._schemas.items()}
        return [
            (c.topic, kinds[c.schema_id], c.metadata["offered_qos_profiles"], self.messages[i])
            for i, c in self._channels.items()
        ]

    def close(self) -> None:
        """Write the summary, the index for readers, and close the file."""
        try:
            self.put(self._ending())
        finally:
            self._file.close()

    def _ending(self) -> bytes:
        end = _bytes(records.DataEnd(data_section_crc=0))
        start = self.written + len(end)
        groups = {
            Opcode.SCHEMA: _all_bytes(self._schemas.values()),
            Opcode.CHANNEL: _all_bytes(self._channels.values()),
            Opcode.STATISTICS: _bytes(self._statistics()),
            Opcode.CHUNK_INDEX: bytes(self._chunks),
            Opcode.ATTACHMENT_INDEX: _all_bytes(self._attached),
            Opcode.METADATA_INDEX: _all_bytes(self._metadata),
        }
        summary, offsets = b"", b""
        for opcode, piece in groups.items():
            if not piece:
                continue
            offsets += _bytes(
                records.SummaryOffset(
                    group_opcode=opcode, group_start=start + len(summary), group_length=len(piece)
                )
            )
            summary += piece
        footer = struct.pack("<QQ", start, start + len(summary))
        head = PREFIX.pack(Opcode.FOOTER, len(footer) + 4) + footer
        crc = zlib.crc32(summary + offsets + head)
        return end + summary + offsets + head + struct.pack("<I", crc) + MAGIC

    def _statistics(self) -> records.Statistics:
        first, last = self.span
        return records.Statistics(
            attachment_count=len(self._attached), channel_count=len(self._channels),
            channel_message_counts=self.messages, chunk_count=self._chunk_count,
            message_count=sum(self.messages.values()), message_start_time=first,
            message_end_time=last, metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )  # fmt: skip


@dataclass
class FileContents:
    """Content of a file, or of its readable part.

    Attributes:
        topics: Topic and type of each channel by its number.
        texts: Attached files.
        facts: Metadata by name.
        messages: Of each requested channel: position in the file, log time in [ns], and data of
            every message.
        damage: Description of unreadable parts.
        count: Number of messages, also of channels that are not requested.
        used: Channels that have messages.
    """

    topics: dict[int, tuple[str, str]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    facts: dict[str, dict[str, str]] = field(default_factory=dict)
    messages: dict[int, list[tuple[int, int, bytes]]] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)
    count: int = 0
    used: set[int] = field(default_factory=set)

    def besides(self, *topics: str) -> tuple[str, ...]:
        """Topics with messages other than these."""
        found = (self.topics[number][0] for number in sorted(self.used & self.topics.keys()))
        return tuple(topic for topic in found if topic not in topics)

    def of(self, kind: str) -> dict[str, list[tuple[int, int, bytes]]]:
        """Messages of a type, by topic."""
        return {
            topic: self.messages[number]
            for number, (topic, type_) in self.topics.items()
            if type_ == kind and number in self.messages
        }

    @classmethod
    def read(cls, path: Path, wanted: Callable[[str, str], bool]) -> Self:
        """Read a file from beginning to end, or to where it is truncated.

        Args:
            path: Path of the file.
            wanted: Decides by topic and type whether messages are kept.

        Raises:
            InvalidInput: If it is not an MCAP file.
            OSError: If it cannot be read.
        """
        found, schemas = cls(), dict[int, str]()
        for opcode, record, raw, start, end in intact_records(path, found.damage):
            if opcode == Opcode.MESSAGE:
                head = MESSAGE.unpack_from(raw, start - PREFIX.size)
                kept = found.messages.get(head[2])
                if kept is not None:
                    kept.append((found.count, head[4], raw[start + _IDS_AND_TIMES : end]))
                found.count += 1
                found.used.add(head[2])
            elif opcode == Opcode.SCHEMA:
                schemas[record.id] = record.name
            elif opcode == Opcode.CHANNEL:
                kind = schemas.get(record.schema_id, "")
                found.topics[record.id] = record.topic, kind
                if record.message_encoding == "cdr" and wanted(record.topic, kind):
                    found.messages.setdefault(record.id, [])
            elif opcode == Opcode.ATTACHMENT:
                found.texts[record.name] = record.data.decode(errors="replace")
            elif opcode == Opcode.METADATA:
                found.facts[record.name] = record.metadata
        found.damage += found.facts.get(REPAIRED, {}).values()
        return found


Buffer = mmap.mmap | bytes
Record = tuple[int, Any, Buffer, int, int]
"""Opcode, what was parsed (nothing of a message), and the buffer with its start and end there."""


def intact_records(path: Path, damage: list[str]) -> Iterator[Record]:
    """Records of a file, and of its chunks, from beginning to end or to where it is truncated.

    Args:
        path: Path of the file.
        damage: Receives a description of each unreadable part.

    Raises:
        InvalidInput: If it is not an MCAP file.
        OSError: If it cannot be read.
    """
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise InvalidInput(f"'{path}' is not an MCAP file: its first bytes differ")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as raw:
            for place in _records(raw, len(MAGIC)):
                if place[0] == Opcode.DATA_END:
                    return
                yield from _parsed(raw, *place, damage)
    damage.append("it is truncated: the end of the recording is missing")


def _parsed(raw: Buffer, opcode: int, start: int, end: int, damage: list[str]) -> Iterator[Record]:
    """A record, or those of a chunk."""
    kind, inner = _KINDS.get(opcode), b""
    try:
        record: Any = kind.read(_stream(raw[start:end])) if kind else None
        if opcode == Opcode.CHUNK:
            inner = _unpacked(record)
    except (ValueError, RuntimeError, McapError, zstandard.ZstdError, struct.error) as error:
        what = Opcode(opcode).name.lower()
        damage.append(f"a record ({what}) at byte {start} is damaged: {error!r}")
        return
    if opcode != Opcode.CHUNK:
        yield opcode, record, raw, start, end
    for place in _records(inner, 0):
        yield from _parsed(inner, *place, damage)


def _bytes(record: Any) -> bytes:
    builder: Any = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())


def _all_bytes(some: Iterable[Any]) -> bytes:
    return b"".join(map(_bytes, some))


def _stream(data: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(data))


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


def _index(
    number: int, channels: NDArray[Any], times: NDArray[np.uint64], offsets: NDArray[np.int64]
) -> bytes:
    """The record with times and offsets of a channel's messages in a chunk."""
    mine = channels == number
    index = np.stack([times[mine], offsets[mine].astype(np.uint64)], axis=1).tobytes()
    head = PREFIX.pack(Opcode.MESSAGE_INDEX, 6 + len(index))
    return head + struct.pack("<HI", number, len(index)) + index


def _field(rows: NDArray[np.uint8], places: NDArray[np.int64], kind: Any) -> NDArray[Any]:
    """Numbers of a type at offsets of a buffer."""
    size = np.dtype(kind).itemsize
    found: NDArray[Any] = rows[places[:, None] + np.arange(size)].view(kind)[:, 0]
    return found


def _unpacked(chunk: records.Chunk) -> bytes:
    if chunk.compression not in ("", "lz4", "zstd"):
        raise ValueError(f"compression '{chunk.compression}' is unknown")
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    return stream.read(size)


def _records(raw: Buffer, at: int) -> Iterator[tuple[int, int, int]]:
    """Opcode, start and end of each complete record from a place on."""
    while at + PREFIX.size <= len(raw):
        opcode, length = PREFIX.unpack_from(raw, at)
        start, at = at + PREFIX.size, at + PREFIX.size + length
        if at > len(raw):
            return
        yield opcode, start, at
