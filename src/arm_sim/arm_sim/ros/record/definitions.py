# SPDX-License-Identifier: Apache-2.0
"""Message types by name, and their definitions as in bags: the type's own, and those it uses."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from arm_dynamics.exceptions import InvalidInput

_FIELD = re.compile(r"^\s*([a-zA-Z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?\s+\w+")
_PLAIN = {
    "bool", "byte", "char", "float32", "float64", "int8", "uint8", "int16", "uint16", "int32",
    "uint32", "int64", "uint64", "string", "wstring",
}  # fmt: skip


def kind_of(type_: Any) -> str:
    """Name of a generated message type, such as ``sensor_msgs/msg/JointState``."""
    package, _, rest = type_.__module__.partition(".")
    return f"{package}/{rest.split('.')[0]}/{type_.__name__}"


def type_of(kind: str) -> Any:
    """The class of a type such as ``sensor_msgs/msg/JointState``; None if it is not installed."""
    package, _, rest = kind.partition("/")
    try:
        module = importlib.import_module(  # noqa: TID251 - a name that files and the graph tell
            f"{package}.{rest.rpartition('/')[0].replace('/', '.') or 'msg'}"
        )
        return getattr(module, kind.rpartition("/")[2])
    except (ImportError, AttributeError, ValueError):
        return None


def definition_of(kind: str) -> str:
    """The definition of a type and of all types that it contains (format ``ros2msg`` of MCAP).

    Raises:
        InvalidInput: If its definition is not installed.
    """
    package, _, name = kind.split("/")
    texts = {kind: _text(package, name)}
    waiting = [(package, texts[kind])]
    for inside, text in waiting:
        for part in _parts(inside, text):
            if part not in texts:
                texts[part] = _text(*part.split("/"))
                waiting.append((part.split("/")[0], texts[part]))
    own = texts.pop(kind)
    rule = "=" * 80
    return "\n".join([own, *(f"{rule}\nMSG: {part}\n{text}" for part, text in texts.items())])


def _parts(package: str, text: str) -> list[str]:
    """Types that a definition uses, as ``package/Name``."""
    found = []
    for line in text.splitlines():
        match = _FIELD.match(line.partition("#")[0])
        if match is None or match[1] in _PLAIN:
            continue
        part = "std_msgs/Header" if match[1] == "Header" else match[1]
        found.append(part if "/" in part else f"{package}/{part}")
    return found


def _text(package: str, name: str) -> str:
    try:
        path = Path(get_package_share_directory(package)) / "msg" / f"{name}.msg"
        lines = path.read_text(encoding="utf-8").splitlines()
    except (PackageNotFoundError, OSError) as error:
        raise InvalidInput(f"no definition of '{package}/msg/{name}' is installed") from error
    bare = [line for line in lines if line.strip() and not line.lstrip().startswith("#")]
    return "\n".join(bare)
