# SPDX-License-Identifier: Apache-2.0
"""A client that behaves as MoveIt's controller manager does gets its goals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from harness import Ros
from samples import sampled

pytest.importorskip("control_msgs")

from arm_dynamics import load_scene
from benchmarks.following.cli import IMPERFECT, ROBOTS
from benchmarks.following.client import MoveItClient
from benchmarks.following.course import CANCELLED, PLAIN, REPLACED, Course
from benchmarks.following.motions import message, straight
from benchmarks.following.rig import Rig

GOALS, EACH = 4, 1


@pytest.mark.ros
@pytest.mark.parametrize(
    ("robot", "lines"),
    sampled(
        [
            pytest.param(robot, lines, id=f"{robot}-{name}")
            for robot in ROBOTS
            for name, lines in (("perfect", {}), ("imperfect", IMPERFECT))
        ],
        2,
    ),
)
def test_all_goals_are_got(ros: Ros, robot: str, lines: dict[str, Any]) -> None:
    rig = Rig(load_scene({**ROBOTS[robot], **lines}), ros.context)
    ros.adopt(rig.node)
    look = lambda: ros.spin_once(1e-3)  # noqa: E731
    client = MoveItClient(ros.peer, rig.simulator.joint_names, look, rig)
    client.connect(tries=1000)
    course = Course(client, rig.simulator.model)
    assert len(list(course.run(GOALS, cancelled=EACH, replaced=EACH))) == GOALS
    for kind, wanted in ((PLAIN, GOALS - 2 * EACH), (CANCELLED, EACH), (REPLACED, EACH)):
        tally = course.tallies[kind]
        assert (tally.got, tally.failures) == (wanted, [])
    assert client.feedback > 10 * GOALS


def test_trajectories_are_those_of_a_planner() -> None:
    """Trapezoids within limits, sampled, ending at rest."""
    here, there = np.zeros(2), np.array([1.0, -0.5])
    speed, limit = np.array([0.5, 1.0]), 2.0
    motion, duration = straight(here, there, speed, limit)
    assert duration == pytest.approx(1.0 / 0.5 + 0.5 / 2.0)  # way/speed + speed/acceleration
    sent = message(motion, duration, ["a", "b"])
    at = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in sent.points]
    assert at[0] == 0.0
    assert np.all(np.diff(at) > 0.0)
    assert at[-1] == pytest.approx(duration, abs=1e-9)
    np.testing.assert_allclose(sent.points[-1].positions, there, atol=1e-12)
    assert not any(sent.points[-1].velocities)
    assert np.abs([p.velocities for p in sent.points]).max() == pytest.approx(0.5)
    assert np.abs([p.accelerations for p in sent.points]).max() == pytest.approx(2.0)
