# SPDX-License-Identifier: Apache-2.0
"""Processes use the transport of their environment; Fast DDS ignores profiles it cannot read.

Shared memory left by killed nodes is released, and nothing else.
"""

import os
import subprocess
import sys

import pytest
from harness import segments, surroundings

from arm_dynamics.ros import LARGE_BATCHES
from arm_dynamics.ros.common.transport import (
    FOLDER,
    avoid_shared_memory,
    by_profile,
    by_udp,
    clear_dead,
)
from arm_sim.cli.demo.processes import free_domain

# Joins the graph, and prints the size of the largest piece of Fast DDS's shared memory it has.
JOINS = """
import re
from pathlib import Path
import rclpy
rclpy.init()
node = rclpy.create_node("joins")
sizes = [0]
for line in Path("/proc/self/maps").read_text().splitlines():
    if re.search(r"/fast(rtps|dds)_[0-9a-f]+$", line):
        begin, end = (int(place, 16) for place in line.split()[0].split("-"))
        sizes.append(end - begin)
print(max(sizes))
"""
LARGE = by_profile(LARGE_BATCHES)


@pytest.mark.parametrize(
    ("environment", "least", "most"),
    [(by_udp(), 0, 0), (LARGE, 64 << 20, 72 << 20)],
    ids=["by_udp", "large_batches"],
)
def test_shared_memory_is_as_the_environment_says(environment, least, most):
    """None of it, or 64 MB and what Fast DDS keeps beside them."""
    environment = os.environ | environment | {"ROS_DOMAIN_ID": str(free_domain())}
    done = subprocess.run(
        [sys.executable, "-c", JOINS], env=environment, capture_output=True, text=True, check=True
    )
    assert least <= int(done.stdout) <= most


RANGE, TRANSPORTS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTDDS_BUILTIN_TRANSPORTS"


@pytest.mark.parametrize(
    ("environment", "more"),
    [
        ({}, {TRANSPORTS: "UDPv4"}),
        ({RANGE: "LOCALHOST"}, by_udp()),
        ({"ROS_LOCALHOST_ONLY": "1"}, by_udp()),
        ({TRANSPORTS: "SHM"}, {}),
        ({"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp", RANGE: "LOCALHOST"}, {}),
        ({"ROS_STATIC_PEERS": "192.168.0.1", RANGE: "LOCALHOST"}, {}),
    ],
)
def test_nodes_stay_out_of_shared_memory_unless_transports_are_chosen(environment, more):
    """Whatever is said of how far they are heard, which stays as it is."""
    expected = environment | more
    expected.pop("ROS_LOCALHOST_ONLY", None)
    for _ in range(2):
        avoid_shared_memory(environment)
        assert environment == expected


NODE = """
import rclpy
rclpy.init()
node = rclpy.create_node("there")
print("there", flush=True)
input()
"""


def node() -> subprocess.Popen[str]:
    """A node in a process of its own, which ends with its standard input."""
    process = subprocess.Popen(
        [sys.executable, "-c", NODE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env=surroundings(),
    )  # fmt: skip
    assert process.stdout is not None and process.stdout.readline() == "there\n"
    return process


def there() -> set[str]:
    return {path.name for path in FOLDER.iterdir()}


def test_only_the_dead_are_cleared() -> None:
    with node() as living:
        kept = segments(living.pid)
        with node() as doomed:
            left = segments(doomed.pid) - kept
            clear_dead()
            assert kept and left and there() >= kept | left
            doomed.kill()
        assert there() >= left
        assert clear_dead() > 0
        assert not there() & left
        assert there() >= kept
        living.communicate("")
