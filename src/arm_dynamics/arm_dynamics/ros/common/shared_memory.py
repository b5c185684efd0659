# SPDX-License-Identifier: Apache-2.0
"""Shared memory that killed nodes leave behind.

Fast DDS gives each participant segments in /dev/shm and holds a lock on each while it lives. A
process that is killed cannot give them back; whoever kills one does it here. As ``fastdds shm
clean`` does it, which the wheels do not bring along.
"""

from __future__ import annotations

import fcntl
from pathlib import Path

FOLDER = Path("/dev/shm")
_LOCKS = ("_el", "_sl")


def clear_dead(folder: Path = FOLDER) -> int:
    """Remove the segments whose owners are gone; those of living nodes stay.

    Args:
        folder: Where Fast DDS keeps them.

    Returns:
        How many segments were removed.
    """
    names = {_stem(path.name) for path in folder.glob("fastrtps_*")}
    return sum(_removed(folder, name) for name in sorted(names))


def _stem(name: str) -> str:
    return name[:-3] if name.endswith(_LOCKS) else name


def _removed(folder: Path, name: str) -> bool:
    locks = [folder / f"{name}{lock}" for lock in _LOCKS]
    begun = not name.startswith("fastrtps_port") and not any(lock.exists() for lock in locks)
    if begun or any(map(_is_held, locks)):  # a segment gets its lock last, a port first
        return False
    for path in (folder / name, *locks, folder / f"sem.{name}_mutex"):
        path.unlink(missing_ok=True)
    return True


def _is_held(lock: Path) -> bool:
    """Whether somebody alive holds a lock; one that may not be looked at counts as held."""
    try:
        with lock.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    return False
