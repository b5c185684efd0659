# SPDX-License-Identifier: Apache-2.0
"""The installed package simulates its bundled scenes, in the library and as a node."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
from ament_index_python.packages import get_package_share_directory
from rclpy.context import Context
from rclpy.parameter import Parameter

from arm_sim import Simulator
from arm_sim.ros import SimNode

SCENE = "double_pendulum"  # comes with the package, robot included
ROOM = 88  # a separate domain without other nodes


@pytest.fixture
def context(monkeypatch: pytest.MonkeyPatch) -> Iterator[Context]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    rclpy.init(args=[], context=context, domain_id=ROOM)
    yield context
    context.try_shutdown()


def test_ready_scenes_are_installed() -> None:
    assert (Path(get_package_share_directory("arm_sim")) / "scenes" / f"{SCENE}.yaml").is_file()


def test_the_node_ticks_as_the_library_does(context: Context) -> None:
    node = SimNode(
        SCENE, context=context, parameter_overrides=[
            Parameter("realtime", value=False), Parameter("stale_policy", value="zero"),
        ],
    )  # fmt: skip
    try:
        for _ in range(50):
            node.tick()
        np.testing.assert_array_equal(node.simulator.state.q, Simulator(SCENE).run(0.05).q[-1])
    finally:
        node.destroy_node()
