# SPDX-License-Identifier: Apache-2.0
"""C code of the nodes that calls rcl and needs its headers and a compiler."""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Sequence
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_prefix

from arm_dynamics.codegen.compiler import FLAGS, build, may_build
from arm_dynamics.exceptions import KernelError

# Packages whose headers are included by those of rcl.
_HEADERS = (
    "rcl", "rcl_yaml_param_parser", "rcutils", "rmw", "rosidl_dynamic_typesupport",
    "rosidl_runtime_c", "rosidl_typesupport_interface", "type_description_interfaces",
    "service_msgs", "builtin_interfaces",
)  # fmt: skip
_CALLED = ("rcl", "rcutils", "rosidl_runtime_c")
_log = logging.getLogger(__name__)


def build_with_rcl(source: Path, *packages: str, after: Sequence[Path] = ()) -> ctypes.CDLL | None:
    """Compile a file that calls rcl; None if there is no compiler or a header is missing.

    Args:
        source: The file.
        packages: Further packages whose headers it includes.
        after: Files that are appended to it.
    """
    if not may_build():
        return None
    try:
        names = (*_HEADERS, *packages)
        prefixes = {name: Path(get_package_prefix(name)) for name in names}
        folders = [f"-I{prefix / 'include' / name}" for name, prefix in prefixes.items()]
        called = [str(prefixes[name] / f"lib/lib{name}.so") for name in _CALLED]
        flags = (*FLAGS, *folders, "-Wl,--no-as-needed", *called)
        text = "\n".join(path.read_text() for path in (source, *after))
        return build(text, flags=flags).library
    except (KernelError, PackageNotFoundError, OSError) as error:
        _log.debug("%s cannot be compiled, Python is used instead: %s", source.name, error)
        return None
