# SPDX-License-Identifier: Apache-2.0
"""Message types by name, and their definitions as in bags: the type's own, and those it uses."""

import importlib
import re
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from arm_dynamics.exceptions import InvalidInput


def kind_of(type_: Any) -> str:
    """Name of a generated message type, such as ``sensor_msgs/msg/JointState``."""
    package, _, rest = type_.__module__.partition(".")
    return f"{package}/{rest.split('.')[0]}/{type_.__name__}"


def type_of(kind: str) -> Any:
    """The class of a type such as ``sensor_msgs/msg/JointState``; None if it is not installed."""
    package, _, rest = kind.partition("/")
    folder, _, name = rest.rpartition("/")
    module = f"{package}.{folder.replace('/', '.') or 'msg'}"
    try:
        return getattr(importlib.import_module(module), name)  # noqa: TID251 - named by files
    except (ImportError, AttributeError, ValueError):
        return None


def definition_of(kind: str) -> str:
    """The definition of a type and of all types that it contains (format ``ros2msg`` of MCAP).

    Raises:
        InvalidInput: If its definition is not installed.
    """
    kinds, rule = [kind], "=" * 80
    for member in kinds:  # grows by the types of its fields
        kinds += [used for used in _field_types(member) if used not in kinds]
    texts = (f"\n{rule}\nMSG: {used.replace('/msg/', '/')}\n{_text(used)}" for used in kinds[1:])
    return "".join([_text(kind), *texts])


def _field_types(kind: str) -> list[str]:
    """Message types of the fields of a type, in order; none if it is not installed."""
    type_ = type_of(kind)
    fields = type_.get_fields_and_field_types().values() if type_ else ()
    found = re.findall(r"(\w+)/(\w+)", " ".join(fields))
    return [f"{package}/msg/{name}" for package, name in dict.fromkeys(found)]


def _text(kind: str) -> str:
    package, _, name = kind.split("/")
    try:
        path = Path(get_package_share_directory(package)) / "msg" / f"{name}.msg"
        lines = path.read_text(encoding="utf-8").splitlines()
    except (PackageNotFoundError, OSError) as error:
        raise InvalidInput(f"no definition of '{kind}' is installed") from error
    bare = [line for line in lines if line.strip() and not line.lstrip().startswith("#")]
    return "\n".join(bare)
