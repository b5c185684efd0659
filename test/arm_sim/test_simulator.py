# SPDX-License-Identifier: Apache-2.0
"""The stepper: state, time, reset, runs and effort limits."""

import dataclasses
import logging
import re
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_sim import Simulator
from arm_sim.inputs import tick_count

NAME = "planar_3r"
LIMITS = np.array([80.0, 40.0, 20.0])


@pytest.fixture
def sim() -> Simulator:
    return models.simulator(NAME)


def test_starts_where_the_scene_says_and_where_a_reset_puts_it() -> None:
    sim = models.simulator("two_link")
    assert (sim.state.time, sim.state.step, sim.arm.step_count) == (0.0, 0, 0)
    np.testing.assert_array_equal(sim.state.q, [-0.5, 0.8])
    np.testing.assert_array_equal(sim.state.v, [0.0, 0.0])
    sim.run(0.05, [1.0, 0.0])
    state = sim.reset([0.1, 0.2], [1.0, -1.0])
    assert state is sim.state and (state.time, state.step, sim.arm.step_count) == (0.0, 0, 0)
    np.testing.assert_array_equal(state.q, [0.1, 0.2])
    np.testing.assert_array_equal(state.v, [1.0, -1.0])
    np.testing.assert_array_equal(sim.effort, [0.0, 0.0])
    np.testing.assert_array_equal(sim.reset(v=[1.0, 0.0]).q, [-0.5, 0.8])


def test_time_is_counted_and_never_added_up(sim: Simulator) -> None:
    added = 0.0
    for _ in range(1000):
        sim.step(np.zeros(3))
        added += 1e-3
    assert (sim.arm.step_count, sim.state.step) == (1000, 1000)
    assert sim.state.time == 1000 * 1e-3 != added


def test_state_is_a_value(sim: Simulator) -> None:
    """Read-only, and a state in hand does not change as the simulation goes on."""
    state = sim.step(np.ones(3))
    kept = state.q.copy(), state.v.copy()
    for array in (state.q, state.v, state.z):
        assert not array.flags.writeable
    with pytest.raises(dataclasses.FrozenInstanceError):
        state.time = 0.0  # type: ignore[misc]
    sim.step(np.ones(3))
    np.testing.assert_array_equal(state.q, kept[0])
    np.testing.assert_array_equal(state.v, kept[1])
    assert sim.state is not state


def test_tables_functions_parts_and_steps_give_the_same_bits(rng: np.random.Generator) -> None:
    sim, torques = models.simulator(NAME), rng.normal(0.0, 5.0, (50, 3))
    run = sim.run(0.05, torques)
    sim.reset()
    by_function = sim.run(0.05, lambda state: torques[state.step])
    np.testing.assert_array_equal(by_function.q, run.q)
    np.testing.assert_array_equal(by_function.tau, run.tau)
    sim.reset()
    parts = sim.run(0.02, torques[:20]), sim.run(0.03, torques[20:])
    np.testing.assert_array_equal(np.vstack([parts[0].q, parts[1].q[1:]]), run.q)
    np.testing.assert_array_equal(np.r_[parts[0].time, parts[1].time[1:]], run.time)
    sim.reset()
    states = [sim.step(tau) for tau in torques]
    np.testing.assert_array_equal(run.q[1:], [state.q for state in states])
    np.testing.assert_array_equal(run.v[1:], [state.v for state in states])
    np.testing.assert_array_equal(run.time[1:], [state.time for state in states])
    for held, table in ((np.ones(3), np.ones((20, 3))), (None, np.zeros((20, 3)))):
        sim.reset()
        by_table = sim.run(0.02, table)
        sim.reset()
        np.testing.assert_array_equal(sim.run(0.02, held).q, by_table.q)


def test_torque_is_cut_at_the_limit_and_not_in_the_callers_array(sim: Simulator) -> None:
    tau = np.array([-1e6, 39.0, 1e300])
    cut = sim.step(tau)
    np.testing.assert_array_equal(tau, [-1e6, 39.0, 1e300])
    tau[:] = 0.0
    np.testing.assert_array_equal(sim.effort, [-80.0, 39.0, 20.0])
    sim.reset()
    np.testing.assert_array_equal(sim.step([-80.0, 39.0, 20.0]).v, cut.v)
    free = models.simulator("double_pendulum")
    free.step([1e5, -1e5])
    np.testing.assert_array_equal(free.effort, [1e5, -1e5])


def test_cut_torque_is_said_once_with_the_joint_and_its_farthest_command(
    caplog: pytest.LogCaptureFixture,
) -> None:
    sim = Simulator(models.scene(NAME))
    with caplog.at_level(logging.WARNING):
        sim.step(LIMITS)
        assert not caplog.records, "the limit itself is allowed"
        sim.run(3e-3, [[0.0, 41.0, 0.0], [0.0, -99.0, 1.0], [0.0, 60.0, 0.0]])
        sim.step([0.0, 0.0, 99.0])
    (said,) = caplog.messages
    assert said.startswith("command -99 N m of joint 'joint2' exceeds its limit of 40 N m")


@pytest.mark.parametrize(
    ("duration", "ticks", "told"),
    [
        (0, 0, ""), (np.float32(0.3), 300, ""), (3 * 0.1, 300, ""),
        (0.0006, 1, "0.0006 .* to 0.001 s"), (99.9999, 10**5, "99.9999 .* to 100 s"),
    ],
)  # fmt: skip
def test_a_duration_is_a_number_of_ticks_rounded_with_a_warning(
    duration: Any, ticks: int, told: str, caplog: pytest.LogCaptureFixture
) -> None:
    assert tick_count(duration, 1e-3) == ticks
    assert re.search(told, caplog.text) and bool(told) == len(caplog.records)
    with pytest.raises(InvalidInput, match="less than the time step of 0.001 s; allowed: 0, or"):
        tick_count(0.0005, 1e-3)
