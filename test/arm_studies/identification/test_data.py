# SPDX-License-Identifier: Apache-2.0
"""Recordings of every kind as input of identification, and joints that they call otherwise."""

from dataclasses import replace

import numpy as np
import pytest

from arm_dynamics.exceptions import InvalidInput
from arm_sim import Recording, Simulator
from arm_sim.recording.contents import Event
from arm_studies.identification import JointRecord
from arm_studies.identification.data import read_joint_record
from arm_studies.identification.names import mapped


@pytest.fixture(scope="module")
def run():
    sim = Simulator("two_link", dt=1e-3)
    return sim.run(0.2, lambda state: np.array([np.sin(9.0 * state.time), 0.1]))


def test_a_simulation_gives_the_torque_around_each_time(run, tmp_path):
    made = read_joint_record(run.save(tmp_path / "run.mcap"))
    assert made.joint_names == ("shoulder", "elbow")
    np.testing.assert_allclose(made.q, run.q)
    np.testing.assert_allclose(made.v, run.v)
    expected = np.sin(9.0 * (made.time[1:-1] - 0.5e-3))  # held from each tick to the next
    np.testing.assert_allclose(made.effort[1:-1, 0], expected, atol=2e-5)
    assert np.isnan(made.a).all()


def test_a_table_without_velocities_and_its_faults(tmp_path):
    path = tmp_path / "robot.csv"
    path.write_text("time,position.elbow,effort.elbow\n0,1,2\n0.1,1.5,3\n")
    made = read_joint_record(path)
    assert made.name == "robot.csv" and np.isnan(made.v).all()
    np.testing.assert_array_equal(made.effort.ravel(), [2.0, 3.0])
    path.write_text("time,position.elbow\n0,1\n")
    with pytest.raises(InvalidInput, match=r"robot.csv.*k > 1"):
        read_joint_record(path)


def test_events_of_a_robot_become_notes(tmp_path):
    path = tmp_path / "robot.csv"
    path.write_text("time,position.elbow\n0,1\n0.1,1.5\n")
    run = replace(Recording.load(path), events=(Event(0.1, "driver: the brake closed"),))
    assert JointRecord.from_recording(run).notes == ("driver: the brake closed",)


def test_what_sensors_told_comes_before_the_truth():
    scene = {
        "robot": {"urdf": "package://arm_sim/scenes/two_link.urdf"},
        "sensors": {"seed": 1, "effort": {"noise": 0.1}},
    }
    run = Simulator(scene, dt=1e-3).run(0.05)
    made = JointRecord.from_recording(run)
    np.testing.assert_array_equal(made.effort, run.measured.effort)
    assert made.effort.std() > 0.05 > abs(run.tau).max()
    assert made.effort_age == pytest.approx(0.5e-3)  # half of the tick before, in which it acted


def test_when_efforts_of_a_robot_acted_is_unknown(run, tmp_path):
    """A bag of joint states does not say of which interval they are."""
    assert JointRecord.from_recording(run).effort_age == 0.0
    bag = Recording.load(run.save(tmp_path / "run.mcap"), topic="/joint_states")
    assert JointRecord.from_recording(bag).effort_age is None


def record(*names: str) -> JointRecord:
    """The position of joint k is k."""
    q = np.tile(np.arange(len(names), dtype=float), (3, 1))
    return JointRecord.of(names, [0.0, 0.1, 0.2], q, q)


@pytest.mark.parametrize(
    ("recorded", "joints", "places"),
    [
        (("left_elbow", "elbow"), ["elbow"], [1]),  # its own name comes first
        (("fer_joint2", "fer_joint1"), ["panda_joint1", "panda_joint2"], [1, 0]),
        (("robot/elbow", "wrist"), ["wrist", "elbow"], [1, 0]),
    ],
)
def test_a_joint_is_found_under_its_names(
    recorded: tuple[str, ...], joints: list[str], places: list[int]
) -> None:
    found = mapped(record(*recorded), joints)
    assert found.joint_names == tuple(joints)
    np.testing.assert_array_equal(found.q[0], places)
    assert bool(found.notes) == ([recorded[k] for k in places] != joints)


def test_a_joint_that_two_may_be_is_not_guessed() -> None:
    with pytest.raises(InvalidInput, match="no joint matches elbow.*such as --map elbow=left_elb"):
        mapped(record("left_elbow", "right_elbow"), ["elbow"])
