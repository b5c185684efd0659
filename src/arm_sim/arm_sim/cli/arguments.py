# SPDX-License-Identifier: Apache-2.0
"""Types of arguments that several commands take, with their ranges and their help."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import click

from arm_dynamics.exceptions import choices
from arm_sim.cli.completion import SCENE


class Pair(click.ParamType):
    """A word and its value: ``elbow=axis_2``.

    Args:
        name: What help shows: ``JOINT=NAME``.
        value: Reads the value.
    """

    def __init__(self, name: str, value: Callable[[str], Any] = str) -> None:
        self.name, self._value = name, value

    def convert(self, value: str, param: Any, ctx: Any) -> tuple[str, Any]:
        """Split it, or fail with what is expected."""
        name, _, text = value.partition("=")
        if not (name and text):
            self.fail(f"'{value}'; {self.name} is expected", param, ctx)
        try:
            return name, self._value(text)
        except ValueError:
            self.fail(f"'{value}': a number is expected", param, ctx)


class FileNamed(click.Path):
    """A file to write, whose name has one of some endings."""

    def __init__(self, *suffixes: str) -> None:
        super().__init__(dir_okay=False, path_type=Path)
        self._suffixes = suffixes

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """The path, or a failure that names the endings."""
        path = Path(value)
        if path.suffix not in self._suffixes:
            allowed = choices(path.suffix, self._suffixes)
            self.fail(f"'{path}' ends in '{path.suffix}'; allowed: {allowed}", param, ctx)
        return super().convert(value, param, ctx)


Scene = Annotated[str, SCENE]
RobotScene = Annotated[str, SCENE, "Scene, for a recording of a robot, which has none."]
BagTopic = Annotated[str, "Topic of the joint states, if a bag has several."]
File = Annotated[Path, click.Path(dir_okay=False, path_type=Path)]
Figure = Annotated[
    Path, FileNamed(".png", ".pdf", ".svg", ".jpg"), "Figure to write (.png, .pdf or .svg)."
]
YamlFile = Annotated[Path, FileNamed(".yaml", ".yml")]
Positive = Annotated[float, click.FloatRange(0.0, min_open=True)]
NotNegative = Annotated[float, click.FloatRange(0.0)]
Count = Annotated[int, click.IntRange(1)]
Share = Annotated[float, click.FloatRange(0.0, 1.0, min_open=True)]
Seconds = Annotated[float, click.FloatRange(0.0, 3600.0, min_open=True)]
Timeout = Annotated[float, click.FloatRange(0.1), "How long to wait for the node, in s."]
Band = Annotated[Positive, "Cut-off of the low-pass filter in Hz.  [default: from the noise]"]
Json = Annotated[bool, "--json", "Print JSON."]
Pairs = tuple[tuple[str, Any], ...]
