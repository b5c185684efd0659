# SPDX-License-Identifier: Apache-2.0
"""Search for scenes and robot descriptions: paths, ``package://`` URIs, bundled scenes.

A bundled scene has a bare name, such as ``panda``. The folders of bundled scenes are those of the
variable ``ARM_SCENES``, then ``scenes`` and ``scenes/lectures`` of the package ``arm_sim``, which
ships them. That package is located, but not imported.
"""

import codecs
import logging
import os
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from arm_dynamics.exceptions import SceneError, did_you_mean, known_names, plain

# Environment variable with the user's folders of bundled scenes, separated by colons
VARIABLE = "ARM_SCENES"
_SUFFIX = ".yaml"
_PACKAGE = "arm_sim"
_BUNDLED = "scenes", "scenes/lectures"  # folders with bundled scenes in that package
_ROBOTS = "example-robot-data"  # package of PyPI with the robots of some bundled scenes
_log = logging.getLogger(__name__)


def find_scene(name: str, folder: Path) -> Path:
    """Find the existing file of a scene.

    Args:
        name: A path, a ``package://`` URI, or the bare name of a bundled scene with or without
            ``.yaml``. A file of that name in the folder comes first.
        folder: Where relative paths start.
    """
    if not name.strip() or set(name) & {"/", os.sep, "\n", "\0"}:  # it has a folder
        return find_file(name, folder)
    places = [folder / name]
    places += [ready / f for ready in scene_folders() for f in (name, name + _SUFFIX)]
    for place in places:
        if os.path.isfile(place):  # that of Path raises if a name is too long
            return place
    all_ready = ready_scenes()
    files = [path.name for path in folder.glob("*") if path.suffix in (".yaml", ".urdf", ".xacro")]
    ready = all_ready if Path(name).suffix in ("", _SUFFIX) else []
    guess = did_you_mean(name, [*files, *ready]) or did_you_mean(Path(name).stem, ready)
    listed = "." if Path(name).suffix else f". Bundled scenes: {known_names(all_ready, 60)}"
    raise SceneError(
        f"scene: no file '{plain(name)}' in {folder}, and no bundled scene of that name"
        f"{guess or listed}"
    )


def find_file(name: str, folder: Path) -> Path:
    """Find the existing file of a path or ``package://`` URI; relative paths start in a folder."""
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
        places = [folder / os.path.expanduser(name.removeprefix("file://"))]
    for place in places:
        if os.path.isfile(place):
            return place
    for place in filter(os.path.exists, places):
        kind = "a folder" if place.is_dir() else "a pipe or a device"
        raise SceneError(f"scene: '{place}' is {kind}; a file is expected")
    siblings = places[0].parent.glob("*") if places and os.path.isdir(places[0].parent) else ()
    guess = did_you_mean(Path(name).name, [path.name for path in siblings if path.is_file()])
    raise SceneError(
        f"scene: no file '{plain(name)}'; searched: {known_names(map(str, places), 4)}{guess}"
    )


def file_text(
    path: Path, file: str = "scene", expected: str = "a scene (YAML) or a robot description (URDF)"
) -> str:
    """The text of a file in UTF-8, in UTF-16 with its mark, or else in Latin-1, with a warning.

    ``file`` and ``expected`` say in messages what it is to be, and in which formats.
    """
    try:
        with path.open("rb") as stream:
            marked = stream.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
        try:
            text, is_unicode = path.read_text("utf-16" if marked else "utf-8-sig"), True
        except UnicodeError:
            text, is_unicode = path.read_text("latin-1"), False
    except OSError as error:
        raise SceneError(f"{file}: cannot read '{path}': {error.strerror or error}") from None
    if "\0" in text:
        raise SceneError(f"{file}: '{path}' is not text; {expected} is expected")
    if not is_unicode:
        _log.warning("'%s' is not UTF-8: read as Latin-1", path)
    return text


def scene_folders() -> list[Path]:
    """The folders of bundled scenes, in the order in which they are searched."""
    listed = os.environ.get(VARIABLE, "").split(os.pathsep)
    shipped = [root / _PACKAGE / inside for root in _parents(_PACKAGE) for inside in _BUNDLED]
    return [*(Path(os.path.expanduser(entry)) for entry in listed if entry), *shipped]


def ready_scenes() -> list[str]:
    """The bare names of all bundled scenes, sorted."""
    files = (path for folder in scene_folders() for path in folder.glob(f"*{_SUFFIX}"))
    return sorted({path.stem for path in files})


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
        *_parents(package),
    ]


def _parents(package: str) -> Iterator[Path]:
    """Folders that contain a Python package, however it is installed, without importing it."""
    spec = find_spec(package) if package.isidentifier() else None
    for place in (spec and spec.submodule_search_locations) or ():
        yield Path(place).parent
