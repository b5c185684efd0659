# SPDX-License-Identifier: Apache-2.0
"""The command line of a node: its scene, its ROS arguments, and its help."""

import inspect
import re
from textwrap import fill

from rclpy.node import Node

from arm_dynamics.exceptions import InvalidInput, plain
from arm_dynamics.ros.common.params import listed

type Words = tuple[str, ...]
_ROS = "--ros-args"
_HELP = {"-h", "--help"}
_WIDTH = 98  # columns of the help
_INDENT = 6 * " "  # of a parameter's description
_SCENE = (
    "SCENE is the name of a bundled scene such as panda, a scene file, a URDF, or a package:// "
    "URI; it sets the parameter 'scene'."
)


def asks_for_help(words: Words) -> bool:
    """Whether help is requested, before the ROS arguments."""
    return bool(_HELP & set(words[: _count_before_ros(words)]))


def split_words(words: Words) -> tuple[str | None, Words]:
    """Separate the scene from ROS arguments.

    Raises:
        InvalidInput: If a word is neither.
    """
    count = _count_before_ros(words)
    before = words[:count]
    for i, word in enumerate(before):
        if i or word.startswith("-") or ":=" in word:
            rule = next((plain(word, 80) for word in before if ":=" in word), "NAME:=VALUE")
            flag = "-r" if rule.startswith("__") or "-r" in before else "-p"
            rule = re.sub("^__ns:=(?!/)", "__ns:=/", rule)
            raise InvalidInput(
                f"'{plain(word, 80)}' is neither the scene nor behind {_ROS}; allowed: SCENE, "
                f"then for example {_ROS} {flag} {rule}"
            )
    return (before[0] if before else None), words[count:]


def _count_before_ros(words: Words) -> int:
    """Number of words before the ROS arguments."""
    return words.index(_ROS) if _ROS in words else len(words)


def usage(kind: type[Node], params: type) -> str:
    """Usage, description and parameters with their defaults."""
    name = kind.__name__.removesuffix("Node").lower()
    synopsis = f"usage: {name} [SCENE] [{_ROS} -p NAME:=VALUE … -r __ns:=/NAMESPACE …]"
    about = (inspect.getdoc(kind) or "").split("\n\nAttributes:")[0]
    lines = [synopsis, "", about, "", fill(_SCENE, _WIDTH), "", "parameters, with their defaults:"]
    for parameter, default, descriptor in listed(params):
        allowed = f" [{', '.join(descriptor['choices'])}]" if descriptor.get("choices") else ""
        lines.append(f"  {parameter} = {default!r}")
        text = descriptor["description"] + allowed
        lines.append(fill(text, _WIDTH, initial_indent=_INDENT, subsequent_indent=_INDENT))
    return "\n".join(lines)


def reason(error: RuntimeError) -> str:
    """Why ROS refuses its arguments: its error message without references to its source lines."""
    text = str(error).split(", at /")[0]
    rule = re.search(r"(?:override|remap) rule: ('.*?')\.|^\[(.*)\]$", text)
    if rule is None:
        return text
    return (
        f"{rule[1] or rule[2]} is no ROS argument; expected -p NAME:=VALUE, such as -p dt:=0.001, "
        "or -r NAME:=NEW, such as -r __ns:=/left"
    )
