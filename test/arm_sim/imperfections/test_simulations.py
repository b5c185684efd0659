# SPDX-License-Identifier: Apache-2.0
"""Runs with sensors and delays: control receives measured values, the motion is unchanged."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_sim import JointCommand, Simulator, State, computed_torque

PLAIN = models.scene("two_link").model_dump(exclude_unset=True)
SENSORS = {
    "seed": 5, "position": {"resolution": 1e-4, "noise": 1e-5},
    "velocity": {"from": "position", "cutoff": 60, "order": 2}, "effort": {"noise": 0.1},
    "delay": 0.001, "jitter": 0.002, "loss": 0.05,
}  # fmt: skip
COMMANDS = {"delay": 0.001, "jitter": 0.001, "loss": 0.05}
TICKS = 200


def simulator(**scene: Any) -> Simulator:
    return Simulator({**PLAIN, **scene})


def imperfect(**scene: Any) -> Simulator:
    return simulator(sensors=SENSORS, commands=COMMANDS, **scene)


def damped(state: State) -> np.ndarray:
    return 3.0 * np.cos(20.0 * state.time) - 2.0 * state.v - 5.0 * state.q


def torques(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.normal(scale=3.0, size=(*shape, 2))


def test_control_receives_sensor_readings_and_the_recording_keeps_both() -> None:
    sim, seen = simulator(sensors=SENSORS), []
    motion = sim.run(0.1, lambda state: seen.append(state) or damped(state))
    assert motion.measured is not None
    np.testing.assert_array_equal([state.q for state in seen], motion.measured.q[:-1])
    np.testing.assert_array_equal([state.v for state in seen], motion.measured.v[:-1])
    assert [state.step for state in seen] == list(range(100))
    assert 1e-6 < abs(motion.measured.q - motion.q).max() < 0.1
    again = simulator().run(0.1, np.array([damped(state) for state in seen]))
    np.testing.assert_array_equal(motion.q, again.q)  # the truth under the same torques


def test_delays_lengthen_the_loop_by_their_sum() -> None:
    """What is commanded acts on the arm as much later as the state is older."""
    sim = simulator(sensors={"delay": 0.003}, commands={"delay": 0.004})
    motion = sim.run(0.1, damped)
    told = np.vstack([np.tile(motion.v[0], (3, 1)), motion.v[:-3]])
    given = 3.0 * np.cos(20.0 * motion.time)[:, None] - 2.0 * told
    given -= 5.0 * np.vstack([np.tile(motion.q[0], (3, 1)), motion.q[:-3]])
    np.testing.assert_array_equal(motion.command[:4], 0.0)
    np.testing.assert_allclose(motion.command[4:-1], given[:-5], rtol=1e-12)


def test_runs_repeat_to_the_bit_also_in_pieces_and_seeds_differ() -> None:
    whole, sim = imperfect().run(0.2, damped), imperfect()
    parts = [sim.run(0.05, damped) for _ in range(4)]
    np.testing.assert_array_equal(np.vstack([part.q[1:] for part in parts]), whole.q[1:])
    told = np.vstack([part.measured.v[1:] for part in parts])
    np.testing.assert_array_equal(told, whole.measured.v[1:])
    sim.reset()
    again = sim.run(0.2, damped)
    np.testing.assert_array_equal(again.q, whole.q)
    np.testing.assert_array_equal(again.measured.effort, whole.measured.effort)
    other = simulator(sensors={**SENSORS, "seed": 6}, commands=COMMANDS).run(0.2, damped)
    assert abs(other.q - whole.q).max() > 1e-9


def test_steps_tables_and_functions_agree_to_the_bit(rng: np.random.Generator) -> None:
    table = torques(rng, TICKS)
    by_table = imperfect().run(TICKS * 1e-3, table)
    by_function = imperfect().run(TICKS * 1e-3, lambda state: table[state.step])
    sim = imperfect()
    by_step = np.array([np.concatenate([sim.step(tau).q, sim.measured.q]) for tau in table])
    np.testing.assert_array_equal(by_table.q, by_function.q)
    np.testing.assert_array_equal(by_table.measured.q, by_function.measured.q)
    np.testing.assert_array_equal(by_table.measured.effort, by_function.measured.effort)
    np.testing.assert_array_equal(by_step, np.hstack([by_table.q, by_table.measured.q])[1:])


def test_rollouts_are_runs_and_do_not_depend_on_threads_and_lanes(
    rng: np.random.Generator,
) -> None:
    sim, tau, zeros = imperfect(), torques(rng, 5, TICKS), np.zeros((5, 2))
    q0 = np.tile(sim.state.q, (5, 1))
    found = sim.rollout(q0, zeros, tau, TICKS, threads=1, lanes=1)
    sim.reset(q0[0], zeros[0])
    motion = sim.run(TICKS * 1e-3, tau[0])
    np.testing.assert_allclose(found[0], np.hstack([motion.q, motion.v]), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found, sim.rollout(q0, zeros, tau, TICKS, threads=2))
    alike = sim.rollout(q0, zeros, np.tile(tau[0], (5, 1, 1)), TICKS)
    assert abs(alike[1] - alike[0]).max() > 0.0  # by chances of each arm's own


def test_a_reset_and_a_jump_start_sensors_anew() -> None:
    sim = imperfect()
    sim.run(0.1, damped)
    sim.set_state(sim.state.q + 1.0, np.zeros(2))
    np.testing.assert_allclose(sim.measured.q, sim.state.q, atol=2e-4)
    np.testing.assert_array_equal(sim.measured.v, 0.0)
    sim.step(np.zeros(2))
    assert abs(sim.measured.v).max() < 1.0  # the jump is no velocity of 1000 rad/s


def test_a_compiled_controller_cannot_take_sensor_readings() -> None:
    sim = imperfect()
    with pytest.raises(InvalidInput, match="'sensors' or 'commands'"):
        sim.run(0.1, computed_torque(sim.model, sim.state.q))


def test_a_servo_is_the_robots_own_and_knows_the_true_state() -> None:
    goal = JointCommand(position=simulator().state.q + 0.1)
    coarse = {"position": {"resolution": 0.5}, "delay": 0.01}
    told = simulator(sensors=coarse).run(0.2, goal)
    np.testing.assert_array_equal(told.q, simulator().run(0.2, goal).q)
    assert abs(told.measured.q - told.q).max() > 0.1


def test_positions_as_commands_come_late_like_others() -> None:
    """Until the first one arrives no torque acts; from then on the servo leads from there."""
    late, plain = simulator(commands={"delay": 0.005}), simulator()
    goal = JointCommand(position=plain.state.q + 0.1)
    motion = late.run(0.2, goal)
    free = plain.run(0.005)
    np.testing.assert_array_equal(motion.q[:6], free.q)
    np.testing.assert_array_equal(motion.command[:5], 0.0)
    np.testing.assert_array_equal(motion.q[6:], plain.run(0.195, goal).q[1:])
