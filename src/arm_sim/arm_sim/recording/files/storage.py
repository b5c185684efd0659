# SPDX-License-Identifier: Apache-2.0
"""Saves and loads recordings, by the kinds of their files."""

import logging
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.writing import replacing, writing
from arm_sim.exceptions import NoRecording
from arm_sim.recording.contents import Contents
from arm_sim.recording.files import measured, npz, tick_reader, tick_writer
from arm_sim.recording.files.messages import CHANGE, JOINT_STATE, LOG, TICK
from arm_sim.recording.files.reader import BAGS, read_bag
from arm_sim.recording.files.tick_writer import TickFile
from arm_sim.recording.files.writer import Place, check_folder, complete, new_file, place_of

_log = logging.getLogger(__name__)
# Suffixes of files that ``load`` reads
SUFFIXES = (".csv", ".npz", *BAGS)


def save(contents: Contents, path: str | os.PathLike[str], efforts: Callable[[], Array]) -> Path:
    """Write a recording; see ``Recording.save``.

    Args:
        contents: The recording.
        path: Path of the file or folder.
        efforts: Returns the torques on the joints from each time, shape (k+1, n).
    """
    path = _path(path)
    if contents.left:
        _log.warning(
            "'%s' does not contain what else was in the recording's file: %s (./arm record "
            "--repair copies a file whole)", path, known_names(contents.left),
        )  # fmt: skip
    if contents.of_robot:
        if path.suffix != ".csv":
            raise InvalidInput(f"'{path}': of a robot only joint states are known; allowed: .csv")
        check_folder(path)
        with replacing(path) as part:
            measured.to_table(contents, efforts(), part)
        return path
    place = place_of(path)
    with replacing(place.file) as part:
        tick_writer.write(Place(part, None), contents, efforts()).close()
    complete(place)
    return path


class Stream(AbstractContextManager["Stream"]):
    """A new file of a recording that is written part by part, by a thread of its own.

    Args:
        path: Path of the file or folder.

    Attributes:
        path: Likewise.

    Raises:
        InvalidInput: If it exists, or is neither.
        NotWritten: If the system does not let it be written, as in ``append``.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = _path(path)
        self._place, self._until = new_file(self.path), 0.0
        self._file: TickFile | None = None
        self._writer = ThreadPoolExecutor(1, "recording")
        self._last = self._writer.submit(lambda: None)

    def append(self, part: Contents, efforts: Array) -> None:
        """Write a part, which begins where the last one ends; efforts as for ``save``."""
        with writing(self.path):
            self._last.result()
        self._last = self._writer.submit(self._write, part, efforts)

    def _write(self, part: Contents, efforts: Array) -> None:
        if self._file is None:
            self._file = tick_writer.write(self._place, part, efforts)
        else:
            self._file.write(part, efforts)
        self._until = float(part.time[-1])

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Complete the file, until which an error is reported; or remove what is empty."""
        self._writer.shutdown()
        if error is not None and self._file is not None:
            error.add_note(f"'{self.path}' has the motion until t = {self._until:.6g} s")
        with writing(self.path) if error is None else suppress(OSError):
            if self._file is not None:
                self._file.close()
            else:
                self._place.file.unlink()
                if self._place.folder is not None:
                    self._place.folder.rmdir()
            self._last.result()


def _path(path: Any) -> Path:
    if not isinstance(path, str | os.PathLike):
        raise InvalidInput(f"path = {path!r}; the path of a file or folder is expected")
    return Path(path)


def load(path: str | os.PathLike[str], topic: str | None = None) -> Contents:
    """Read a recording; see ``Recording.load``."""
    path = _path(path)
    if not path.exists():
        pairs = "; every pair has its own option, as --map a=b --map c=d"
        raise NoRecording(f"no recording '{path}'{pairs if '=' in path.name else ''}")
    if path.suffix == ".npz":
        return npz.read(path)
    if path.suffix == ".csv":
        return measured.from_table(path)
    if path.suffix not in BAGS and not path.is_dir():
        raise InvalidInput(
            f"'{path}' ends in '{path.suffix}'; allowed: .mcap, .db3, .csv, and a bag's folder"
        )
    ours, kinds = (TICK, CHANGE, LOG), (TICK, CHANGE, LOG, JOINT_STATE)
    bag = read_bag(path, lambda name, kind: kind in (kinds if topic else ours))
    if topic is None and bag.of(CHANGE) and tick_writer.METADATA in bag.metadata:
        return replace(tick_reader.read(bag, path), left=tick_reader.other_topics(bag))
    bag = bag if topic else read_bag(path, lambda name, kind: kind == JOINT_STATE)
    return measured.from_bag(bag, topic, path)
