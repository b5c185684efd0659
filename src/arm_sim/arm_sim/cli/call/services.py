# SPDX-License-Identifier: Apache-2.0
"""The table of the commands of ``./arm call``, and the service files that describe them.

The comment of a field is read, too: its shape ``k*n``, its units ``[rad, m]``, and after
``; empty:`` or ``; default:`` what holds without it. k counts points, n joints, and m is the
length of a list of names whose comment says m.
"""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

DYNAMICS, SIM = "dynamics", "sim"  # nodes, and the commands that start them

# The service files of arm_msgs are linked and packaged beside this file: help needs no ROS. Where
# a distribution builds each package alone, the link leads nowhere and arm_msgs is installed.
_HERE = Path(__file__).with_name("srv")
_PREFIXES = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
_FOLDERS = (_HERE, *(Path(prefix) / "share/arm_msgs/srv" for prefix in _PREFIXES))
FILES = next((folder for folder in _FOLDERS if folder.is_dir()), _HERE)

_FIELD = re.compile(r"([\w/]+(?:\[\d*\])?) +(\w+)(?: +([^#\s=][^#]*?))? *(?:# *(.*))?")
_CONSTANT = re.compile(r"uint\d+ +([A-Z]\w*) *= *(\d+)")
_SHAPE = re.compile(r"\b[kmn](?:\*[kmn\d])*\b")
_UNITS = re.compile(r"\[([^]]*)\]")
_EMPTY = re.compile(r"; (?:empty|default): ([^;]+)")


class Field(NamedTuple):
    """A field of a request or a response.

    Attributes:
        type: Its type, such as ``float64[]``.
        name: Its name.
        default: The default as written, empty for none.
        text: The comment.
    """

    type: str
    name: str
    default: str
    text: str

    @property
    def shape(self) -> tuple[str, ...]:
        """Dimensions of an array of any length: k, n, m or numbers; empty if none are named."""
        match = _SHAPE.search(_UNITS.sub("", self.text)) if self.type.endswith("[]") else None
        return tuple(match[0].split("*")) if match else ()

    @property
    def units(self) -> tuple[str, ...]:
        """Units, those of revolute joints first and those of prismatic ones last."""
        match = _UNITS.search(self.text)
        return tuple(match[1].replace("^2", "²").split(", ")) if match else ()

    @property
    def required(self) -> bool:
        """Whether a request must contain it."""
        return not (self.default or self.type == "bool" or _EMPTY.search(self.text))

    @property
    def about(self) -> str:
        """The comment without the shape."""
        text = _SHAPE.sub("", self.text, count=1) if self.shape else self.text
        return text.replace("^2", "²").lstrip(" :,")

    @property
    def help(self) -> str:
        """The comment as help of an option."""
        text = _EMPTY.sub(r"; \1 when omitted", self.about)
        return text[:1].upper() + text[1:]


@dataclass(frozen=True)
class Service:
    """A command: a service and a node that offers it.

    Attributes:
        command: Name of the command, with underscores.
        node: The node, ``DYNAMICS`` or ``SIM``.
        examples: Arguments of examples, one on each line.
        outcome: Sentence with the fields of request and response, printed instead of a table.
        once: Whether the request must not be repeated.
        name: Name of the service, by default that of the command.
        fields: Fields of the request and the response that the command has; all if empty.
        sends: Fields with fixed values.
        text: Help where no file of ``arm_msgs`` describes the command.
    """

    command: str
    node: str
    examples: str = ""
    outcome: str = ""
    once: bool = False
    name: str = ""
    fields: tuple[str, ...] = ()
    sends: Mapping[str, Any] = field(default_factory=dict)
    text: str = ""

    @cached_property
    def _parts(self) -> tuple[str, str]:
        """Text of the request and of the response, empty for standard services."""
        if self.text and not self.fields:
            return "", ""
        file = FILES / f"{(self.name or self.command).title().replace('_', '')}.srv"
        request, _, response = file.read_text(encoding="utf-8").partition("---\n")
        return request, response

    @property
    def help(self) -> str:
        """The first paragraph of the file, up to a line without text."""
        lines = self._parts[0].splitlines()
        end = next((i for i, line in enumerate(lines) if line in ("", "#")), len(lines))
        return self.text or " ".join(line.lstrip("# ") for line in lines[:end])

    @property
    def short_help(self) -> str:
        """The part of the help before a formula or details."""
        return re.split(r": |\. |\.$", self.help)[0] + "."

    @cached_property
    def request(self) -> list[Field]:
        """Fields of the request."""
        return self._fields(self._parts[0])

    @cached_property
    def response(self) -> list[Field]:
        """Fields of the response, but success and message."""
        fields = self._fields(self._parts[1])
        return [field for field in fields if field.name not in ("success", "message")]

    def _fields(self, text: str) -> list[Field]:
        """Fields that the lines of a text define and the command has."""
        matches = (_FIELD.fullmatch(line.strip()) for line in text.splitlines())
        fields = [Field(*(part or "" for part in match.groups())) for match in matches if match]
        return [field for field in fields if not self.fields or field.name in self.fields]

    @property
    def bits(self) -> dict[str, int]:
        """Constants of the request, which are bits of a number."""
        return {name.lower(): int(bit) for name, bit in _CONSTANT.findall(self._parts[0])}


_READY = '--position "0 -0.8 0 -2.4 0 1.6 0.8"'
_CLOSED = '--position "0 0.6 -0.6 0.6 0.6 -0.6 0.6"'

MODEL_INFO = Service("model_info", DYNAMICS)

SERVICES = (
    Service("constrained_dynamics", DYNAMICS, f'{_CLOSED} --effort "left_driver_joint=0.1"\n'
            f'{_CLOSED} --inverse --acceleration "wrist=2"'),
    Service("dynamics_terms", DYNAMICS, f"{_READY} --json"),
    Service("forward_dynamics", DYNAMICS, _READY),
    Service("inverse_dynamics", DYNAMICS, '--position "panda_joint2=-0.8 panda_joint4=-2.4"'),
    Service("inverse_kinematics", DYNAMICS, '--frame panda_hand --pose "0.4 0.2 0.5 1 0 0 0"\n'
            '--frame panda_hand --axes position --pose "[[0.4, 0, 0.5, 0, 0, 0, 1]]"', once=True),
    MODEL_INFO,
    Service("pose", DYNAMICS, f"--frame panda_hand {_READY}", name="task_space",
            fields=("joint_names", "position", "frame", "pose"),
            text="Pose of a frame of the arm in the world."),
    Service("task_space", DYNAMICS, f"--frame panda_hand {_READY}\n"
            '--frame panda_hand --axes "x y z" --direction "0 0 1" --position "panda_joint4=-2"'),
    Service("pause", SIM, sends={"data": True}, outcome="paused", text="Pause the simulation."),
    Service("reset", SIM, outcome="reset to the initial state at time zero",
            text="Reset the simulation to its initial state and time zero."),
    Service("reset_counters", SIM, outcome="counters reset",
            text="Reset the counters of the loop, of commands and of answers to zero."),
    Service("resume", SIM, name="pause", sends={"data": False}, outcome="running",
            text="Resume a paused simulation."),
    Service("set_friction", SIM, '--viscous "panda_joint4=0.5"', "friction of {joints} set"),
    Service("set_joint_state", SIM, '--position "panda_joint4=-1.5"', "{joints} set"),
    Service("set_payload", SIM, '--mass 1.5 --com "0 0 0.05"', "payload {index} has {mass:g} kg"),
    Service("step", SIM, "100", "advanced to t = {time:.6g} s", once=True),
)  # fmt: skip
