# SPDX-License-Identifier: Apache-2.0
"""How processes of one machine talk without shared memory.

Shared memory is Fast DDS's usual way, and its ports are the whole machine's. Where a process is
killed, or stopped for a second, version 2.14 takes its port for dead and maps it anew: who is just
leaving it may crash, and who still writes to the old one is not heard again.
"""

from __future__ import annotations

from pathlib import Path

DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"


def by_udp() -> dict[str, str]:
    """Environment of processes that talk by UDP, and to this machine only."""
    profile = Path(__file__).with_name("this_machine.xml")
    return {PROFILES: str(profile), DISCOVERY: "SYSTEM_DEFAULT"}  # which leaves it to the profile


def as_usual() -> dict[str, str]:
    """Environment of processes that talk as Fast DDS chooses, and to this machine only."""
    return {DISCOVERY: "LOCALHOST"}
