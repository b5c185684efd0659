# SPDX-License-Identifier: Apache-2.0
"""Transports where Fast DDS's defaults do not suffice, and its shared memory after a kill.

Shared memory is Fast DDS's default, and its ports belong to the whole machine. A process that
writes to a port wakes the reader while it holds the port's lock. If it is killed then, the lock is
never released, and all others that write to this port wait for ever, the loop of a simulator among
them. So our nodes use UDP, which is as fast (docs/how-to/fast-dds.md).

By shared memory, the end of a message larger than the sender's 512 kB is lost and sent again some
milliseconds later, repeatedly until it is complete.

Each participant has segments in /dev/shm and holds a lock on each while it lives. A process that
is killed cannot release them; after killing one, call ``clear_dead``, which does the same as
``fastdds shm clean`` (which the wheels do not contain).
"""

import fcntl
import os
from collections.abc import MutableMapping
from pathlib import Path

DISCOVERY, _LOCAL_ONLY = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_LOCALHOST_ONLY"
# Variables with the path of a profile: of version 2 (Jazzy); of 3 (Kilted), which warns of the
# first.
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
THIS_MACHINE = Path(__file__).with_name("this_machine.xml")
LARGE_BATCHES = Path(__file__).with_name("large_batches.xml")
"""A profile of Fast DDS with 64 MB of shared memory, for service calls of many points."""
FOLDER = Path("/dev/shm")
# How the names of segments in shared memory begin: of version 2, and of 3
SEGMENTS = ("fastrtps_", "fastdds_")
_LOCKS = ("_el", "_sl")


def by_udp() -> dict[str, str]:
    """Environment of processes that communicate by UDP, on this machine only."""
    return by_profile(THIS_MACHINE)


def as_usual() -> dict[str, str]:
    """Environment of processes that communicate as for users, on this machine only."""
    return {DISCOVERY: "LOCALHOST"}


def avoid_shared_memory(environment: MutableMapping[str, str] = os.environ) -> None:
    """Let this process communicate by UDP, unless its environment chooses the transports.

    Call it before ROS starts. With the range LOCALHOST only a profile without a range can.
    """
    ours = "fastrtps" in (environment.get("RMW_IMPLEMENTATION") or "rmw_fastrtps_cpp")
    if not ours or any(environment.get(name) for name in (*PROFILES, _TRANSPORTS)):
        return
    local = environment.get(_LOCAL_ONLY) == "1" or environment.get(DISCOVERY) == "LOCALHOST"
    if not local:
        environment[_TRANSPORTS] = "UDPv4"
    elif not environment.get("ROS_STATIC_PEERS"):
        environment.update(by_udp())
        environment.pop(_LOCAL_ONLY, None)


def by_profile(profile: Path) -> dict[str, str]:
    """Environment of processes that communicate by a profile of Fast DDS."""
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    # The package of Fast DDS 3 has another name than that of version 2.
    is_3 = any(Path(prefix, "share/fastdds").is_dir() for prefix in prefixes if prefix)
    # With the range LOCALHOST, ROS ignores the transports of a profile.
    return {PROFILES[is_3]: str(profile), DISCOVERY: "SYSTEM_DEFAULT"}


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
