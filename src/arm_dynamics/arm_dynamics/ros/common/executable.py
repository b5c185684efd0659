# SPDX-License-Identifier: Apache-2.0
"""Command line of the nodes' executables: a scene, ROS arguments, --help."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Sequence
from textwrap import fill
from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter

from arm_dynamics.exceptions import InvalidInput, plain
from arm_dynamics.ros.common.executor import run
from arm_dynamics.ros.common.params import listed

_ROS = "--ros-args"
_HELP = {"-h", "--help"}
_WIDTH = 98
Words = tuple[str, ...]


def execute(
    kind: type[Node], params: type, args: Sequence[str] | None = None, **options: Any
) -> int:
    """Run a node as an executable: ``NAME [SCENE] [--ros-args …]``, or print its ``--help``.

    Args:
        kind: The node's class.
        params: The dataclass of its parameters.
        args: Command line without the program's name; None for that of the process.
        **options: For the constructor of the node.

    Returns:
        The exit status: 0 after a clean end, 2 when the node could not start, with the reason on
        stderr.
    """
    words = tuple(sys.argv[1:] if args is None else args)
    if _HELP & set(words[: _end(words)]):
        print(usage(kind, params))
        return 0
    try:
        scene, rest = split_words(words)
    except InvalidInput as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    chosen = [Parameter("scene", value=scene)] if scene else []
    return run(lambda **about: kind(parameter_overrides=chosen, **options, **about), list(rest))


def split_words(words: Words) -> tuple[str | None, Words]:
    """Separate the scene from ROS arguments.

    Raises:
        InvalidInput: If a word is neither.
    """
    end = _end(words)
    before = words[:end]
    for i, word in enumerate(before):
        if i or word.startswith("-") or ":=" in word:
            raise InvalidInput(
                f"'{plain(word, 80)}' is neither the scene nor behind {_ROS}; allowed: SCENE, "
                f"then for example {_ROS} {_suggested(before)}"
            )
    return (before[0] if before else None), words[end:]


def _suggested(words: Words) -> str:
    """The first ROS argument among words, as it is written behind --ros-args."""
    rule = next((plain(word, 80) for word in words if ":=" in word), "NAME:=VALUE")
    flag = "-r" if rule.startswith("__") or "-r" in words else "-p"
    return f"{flag} {re.sub('^__ns:=(?!/)', '__ns:=/', rule)}"


def _end(words: Words) -> int:
    """Index of the first ROS argument."""
    return words.index(_ROS) if _ROS in words else len(words)


def usage(kind: type[Node], params: type) -> str:
    """Usage, description and parameters with their defaults."""
    name = kind.__name__.removesuffix("Node").lower()
    about = (inspect.getdoc(kind) or "").split("\n\nAttributes:")[0]
    lines = [
        f"usage: {name} [SCENE] [{_ROS} -p NAME:=VALUE … -r __ns:=/NAMESPACE …]",
        "",
        about,
        "",
        "SCENE is the name of a ready scene such as panda, a scene file, a URDF, or a package:// "
        "URI;",
        "it sets the parameter 'scene'.",
        "",
        "parameters, with their defaults:",
    ]
    for parameter, default, descriptor in listed(params):
        allowed = f" [{', '.join(descriptor['choices'])}]" if descriptor.get("choices") else ""
        lines.append(f"  {parameter} = {default!r}")
        text = fill(descriptor["description"] + allowed, _WIDTH - 6)
        lines += [f"      {line}" for line in text.split("\n")]
    return "\n".join(lines)
