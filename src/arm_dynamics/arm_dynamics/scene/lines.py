# SPDX-License-Identifier: Apache-2.0
"""Text of scene files: their content, and the lines of keys."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from arm_dynamics.exceptions import SceneError

_PLACE = re.compile(r"'([^' ]+)'")
_NOT_DECIMAL = re.compile(r"[-+]?0[0-7_]*[0-7]|.*:.*")  # 010 is 8 in YAML 1.1, and 1:30 is 90
_DIGITS = re.compile(r"[-+]?\d+(?:[eE][-+]?\d+)?")  # what a comma leaves of a decimal
LIMIT = 1_000_000  # values of a file, aliases written out
_KINDS = {list: "a list", str: "text", int: "a number", float: "a number", bool: "a truth value"}


def parse(content: str, file: str = "scene", keys: str = "'robot'") -> dict[str, Any]:
    """The content of a scene file in YAML, or of another such file.

    Args:
        content: Its text.
        file: Name of the file, for messages.
        keys: Its required keys, for messages.

    Raises:
        SceneError: If it is not well-formed, not a mapping, repeats a key, or holds a number that
            YAML reads as another one than people do, with the line.
    """
    try:
        loader = yaml.SafeLoader(content)
        node = loader.get_single_node()
        if node is not None and (size := _size(node, {})) > LIMIT:
            raise SceneError(
                f"{file}: with its aliases written out, this YAML has {size:.3g} values; at most "
                f"{LIMIT} are expected"
            )
        _refuse_traps(node, file)
        data = None if node is None else loader.construct_document(node)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f" in line {mark.line + 1}" if mark else ""
        reason = "; ".join(x for x in (error.context, error.problem) if x)
        raise SceneError(f"{file}: this is not well-formed YAML{line}: {reason}") from None
    except (yaml.YAMLError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise SceneError(f"{file}: this is not well-formed YAML: {reason}") from None
    except RecursionError:
        reason = "nested too deeply, or an alias within its own anchor"
        raise SceneError(f"{file}: this YAML cannot be used: {reason}") from None
    if isinstance(data, dict):
        return data
    content = "is empty" if data is None else f"holds {_KINDS.get(type(data), '?')}"
    raise SceneError(f"{file}: the file {content}; a mapping with {keys} is expected")


def _size(node: yaml.Node, sizes: dict[int, int]) -> int:
    """Number of values, those of a repeated alias each time."""
    if isinstance(node, yaml.ScalarNode):
        return 1
    if id(node) not in sizes:
        pairs = isinstance(node, yaml.MappingNode)
        parts = [part for pair in node.value for part in pair] if pairs else node.value
        sizes[id(node)] = 1 + sum(_size(part, sizes) for part in parts)
    return sizes[id(node)]


def _refuse_traps(node: yaml.Node | None, file: str, *place: str) -> None:
    """Refuse what YAML would silently read as something else than people do."""
    if isinstance(node, yaml.SequenceNode):
        for i, item in enumerate(node.value):
            _refuse_traps(item, file, *place, str(i))
    elif isinstance(node, yaml.MappingNode):
        # {viscous: 0,5} is viscous: 0 and a key 5 without value.
        for (key, whole), (rest, after) in pairwise(node.value if node.flow_style else ()):
            if after.value == "" and all(_DIGITS.fullmatch(str(x.value)) for x in (whole, rest)):
                raise SceneError(
                    f"{file}: '{'.'.join((*place, key.value))}' = {whole.value},{rest.value}: a "
                    f"decimal point is expected, as in {whole.value}.{rest.value}"
                )
        first_lines: dict[str, int] = {}  # of a repeated key YAML would use the last
        for key, _ in node.value:
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode):
                raise SceneError(
                    f"{file}: a key in line {line} is a list or a mapping; a name is expected"
                )
            if key.value in first_lines and key.value != "<<":
                where = ".".join((*place, key.value))
                lines = f"{first_lines[key.value]} and {line}"
                raise SceneError(
                    f"{file}: '{where}' is given twice, in lines {lines}; once is expected"
                )
            first_lines[key.value] = line
        for key, child in node.value:
            _refuse_traps(child, file, *place, key.value)
    elif isinstance(node, yaml.ScalarNode):
        is_number = node.tag.endswith((":int", ":float"))
        if is_number and _NOT_DECIMAL.fullmatch(node.value):
            raise SceneError(
                f"{file}: '{'.'.join(place)}' = {node.value}: a decimal number is expected; YAML "
                "reads a leading zero as octal, colons as sixties, a comma as a number's end"
            )


def line_of(content: str, place: str) -> int | None:
    """The line, from 1, of a key of a scene file, or of its nearest parent that exists.

    ``place`` has the keys from the top, separated by dots, as in messages. None if not even the
    first exists.
    """
    try:
        node, line = yaml.compose(content, yaml.SafeLoader), None
    except yaml.YAMLError:
        return None
    keys = place.split(".")
    while keys and (below := _step(node, keys)) is not None:
        line, node, keys = below
    return line


def _step(node: yaml.Node | None, keys: list[str]) -> tuple[int, yaml.Node, list[str]] | None:
    """Descend by one key: its line, its value, and the remaining keys."""
    if isinstance(node, yaml.SequenceNode) and keys[0].isdecimal():
        if (i := int(keys[0])) < len(node.value):
            return node.value[i].start_mark.line + 1, node.value[i], keys[1:]
        return None
    if isinstance(node, yaml.MappingNode):
        for size in range(len(keys), 0, -1):  # names of joints may contain dots
            for key, child in node.value:
                if key.value == ".".join(keys[:size]):
                    return key.start_mark.line + 1, child, keys[size:]
    return None


@contextmanager
def in_file(path: Path) -> Iterator[None]:
    """Prefix every line of a message with the file and, if known, the line of the error."""
    try:
        yield
    except SceneError as error:
        messages = str(error).split("\n")
        if messages[0].startswith(f"{path}:"):
            raise
        try:
            content = path.read_text(encoding="utf-8", errors="replace")
        except OSError:
            content = ""
        for i, message in enumerate(messages):
            key = _PLACE.search(message) if message.startswith(("scene: ", "study: ")) else None
            line = line_of(content, key[1]) if key else None
            messages[i] = f"{path}:{line}: {message}" if line else f"{path}: {message}"
        error.args = ("\n".join(messages),)
        raise
