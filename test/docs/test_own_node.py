# SPDX-License-Identifier: Apache-2.0
"""The nodes of the page own-node.md move an arm, and do the same in Python and in C++."""

import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pages
import pytest
from harness import Ros, surroundings
from sensor_msgs.msg import JointState

from arm_sim.ros import SimNode

pytestmark = pytest.mark.ros

PAGE = pages.ROOT / "docs/how-to/own-node.md"
FILES = {step.name: step.text for step in pages.steps(PAGE) if step.kind == "file"}
STAND_IN = pages.ROOT / "test/support"


def module() -> dict[str, Any]:
    """What the Python node defines, without running it."""
    names: dict[str, Any] = {"__name__": "my_node"}
    exec(FILES["my_node.py"], names)
    return names


def test_it_moves_the_arm_at_the_speed_that_the_page_names(ros: Ros, tmp_path: Path) -> None:
    """In lockstep, since the node copies the stamps that it answers."""
    (tmp_path / "my_node.py").write_text(FILES["my_node.py"])
    sim = ros.add(SimNode, "ur5e", lockstep=True, gravity_compensated=True)
    begin, names = sim.simulator.state.q, sim.simulator.joint_names
    speeds: list[float] = []
    sim.engine.on.tick.append(lambda: speeds.append(abs(sim.simulator.state.v).max()))
    environment = surroundings(ROS_DOMAIN_ID=str(ros.domain))
    with subprocess.Popen([sys.executable, tmp_path / "my_node.py"], env=environment) as node:
        ros.spin_until(lambda: len(speeds) >= 3000, timeout=90.0)
        node.kill()
    page = module()
    goal = [page["GOAL"].get(name, q) for name, q in zip(names, begin, strict=True)]
    np.testing.assert_allclose(sim.simulator.state.q, goal, atol=1e-3)
    farthest = abs(np.array(goal) - begin).max()
    assert max(speeds) == pytest.approx(1.875 * farthest / page["DURATION"], rel=0.05)


STATES = np.random.default_rng(0).uniform(-2.0, 2.0, (25, 6, 2))


def by_python() -> list[list[str]]:
    """Commands for these states, as the stand-in of rclcpp writes them."""
    page, heard = module(), list[JointState]()
    node = SimpleNamespace(begin=None, start={}, commands=SimpleNamespace(publish=heard.append))
    for second, rows in enumerate(STATES):
        q, v = rows.T.tolist()
        state = JointState(name=list(page["INERTIA"]), position=q, velocity=v)
        state.header.stamp.sec, state.header.stamp.nanosec = 5, second * 10**8
        page["MyNode"].answer(node, state)
    return [
        [x.header.frame_id, str(x.header.stamp.nanosec)]
        + [word for pair in zip(x.name, map(repr, x.effort), strict=True) for word in pair]
        for x in heard
    ]


def by_cpp(folder: Path) -> list[list[str]]:
    (folder / "my_node.cpp").write_text(FILES["my_node.cpp"])
    prefixes = os.environ["AMENT_PREFIX_PATH"].split(":")
    messages = [f"-I{path}" for prefix in prefixes for path in Path(prefix).glob("include/*")]
    subprocess.run(
        ["c++", "-std=c++17", "-Wall", "-Wextra", "-Werror", f"-I{STAND_IN}", *messages,
         "my_node.cpp", "-o", "my_node"],
        cwd=folder, check=True,
    )  # fmt: skip
    names, lines = list(module()["INERTIA"]), list[str]()
    for rows in STATES.tolist():
        joints = (f"{name} {q!r} {v!r}" for name, (q, v) in zip(names, rows, strict=True))
        lines.append(f"{len(names)} {' '.join(joints)}\n")
    said = subprocess.check_output([folder / "my_node"], input="".join(lines), text=True)
    return [line.split() for line in said.splitlines()]


def test_python_and_cpp_command_the_same(tmp_path: Path) -> None:
    """Compiled with the messages of this ROS 2 and a stand-in for rclcpp."""
    ours, theirs = np.array(by_python()), np.array(by_cpp(tmp_path))
    np.testing.assert_array_equal(ours[:, :2], theirs[:, :2])
    np.testing.assert_array_equal(ours[:, 2::2], theirs[:, 2::2])
    efforts = [table[:, 3::2].astype(float) for table in (ours, theirs)]
    np.testing.assert_allclose(*efforts, rtol=1e-14)


def test_the_package_declares_what_its_code_uses() -> None:
    used = set(re.findall(r"#include <(\w+)/", FILES["my_node.cpp"]))
    package = ET.fromstring(FILES["package.xml"].strip())
    assert {depend.text for depend in package.findall("depend")} == used
    assert set(re.findall(r"find_package\((\w+)", FILES["CMakeLists.txt"])) == used | {
        "ament_cmake"
    }
    assert package.findtext("name") in FILES["CMakeLists.txt"]
