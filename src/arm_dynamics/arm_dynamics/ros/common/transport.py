# SPDX-License-Identifier: Apache-2.0
"""Transports where Fast DDS's defaults do not suffice.

Shared memory is Fast DDS's default, and its ports belong to the whole machine. A process that
writes to a port wakes the reader while it holds the port's lock. If it is killed then, the lock is
never released, and all others that write to this port wait for ever, the loop of a simulator among
them. So our nodes use UDP, which is as fast (docs/how-to/fast-dds.md).

By shared memory, the end of a message larger than the sender's 512 kB is lost and sent again some
milliseconds later, repeatedly until it is complete.
"""

from __future__ import annotations

import os
from collections.abc import MutableMapping
from pathlib import Path

DISCOVERY, _LOCAL_ONLY = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_LOCALHOST_ONLY"
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""Variables with the path of a profile: of version 2 (Jazzy); of 3 (Kilted), which warns of the
first."""
_TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
THIS_MACHINE = Path(__file__).with_name("this_machine.xml")
LARGE_BATCHES = Path(__file__).with_name("large_batches.xml")
"""A profile of Fast DDS with 64 MB of shared memory, for service calls of many points."""


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
