# SPDX-License-Identifier: Apache-2.0
"""Meaning of a table's columns, from the names that common loggers use."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from arm_dynamics.exceptions import InvalidInput
from arm_sim.recording.files.messages import PARTS

_WORDS = {
    "position": ("position", "pos", "angle", "q"),
    "velocity": ("velocity", "vel", "speed", "qd", "dq", "v"),
    "effort": ("effort", "eff", "torque", "tau", "current"),
}
_CLOCKS = r"(?:__|%)?(?:time|timestamp|stamp|t|seconds|sec)"
_ELEMENT = re.compile(r"(?:.*[./])?(name|position|velocity|effort)[._]?\[?(\d+)\]?")
_TIMES = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_TURN = math.pi / 180.0
_UNITS = {
    "": 1.0, "rad": 1.0, "m": 1.0, "rad/s": 1.0, "m/s": 1.0, "nm": 1.0, "n m": 1.0, "n·m": 1.0,
    "n*m": 1.0, "n": 1.0, "a": 1.0, "deg": _TURN, "°": _TURN, "deg/s": _TURN, "°/s": _TURN,
    "mm": 1e-3, "mm/s": 1e-3,
}  # fmt: skip


@dataclass(frozen=True)
class Column:
    """A column of numbers.

    Attributes:
        place: Index of the column.
        factor: Factor that converts values to SI units.
    """

    place: int
    factor: float = 1.0


@dataclass(frozen=True)
class Header:
    """Columns of a table.

    Attributes:
        clock: Column of times; None if there is none.
        joints: Names of the joints, in the order of their first column.
        columns: By part and joint.
    """

    clock: Column | None
    joints: tuple[str, ...]
    columns: dict[tuple[str, str], Column]


def read_elements(names: Sequence[str]) -> dict[tuple[str, int], int]:
    """Columns of messages, as ``rostopic echo -p`` writes them, by field and place in it.

    Args:
        names: Names of the columns, such as ``field.name0`` and ``field.position0``.

    Returns:
        Their indices; empty if there are none with names of joints.
    """
    matches = ((i, _ELEMENT.fullmatch(name)) for i, name in enumerate(names))
    found = {(match[1], int(match[2])): i for i, match in matches if match}
    return found if any(field == "name" for field, _ in found) else {}


def read_header(names: Sequence[str]) -> Header:
    """Times and joints among columns.

    ``./arm record`` writes names such as ``position.elbow``. Equivalent names are accepted:
    ``elbow_position``, ``q_elbow [rad]``, ``/joint_states/elbow/position``, and numbered names
    such as ``q1``, which stands for ``joint1`` (``q0`` if they begin with 0). Units in brackets
    are recognized.

    Args:
        names: Names of the columns.

    Raises:
        InvalidInput: If two columns are the same quantity of a joint.
    """
    clock, found = None, dict[tuple[str, str], Column]()
    for place, name in enumerate(names):
        bare, unit = _unit(name)
        if clock is None and (factor := _clock(bare, unit)):
            clock = Column(place, factor)
        elif (what := _part(bare)) and unit in _UNITS:
            if what in found:
                raise InvalidInput(
                    f"columns '{names[found[what].place]}' and '{name}' are both the {what[0]} of "
                    f"joint '{what[1]}'; one is expected"
                )
            found[what] = Column(place, _UNITS[unit])
    numbers = [int(joint) for _, joint in found if joint.isdecimal()]
    first = 1 - min(numbers, default=1) if 0 in numbers else 0
    found = {
        (part, f"joint{int(joint) + first}" if joint.isdecimal() else joint): column
        for (part, joint), column in found.items()
    }
    joints = tuple(dict.fromkeys(joint for part, joint in found if part == PARTS[0]))
    return Header(clock, joints, found)


def _unit(name: str) -> tuple[str, str]:
    """A name without its unit in brackets, and the unit."""
    match = re.fullmatch(r"(.*?)\s*[\[(]([^\])]*)[\])]", name.strip())
    return (match[1], match[2].strip().lower()) if match else (name.strip(), "")


def _clock(name: str, unit: str) -> float | None:
    """Seconds per unit of a time column; None if it is not one."""
    match = re.fullmatch(rf"{_CLOCKS}(?:_(s|sec|ms|us|ns))?", name.lower())
    of_ros = "ns" if name.startswith("%") else "s"
    return _TIMES.get(match[1] or unit or of_ros) if match else None


def _part(name: str) -> tuple[str, str] | None:
    """The joint and quantity of a column."""
    for part in PARTS:
        if name.startswith(f"{part}."):
            return part, name.removeprefix(f"{part}.")
    for part, words in _WORDS.items():
        either = "|".join(words)
        if match := re.fullmatch(rf"(?:{either})[._/ -]?(\d+)", name, re.IGNORECASE):
            return part, match[1]
        if match := re.fullmatch(rf"(?:{either})[._/ -](.+)", name, re.IGNORECASE):
            return part, match[1]
        if match := re.fullmatch(rf"(.+)[._/ -](?:{either})", name, re.IGNORECASE):
            return part, match[1].rpartition("/")[2]
    return None
