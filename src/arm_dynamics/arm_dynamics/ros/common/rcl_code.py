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


def build_with_rcl(source: Path, *packages: str, after: Sequence[Path] = ()) -> ctypes.CDLL:
    """Compile a file that calls rcl.

    Args:
        source: The file.
        packages: Further packages whose headers it includes.
        after: Files that are appended to it.

    Returns:
        The loaded library.

    Raises:
        KernelError: If there is no compiler, or it refuses the code.
        PackageNotFoundError: If a package is not installed.
    """
    names = (*_HEADERS, *packages)
    prefixes = {name: Path(get_package_prefix(name)) for name in names}
    folders = (f"-I{prefix / 'include' / name}" for name, prefix in prefixes.items())
    called = (str(prefixes[name] / f"lib/lib{name}.so") for name in _CALLED)
    text = "\n".join(path.read_text() for path in (source, *after))
    return build(text, flags=(*FLAGS, "-Wl,--no-as-needed"), local=(*folders, *called)).library


def find_with_rcl(source: Path, *packages: str, after: Sequence[Path] = ()) -> ctypes.CDLL | None:
    """As ``build_with_rcl``; None if the code cannot be compiled."""
    if not may_build():
        return None
    try:
        return build_with_rcl(source, *packages, after=after)
    except (KernelError, PackageNotFoundError, OSError) as error:
        _log.debug("%s cannot be compiled, Python is used instead: %s", source.name, error)
        return None
