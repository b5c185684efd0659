# SPDX-License-Identifier: Apache-2.0
"""Reading of ROS 2 bags without ROS: MCAP, SQLite, or a folder of them."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

from arm_dynamics.exceptions import InvalidInput, known_names
from arm_sim.recording.files.container import FileContents

BAGS = (".mcap", ".db3")
SQLITE = b"SQLite format 3\0"


def read_bag(path: Path, wanted: Callable[[str, str], bool]) -> FileContents:
    """Content of a bag; see ``FileContents.read``."""
    first, *others = (
        _sqlite(file, wanted) if file.suffix == ".db3" else FileContents.read(file, wanted)
        for file in bag_files(path)
    )
    for other in others:
        _append(first, other)
    return first


def bag_files(path: Path) -> list[Path]:
    """The files of a bag, in the order of their names; a file is one by itself."""
    if not path.is_dir():
        return [path]
    files = [file for suffix in BAGS for file in path.glob(f"*{suffix}")]
    if not files:
        raise InvalidInput(f"'{path}' contains no {' or '.join(BAGS)}; allowed: a bag's folder")
    return sorted(files, key=lambda file: (len(file.stem), file.stem))


def _append(first: FileContents, other: FileContents) -> None:
    numbers = {topic: number for number, topic in first.topics.items()}
    for number, topic in other.topics.items():
        here = numbers.setdefault(topic, max(first.topics, default=0) + 1)
        first.topics[here] = topic
        first.used |= {here} if number in other.used else set()
        messages = other.messages.get(number, [])
        later = [(place + first.count, time, data) for place, time, data in messages]
        first.messages.setdefault(here, []).extend(later)
    first.count += other.count
    first.damage += other.damage
    first.texts = other.texts | first.texts
    first.facts = other.facts | first.facts


def _sqlite(path: Path, wanted: Callable[[str, str], bool]) -> FileContents:
    """The layout of rosbag2_storage_sqlite3: tables ``topics`` and ``messages``."""
    with path.open("rb") as file:
        if file.read(len(SQLITE)) != SQLITE:
            raise InvalidInput(f"'{path}' is not an SQLite database; allowed for .db3: a bag")
    found = FileContents()
    try:
        with closing(
            sqlite3.connect(f"file:{quote(str(path))}?mode=ro&immutable=1", uri=True)
        ) as base:
            base.text_factory = lambda raw: raw.decode(errors="replace")
            for number, topic, kind in base.execute("SELECT id, name, type FROM topics"):
                found.topics[number] = topic, kind
                if wanted(topic, kind):
                    found.messages[number] = []
            rows = base.execute(
                "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"
            )
            for number, time, data in rows:
                if number in found.messages:
                    found.messages[number].append((found.count, time, bytes(data)))
                found.count += 1
                found.used.add(number)
    except sqlite3.Error as error:
        if not any(found.messages.values()):
            raise InvalidInput(f"'{path}' is damaged or not a bag of ROS 2: {error}") from None
        found.damage.append(f"it is damaged from message {found.count} on: {error}")
    return found


def told(found: FileContents) -> str:
    """Topics and types of a bag, for an error message."""
    return known_names(f"{topic} ({kind})" for topic, kind in found.topics.values())
