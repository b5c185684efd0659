# SPDX-License-Identifier: Apache-2.0
"""The reference that results from successive commands."""

import numpy as np
import pytest

from arm_sim import JointCommand
from arm_sim.servo.setpoints import Setpoints

DT = 1e-3


def reference(setpoints: Setpoints) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities, shape (n,) each."""
    _, _, q, v, _ = setpoints.rows.reshape(5, -1)
    return q.copy(), v.copy()


def lead(commands: dict[int, JointCommand], ticks: int) -> np.ndarray:
    """Position and velocity of a joint's reference in each tick, shape (ticks, 2).

    The others stay at 1 rad, whichever of three joints it is.
    """
    found = np.empty((3, ticks, 2))
    for joint in range(3):
        setpoints = Setpoints(3, DT)
        for step in range(ticks):
            if (one := commands.get(step)) is not None:
                fields = np.full((3, 3), [[1.0], [np.nan], [np.nan]])
                fields[:, joint] = one.position[0], one.velocity[0], one.effort[0]
                newest = JointCommand(*fields, stamp=one.stamp)
            setpoints.advance(newest, step)
            q, v = reference(setpoints)
            found[joint, step] = q[joint], v[joint]
            assert np.delete(q, joint).tolist() == [1.0, 1.0] and not np.delete(v, joint).any()
    np.testing.assert_array_equal(found, found[[0, 0, 0]])
    return found[0]


def test_a_first_command_is_a_place_and_a_velocity_alone_goes_on() -> None:
    np.testing.assert_array_equal(lead({0: JointCommand(position=[0.3])}, 50), [[0.3, 0.0]] * 50)
    np.testing.assert_array_equal(lead({0: JointCommand(velocity=[0.5])}, 30)[:, 1], 0.5)


@pytest.mark.parametrize("every", [1, 20])
def test_a_stream_moves_between_its_commands(every: int) -> None:
    """Positions of a steady motion, at any rate, mean that motion."""
    speed, ticks = 0.7, 200
    stream = {k: JointCommand(position=[speed * k * DT]) for k in range(0, ticks, every)}
    found = lead(stream, ticks)
    later = np.arange(every, ticks)  # the first command says nothing of a speed
    np.testing.assert_allclose(found[later, 0], speed * DT * later, atol=1e-12)
    np.testing.assert_allclose(found[later, 1], speed, rtol=1e-9)


def test_stamps_give_the_time_between_commands() -> None:
    """One that comes a tick late was sent in time."""
    sent = [JointCommand(position=[0.001 * k], stamp=(k + 1) * 1_000_000) for k in range(3)]
    found = lead({0: sent[0], 1: sent[1], 3: sent[2]}, 4)
    np.testing.assert_allclose(found[1:, 1], 1.0, rtol=1e-12)


@pytest.mark.parametrize("later", [0, -1_000_000, 200_000_000])
def test_stamps_that_do_not_follow_closely_are_no_stream(later: int) -> None:
    """The same again, earlier, or much later: a place, not a speed."""
    sent = [JointCommand(position=[0.1 * k], stamp=10_000_000 + k * later) for k in range(2)]
    np.testing.assert_array_equal(lead(dict(enumerate(sent)), 4)[1:], [[0.1, 0.0]] * 3)


def test_a_stream_that_stops_ends_at_its_last_position() -> None:
    found = lead({k: JointCommand(position=[0.01 * k]) for k in range(10)}, 40)
    np.testing.assert_allclose(found[11], [0.11, 10.0], rtol=1e-9)  # two more might be on the way
    np.testing.assert_array_equal(found[12:], [[0.09, 0.0]] * 28)


def test_a_velocity_beside_a_position_is_that_of_the_motion() -> None:
    sent = {k: JointCommand(position=[0.0], velocity=[0.5]) for k in range(5)}
    found = lead(sent, 30)
    np.testing.assert_array_equal(found[:5], [[0.0, 0.5]] * 5)
    np.testing.assert_array_equal(found[10:], [[0.0, 0.0]] * 20)


def test_one_joint_goes_on_where_the_stream_of_another_has_ended() -> None:
    nan, setpoints = np.nan, Setpoints(2, DT)
    for k in range(3):
        last = JointCommand([0.01 * k, nan], [nan, 0.5])
        setpoints.advance(last, k)
    assert reference(setpoints)[1].tolist() == pytest.approx([10.0, 0.5])
    for step in range(3, 12):
        setpoints.advance(last, step)
    assert reference(setpoints)[0][0] == 0.02 and reference(setpoints)[1].tolist() == [0.0, 0.5]
    assert not setpoints.at_rest
    setpoints.advance(JointCommand([0.02, nan], [nan, 0.0]), 12)
    assert setpoints.at_rest


def test_a_joint_that_begins_to_be_led_has_no_speed_yet() -> None:
    nan = np.nan
    found = lead({0: JointCommand(effort=[1.0]), 1: JointCommand(position=[2.0])}, 3)
    np.testing.assert_array_equal(found[1:], [[2.0, 0.0]] * 2)
    mixed = Setpoints(3, DT)
    mixed.advance(JointCommand([1.0, nan, nan], [nan, 2.0, nan], [0.5, nan, 3.0]), 0)
    moves, leads, q, v, added = mixed.rows.reshape(5, 3)
    np.testing.assert_array_equal(moves, [1, 1, 0])
    np.testing.assert_array_equal(leads, [1, 0, 0])
    np.testing.assert_array_equal([q, v, added], [[1, 0, 0], [0, 2, 0], [0.5, 0, 3]])
