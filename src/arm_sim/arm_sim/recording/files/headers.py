# SPDX-License-Identifier: Apache-2.0
"""Meaning of a table's columns, from the names that common loggers use."""

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

from arm_dynamics.exceptions import InvalidInput
from arm_sim.recording.files.messages import PARTS

_WORDS = {
    "position": ("position", "pos", "angle", "q"),
    "velocity": ("velocity", "vel", "speed", "qd", "dq", "v"),
    "effort": ("effort", "eff", "torque", "tau", "current"),
}
_CLOCKS = r"(?:__)?(?:time|timestamp|stamp|t|seconds|sec)"
_TIMES = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_TURN = math.pi / 180.0
_UNITS = {
    "": 1.0, "rad": 1.0, "m": 1.0, "rad/s": 1.0, "m/s": 1.0, "nm": 1.0, "n m": 1.0, "n·m": 1.0,
    "n*m": 1.0, "n": 1.0, "a": 1.0, "deg": _TURN, "°": _TURN, "deg/s": _TURN, "°/s": _TURN,
    "mm": 1e-3, "mm/s": 1e-3,
}  # fmt: skip


class Column(NamedTuple):
    """A column of numbers.

    Attributes:
        place: Index of the column.
        factor: Factor that converts values to SI units.
    """

    place: int
    factor: float = 1.0


class Header(NamedTuple):
    """Columns of a table.

    Attributes:
        clock: Column of times; None if there is none.
        joints: Names of the joints with a position, in the order of these columns.
        columns: By part and joint.
    """

    clock: Column | None
    joints: tuple[str, ...]
    columns: dict[tuple[str, str], Column]


def read_header(names: Sequence[str]) -> Header:
    """Times and joints among columns.

    ``./arm record`` writes names such as ``position.elbow``. Equivalent names are accepted:
    ``elbow_position``, ``q_elbow [rad]``, ``/joint_states/elbow/position``, and numbered names
    such as ``q1``, which stands for ``joint1`` (``q0`` if they begin with 0). Units in brackets
    are recognized; a column with another unit, or of no joint's quantity, is ignored.

    Args:
        names: Names of the columns.

    Raises:
        InvalidInput: If two columns are the same quantity of a joint.
    """
    clock, entries = None, list[tuple[str, str, Column]]()
    for place, name in enumerate(names):
        label, unit = _unit(name)
        if clock is None and (factor := _clock(label, unit)):
            clock = Column(place, factor)
        elif (key := _part(label)) and unit in _UNITS:
            entries.append((*key, Column(place, _UNITS[unit])))
    offset = int(any(joint.isdecimal() and int(joint) == 0 for _, joint, _ in entries))
    columns = dict[tuple[str, str], Column]()
    for part, label, column in entries:
        joint = f"joint{int(label) + offset}" if label.isdecimal() else label
        if (known := columns.setdefault((part, joint), column)) is not column:
            raise InvalidInput(
                f"columns '{names[known.place]}' and '{names[column.place]}' are both the {part} "
                f"of joint '{joint}'; one is expected"
            )
    joints = tuple(dict.fromkeys(joint for part, joint in columns if part == PARTS[0]))
    return Header(clock, joints, columns)


def _unit(name: str) -> tuple[str, str]:
    """A name without its unit in brackets, and the unit."""
    match = re.fullmatch(r"(.*?)\s*[\[(]([^\])]*)[\])]", name.strip())
    return (match[1], match[2].strip().lower()) if match else (name.strip(), "")


def _clock(name: str, unit: str) -> float | None:
    """Seconds per unit of a time column; None if it is not one."""
    match = re.fullmatch(rf"{_CLOCKS}(?:_(s|sec|ms|us|ns))?", name.lower())
    return _TIMES.get(match[1] or unit or "s") if match else None


def _part(name: str) -> tuple[str, str] | None:
    """The quantity and the joint of a column."""
    for part in PARTS:
        if name.startswith(f"{part}."):
            return part, name.removeprefix(f"{part}.")
    for part, words in _WORDS.items():
        alternatives = "|".join(words)
        if match := re.fullmatch(rf"(?:{alternatives})[._/ -]?(\d+)", name, re.IGNORECASE):
            return part, match[1]
        if match := re.fullmatch(rf"(?:{alternatives})[._/ -](.+)", name, re.IGNORECASE):
            return part, match[1]
        if match := re.fullmatch(rf"(.+)[._/ -](?:{alternatives})", name, re.IGNORECASE):
            return part, match[1].rpartition("/")[2]
    return None
