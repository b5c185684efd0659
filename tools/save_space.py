# SPDX-License-Identifier: Apache-2.0
"""Makes a virtual environment smaller, without removing anything that Python needs.

``python tools/save_space.py ENVIRONMENT``, which ``./arm`` runs after it has installed packages.
Wheels cannot contain symbolic links, so each shared library exists under up to three names; equal
files are replaced by hard links. Files that only C++ needs are removed, and
so are the meshes of walking and flying robots in example-robot-data, since the suite has no
floating base; their descriptions are kept.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator
from hashlib import sha256
from pathlib import Path

SMALL = 20_000  # [bytes], below which a link saves nothing worth it
HEADERS = ("cmeel.prefix/include", "casadi/include")
ROBOTS = "cmeel.prefix/share/example-robot-data/robots"
NO_ARMS = (
    "a1", "alex", "alexander", "anymal_b_simple", "anymal_c_simple", "b1", "bolt", "borinot",
    "cassie", "centauro", "g1", "go1", "go2", "hector", "hextilt", "human", "icub", "iris",
    "laikago", "romeo", "solo", "talos",
)  # fmt: skip
MESHES = (".dae", ".obj", ".stl")


def equal_files(root: Path) -> Iterator[list[Path]]:
    """Groups of large files with the same content, permissions and owner."""
    by_size: dict[tuple[int, ...], list[Path]] = defaultdict(list)
    for folder, _, names in os.walk(root):
        for path in (Path(folder, name) for name in names):
            about = path.lstat()
            if not path.is_symlink() and about.st_size > SMALL:
                by_size[about.st_size, about.st_mode, about.st_uid, about.st_dev].append(path)
    for paths in by_size.values():
        by_content: dict[str, list[Path]] = defaultdict(list)
        for path in paths if len(paths) > 1 else ():
            by_content[sha256(path.read_bytes()).hexdigest()].append(path)
        yield from (group for group in by_content.values() if len(group) > 1)


def link(groups: Iterable[list[Path]]) -> int:
    """Make hard links of equal files; how many bytes that freed.

    Each link is made beside its place and moved there, so that no file is missing at any time.
    """
    freed = 0
    for first, *others in groups:
        for other in others:
            if first.samefile(other):
                continue
            new = other.with_name(f".{other.name}.link")
            os.link(first, new)
            freed += other.stat().st_size
            new.replace(other)
    return freed


def remove_meshes(robots: Path) -> None:
    """Remove the meshes of robots that walk or fly."""
    for name in NO_ARMS:
        for folder in robots.glob(f"{name}_d*"):  # _description or _data
            for path in folder.rglob("*"):
                if path.suffix.lower() in MESHES:
                    path.unlink()


def main(environment: Path) -> None:
    """Save what can be saved and say how much."""
    for packages in (environment / "lib").glob("python3*/site-packages"):
        for folder in HEADERS:
            shutil.rmtree(packages / folder, ignore_errors=True)
        for library in (packages / "casadi").glob("*.a"):
            library.unlink()
        remove_meshes(packages / ROBOTS)
    freed = link(equal_files(environment / "lib"))
    print(f"equal files linked: {freed / 1e6:.0f} MB less")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
