# SPDX-License-Identifier: Apache-2.0
"""Cleanup of Fast DDS's shared memory after processes were killed.

Each participant has segments in /dev/shm and holds a lock on each while it lives. A process that
is killed cannot release them; after killing one, call ``clear_dead``, which does the same as
``fastdds shm clean`` (which the wheels do not contain).
"""

from __future__ import annotations

import fcntl
from pathlib import Path

FOLDER = Path("/dev/shm")
SEGMENTS = ("fastrtps_", "fastdds_")
"""How the names of segments in shared memory begin: of version 2, and of 3."""
_LOCKS = ("_el", "_sl")


def clear_dead(folder: Path = FOLDER) -> int:
    """Remove the segments whose owners are gone from their folder; return their number."""
    paths = [path for begin in SEGMENTS for path in folder.glob(f"{begin}*")]
    names = {path.name.removesuffix("_el").removesuffix("_sl") for path in paths}
    return sum(_removed(folder, name) for name in sorted(names))


def _removed(folder: Path, name: str) -> bool:
    locks = [folder / f"{name}{lock}" for lock in _LOCKS]
    is_port = name.startswith(tuple(f"{begin}port" for begin in SEGMENTS))
    incomplete = not is_port and not any(lock.exists() for lock in locks)
    if incomplete or any(map(_is_held, locks)):  # a segment gets its lock last, a port first
        return False
    for path in (folder / name, *locks, folder / f"sem.{name}_mutex"):
        path.unlink(missing_ok=True)
    return True


def _is_held(lock: Path) -> bool:
    """Whether a living process holds a lock; one that cannot be opened counts as held."""
    try:
        with lock.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    return False
