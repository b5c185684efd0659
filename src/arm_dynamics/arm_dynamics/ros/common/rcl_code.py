# SPDX-License-Identifier: Apache-2.0
"""C code of the nodes that calls rcl and needs its headers and a compiler."""

import ctypes
from collections.abc import Sequence
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_prefix

from arm_dynamics.codegen.compiler import FLAGS, build
from arm_dynamics.codegen.header import Header
from arm_dynamics.exceptions import ARM, CompilerMissing, KernelError

# Packages whose headers are included by those of rcl.
_HEADERS = (
    "rcl", "rcl_yaml_param_parser", "rcutils", "rmw", "rosidl_dynamic_typesupport",
    "rosidl_runtime_c", "rosidl_typesupport_interface", "type_description_interfaces",
    "service_msgs", "builtin_interfaces",
)  # fmt: skip
_LIBRARIES = ("rcl", "rcutils", "rosidl_runtime_c")
_REMEDY = (
    "install a compiler (apt install gcc), or compile the nodes on another machine "
    f"({ARM} build SCENE --nodes --out DIR) and set ARM_CACHE=DIR"
)


def code_of_nodes(
    *files: Path, headers: Sequence[Header], packages: Sequence[str] = (),
    folders: Sequence[Path] = (),
) -> ctypes.CDLL:  # fmt: skip
    """Compile C files that call rcl, as one unit, and load it.

    ``headers`` declare the functions that Python calls; ``packages`` and ``folders`` contain
    further ones that the files include.

    Raises:
        KernelError: If there is neither a compiler nor code compiled elsewhere, a package is not
            installed, or the compiler refuses the code.
    """
    try:
        prefixes = {name: Path(get_package_prefix(name)) for name in (*_HEADERS, *packages)}
    except PackageNotFoundError as error:
        raise KernelError(f"nodes need the headers of ROS: {error}") from error
    places = [prefix / "include" / name for name, prefix in prefixes.items()]
    places += [*dict.fromkeys(file.parent for file in files), *folders]
    libraries = (str(prefixes[name] / f"lib/lib{name}.so") for name in _LIBRARIES)
    flags = (*FLAGS, "-Wl,--no-as-needed")
    local = (*(f"-I{place}" for place in places), *libraries)
    try:
        library = build(
            "\n".join(file.read_text(encoding="utf-8") for file in files), "c", flags, local
        ).library
    except CompilerMissing as error:
        raise CompilerMissing(f"nodes need compiled code: {error}; {_REMEDY}") from error
    for header in headers:
        header.bind(library)
    return library
