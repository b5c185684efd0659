# SPDX-License-Identifier: Apache-2.0
"""How processes talk, where Fast DDS's usual way will not do: environments for them.

Shared memory is Fast DDS's usual way, and its ports are the whole machine's. Where a process is
killed, or stopped for a second, version 2.14 takes its port for dead and maps it anew: who is just
leaving it may crash, and who still writes to the old one is not heard again.

A message larger than the sender's shared memory, 512 kB, loses its end, which is sent again
some milliseconds later, and so on until all of it is there.
"""

from __future__ import annotations

from pathlib import Path

DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
THIS_MACHINE = Path(__file__).with_name("this_machine.xml")
LARGE_BATCHES = Path(__file__).with_name("large_batches.xml")


def by_udp() -> dict[str, str]:
    """Environment of processes that talk by UDP, and to this machine only."""
    return _profiled(THIS_MACHINE)


def with_room() -> dict[str, str]:
    """Environment of processes that have 64 MB of shared memory each for what they send.

    As a profile of its own, and for who asks for it: containers often have no more in all.
    """
    return _profiled(LARGE_BATCHES)


def as_usual() -> dict[str, str]:
    """Environment of processes that talk as Fast DDS chooses, and to this machine only."""
    return {DISCOVERY: "LOCALHOST"}


def _profiled(profile: Path) -> dict[str, str]:
    # With the range LOCALHOST, ROS takes no notice of a profile's transports.
    return {PROFILES: str(profile), DISCOVERY: "SYSTEM_DEFAULT"}
