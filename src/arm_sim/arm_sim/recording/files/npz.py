# SPDX-License-Identifier: Apache-2.0
"""Recordings as NumPy archives, which were written before: arrays by name, the rest as text."""

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics.arrays import read_only
from arm_dynamics.exceptions import InvalidInput
from arm_sim.imperfections import Measured
from arm_sim.recording.contents import Contents, Event, Jump
from arm_sim.recording.origin import SCENE_FILE, URDF_FILE, Origin

# Names in files of the arrays with a row for each state
_ROWS = {
    "time": "time", "q": "q", "v": "v", "z": "z", "command": "command", "local_error": "error",
    "time_stepped": "time_stepped", "p": "p",
}  # fmt: skip


def read(path: Path) -> Contents:
    """Read a recording.

    Raises:
        InvalidInput: If it is damaged or something else.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (ValueError, EOFError, zipfile.BadZipFile, KeyError) as error:
        raise InvalidInput(
            f"'{path}' is damaged or not a NumPy archive: {error}; allowed: files of save()"
        ) from None
    try:
        return _contents(arrays)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        if isinstance(error, InvalidInput):
            raise
        raise InvalidInput(
            f"'{path}' holds {', '.join(sorted(arrays)) or 'nothing'} and is not a recording: "
            f"{error!r}"
        ) from None


def _contents(arrays: dict[str, Any]) -> Contents:
    """The content of a file, from its arrays, which are checked."""
    about = json.loads(str(arrays["about"]))
    rows = {name: read_only(arrays[key]) for name, key in _ROWS.items()}
    lengths, n = {name: len(array) for name, array in rows.items()}, len(about["joint_names"])
    if len(set(lengths.values())) != 1:
        raise InvalidInput(f"its arrays have {lengths} rows; equal numbers are expected")
    for name in ("q", "v", "command"):
        if rows[name].shape[1:] != (n,):
            raise InvalidInput(f"{name} has shape {rows[name].shape}; {n} columns are expected")
    texts = {name: str(arrays[name]) for name in (SCENE_FILE, URDF_FILE) if name in arrays}
    origin = None if about["origin"] is None else Origin.read(texts, about["origin"])
    jumps = [
        Jump(int(row), read_only(x), read_only(p), tuple(tunable), float(substep))
        for (row, tunable, substep), x, p in zip(
            about["jumps"], arrays.get("jump_x", ()), arrays.get("jump_p", ()), strict=True
        )
    ]
    return Contents(
        **rows, joint_names=tuple(about["joint_names"]), origin=origin,
        held=tuple(about["held"]), jumps=tuple(jumps),
        events=tuple(Event(float(time), str(text)) for time, text in about["events"]),
        gaps=tuple(about["gaps"]), substep=float(about["substep"]),
        of_robot=bool(about["of_robot"]),
        hold=arrays.get("hold"), left=(),
        measured=Measured.of(arrays["measured"]) if "measured" in arrays else None,
    )  # fmt: skip
