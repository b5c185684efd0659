# SPDX-License-Identifier: Apache-2.0
"""Search for scenes and robot descriptions: paths, ``package://`` URIs, ready scenes.

A ready scene has a bare name, such as ``panda``. The folders of ready scenes are those of the
variable ``ARM_SCENES``, then ``scenes`` and ``scenes/lectures`` of the package ``arm_sim``, which
ships them. That package is located, but not imported.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from arm_dynamics.exceptions import SceneError, did_you_mean, known_names

VARIABLE = "ARM_SCENES"
"""Environment variable with the user's folders of ready scenes, separated by colons."""
_SUFFIX = ".yaml"
_PACKAGE = "arm_sim"
_SHIPPED = "scenes", "scenes/lectures"  # folders with ready scenes in that package
_ROBOTS = "example-robot-data"  # package of PyPI with the robots of some ready scenes


def find_scene(name: str, folder: Path) -> Path:
    """Find the file of a scene.

    Args:
        name: A path, a ``package://`` URI, or the bare name of a ready scene with or without
            ``.yaml``. A file of that name in the folder comes first.
        folder: Where relative paths start.

    Returns:
        An existing file.

    Raises:
        SceneError: If there is none, with similar names.
    """
    if not _is_bare(name):
        return find_file(name, folder)
    places = [folder / name]
    places += [ready / f for ready in scene_folders() for f in (name, name + _SUFFIX)]
    for place in places:
        if place.is_file():
            return place
    known = ready_scenes()
    files = [path.name for path in folder.glob("*") if path.suffix in (".yaml", ".urdf", ".xacro")]
    guess = did_you_mean(name, [*files, *known]) or did_you_mean(Path(name).stem, known) or "."
    raise SceneError(
        f"scene: no file '{name}' in {folder}, and no ready scene of that name{guess} "
        f"Ready scenes: {known_names(known, 60)}"
    )


def find_file(name: str, folder: Path) -> Path:
    """Resolve a path or ``package://`` URI.

    Args:
        name: The name as given by the user.
        folder: Where relative paths start.

    Returns:
        An existing file.

    Raises:
        SceneError: If there is none, with the places that were searched.
    """
    if name.startswith("package://"):
        inside = Path(name.removeprefix("package://"))
        package = inside.parts[0] if inside.parts else ""
        roots = _package_roots(package)
        places = [root / inside for root in roots]
        if package == _ROBOTS and not any((root / _ROBOTS).is_dir() for root in roots):
            raise SceneError(
                f"scene: no robots of {_ROBOTS} here, for '{name}'; pip install {_ROBOTS}"
            )
    elif "\n" in name or "\0" in name or not name.strip():
        raise SceneError(f"scene: {name[:60]!r} is neither URDF text nor the name of a file")
    else:
        places = [folder / Path(name.removeprefix("file://")).expanduser()]
    for place in places:
        if place.is_file():
            return place
    beside = places[0].parent.glob("*") if places and places[0].parent.is_dir() else ()
    guess = did_you_mean(Path(name).name, [path.name for path in beside if path.is_file()])
    raise SceneError(
        f"scene: no file '{name}'; searched: {known_names(map(str, places), 4)}{guess}"
    )


def scene_folders() -> list[Path]:
    """The folders of ready scenes, in the order in which they are searched."""
    listed = os.environ.get(VARIABLE, "").split(os.pathsep)
    shipped = [root / _PACKAGE / inside for root in _beside(_PACKAGE) for inside in _SHIPPED]
    return [*(Path(entry).expanduser() for entry in listed if entry), *shipped]


def ready_scenes() -> list[str]:
    """The bare names of all ready scenes, sorted."""
    files = (path for folder in scene_folders() for path in folder.glob(f"*{_SUFFIX}"))
    return sorted({path.stem for path in files})


def _is_bare(name: str) -> bool:
    """Whether it contains no folder, so that it may be the name of a ready scene."""
    return bool(name.strip()) and not set(name) & {"/", os.sep, "\n", "\0"}


def _package_roots(package: str) -> list[Path]:
    """Folders whose subfolders are packages: of ROS, of wheels with robots, then of Python."""
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    workspaces = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
    wheels = [Path(entry) / "cmeel.prefix/share" for entry in sys.path if entry]
    return [
        *(Path(prefix) / "share" for prefix in prefixes if prefix),
        *(Path(workspace) for workspace in workspaces if workspace),
        *wheels,
        *(wheel / _ROBOTS / "robots" for wheel in wheels),
        *_beside(package),
    ]


def _beside(package: str) -> Iterator[Path]:
    """Folders that contain a Python package, however it is installed, without importing it."""
    spec = find_spec(package) if package.isidentifier() else None
    for place in (spec and spec.submodule_search_locations) or ():
        yield Path(place).parent
