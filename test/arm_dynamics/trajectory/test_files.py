# SPDX-License-Identifier: Apache-2.0
"""Joint trajectories as files."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from arm_dynamics import InvalidInput
from arm_dynamics.trajectory import JointTrajectory, Waypoint, quintic

NAMES = ("shoulder", 'el"bow')
MOTION = quintic([Waypoint(0.0, [0, 1e-7]), Waypoint(0.5, [0.3, 1.0]), Waypoint(1.25, [0, 1e-7])])


def test_what_is_saved_is_the_same_motion_when_it_is_loaded(tmp_path: Path) -> None:
    path = JointTrajectory.of(MOTION, NAMES).save(tmp_path / "a.yaml")
    loaded = JointTrajectory.load(path)
    assert loaded.joint_names == NAMES
    assert loaded.start == {"shoulder": 0.0, 'el"bow': 1e-7}
    turned = loaded.motion(NAMES[::-1])
    with pytest.raises(InvalidInput, match="the arm has wrist"):
        loaded.motion(["wrist"])
    for t in np.linspace(0.0, 1.25, 41):
        there, here = MOTION.sample(t), turned.sample(t)
        for part in "qva":
            expected = getattr(there, part)
            np.testing.assert_allclose(getattr(here, part)[::-1], expected, atol=1e-12)


def test_it_is_a_message_of_ros(tmp_path: Path) -> None:
    """Keys and types of trajectory_msgs/JointTrajectory; numbers stay numbers in YAML 1.1."""
    text = JointTrajectory.of(MOTION, NAMES).save(tmp_path / "a.yaml").read_text()
    found = yaml.safe_load(text)
    assert set(found) == {"joint_names", "points"}
    assert found["points"][1]["time_from_start"] == {"sec": 0, "nanosec": 500_000_000}
    for point in found["points"]:
        for key in ("positions", "velocities", "accelerations"):
            assert all(isinstance(x, float) for x in point[key])


def test_added_torques_come_along_in_every_turn(tmp_path: Path) -> None:
    torques = {0.0: [1.0, -2.0], 0.5: [3.0, 5.0], 0.75: [-4.0, 0.5], 1.25: [1.0, -2.0]}
    motion = quintic([Waypoint(t, [t * (1.25 - t), 0], tau=tau) for t, tau in torques.items()])
    path = JointTrajectory.of(motion, NAMES, turns=2).save(tmp_path / "a.yaml")
    twice = JointTrajectory.load(path).motion(NAMES[::-1])
    np.testing.assert_allclose(twice.sample(1.75).q, motion.sample(0.5).q[::-1], atol=1e-12)
    for turn in 0, 1:
        for t, tau in torques.items():
            np.testing.assert_allclose(twice.sample(1.25 * turn + t).tau, tau[::-1], atol=1e-12)


def test_motions_that_cannot_repeat_are_refused() -> None:
    motion = quintic([Waypoint(0.0, [0, 1]), Waypoint(1.0, [0, 2])])
    with pytest.raises(InvalidInput, match="turns = 2: the motion begins at 1 .* and ends at 2"):
        JointTrajectory.of(motion, NAMES, turns=2)
    assert JointTrajectory.of(motion, NAMES)


def test_other_files_are_refused_by_name(tmp_path: Path) -> None:
    path, points = tmp_path / "b.yaml", "points: [{positions: [x], time_from_start: {sec: 0}}]"
    for text, told in (
        ("", "not a joint trajectory"),
        (f"joint_names: [a]\n{points}", "real num"),
    ):
        path.write_text(text)
        with pytest.raises(InvalidInput, match=f"b.yaml.*{told}"):
            JointTrajectory.load(path)
