# SPDX-License-Identifier: Apache-2.0
"""The stepper: state, time, reset, runs and effort limits."""

import dataclasses
import logging

import numpy as np
import pytest

import models
from arm_sim import Simulator

NAME = "planar_3r"
LIMITS = np.array([80.0, 40.0, 20.0])


@pytest.fixture
def sim() -> Simulator:
    return models.simulator(NAME)


def table(rng: np.random.Generator, ticks: int) -> np.ndarray:
    return rng.normal(0.0, 5.0, (ticks, 3))


def test_starts_where_the_scene_says() -> None:
    sim = models.simulator("two_link")
    assert (sim.state.time, sim.state.step, sim.arm.step_count) == (0.0, 0, 0)
    np.testing.assert_array_equal(sim.state.q, [-0.5, 0.8])
    np.testing.assert_array_equal(sim.state.v, [0.0, 0.0])
    np.testing.assert_array_equal(sim.effort, [0.0, 0.0])


def test_time_is_counted_and_never_added_up(sim: Simulator) -> None:
    added = 0.0
    for _ in range(1000):
        sim.step(np.zeros(3))
        added += 1e-3
    assert (sim.arm.step_count, sim.state.step) == (1000, 1000)
    assert sim.state.time == 1000 * 1e-3 != added


def test_the_callers_dt_overrides_that_of_the_scene() -> None:
    scene = {
        "robot": {"urdf": str(models.FOLDER / "gantry.urdf")},
        "sim": {"dt": 4e-3, "integrator": "euler"},
    }
    assert Simulator(scene).dt == 4e-3
    assert Simulator(scene).plan.integrator == "euler"
    assert Simulator(scene, integrator="rk4", dt=2e-3).dt == 2e-3
    assert Simulator(scene, integrator="rk4", dt=2e-3).plan.integrator == "rk4"


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


def test_callers_torque_is_not_touched_or_kept(sim: Simulator) -> None:
    tau = np.array([1000.0, 2.0, 3.0])
    first = sim.step(tau)
    np.testing.assert_array_equal(tau, [1000.0, 2.0, 3.0])
    tau[:] = 0.0
    np.testing.assert_array_equal(sim.effort, [80.0, 2.0, 3.0])
    np.testing.assert_array_equal(first.q, sim.state.q)


def test_reset(sim: Simulator) -> None:
    sim.run(0.05)
    q, v = np.array([0.1, 0.2, 0.3]), np.array([1.0, -1.0, 0.5])
    state = sim.reset(q, v)
    assert state is sim.state and (state.time, state.step, sim.arm.step_count) == (0.0, 0, 0)
    np.testing.assert_array_equal(state.q, q)
    np.testing.assert_array_equal(state.v, v)
    np.testing.assert_array_equal(sim.effort, np.zeros(3))
    np.testing.assert_array_equal(sim.reset(v=v).q, np.zeros(3))


def test_run_equals_steps_to_the_bit(sim: Simulator, rng: np.random.Generator) -> None:
    torques = table(rng, 50)
    run = sim.run(0.05, torques)
    sim.reset()
    states = [sim.step(tau) for tau in torques]
    np.testing.assert_array_equal(run.q[1:], [state.q for state in states])
    np.testing.assert_array_equal(run.v[1:], [state.v for state in states])
    np.testing.assert_array_equal(run.time[1:], [state.time for state in states])


def test_run_with_a_function_equals_a_table(sim: Simulator, rng: np.random.Generator) -> None:
    torques = table(rng, 50)
    by_table = sim.run(0.05, torques)
    sim.reset()
    by_function = sim.run(0.05, lambda state: torques[state.step])
    np.testing.assert_array_equal(by_table.q, by_function.q)
    np.testing.assert_array_equal(by_table.tau, by_function.tau)


def test_run_holds_a_vector_and_needs_none(sim: Simulator) -> None:
    held = sim.run(0.02, np.ones(3))
    sim.reset()
    np.testing.assert_array_equal(held.q, sim.run(0.02, np.ones((20, 3))).q)
    sim.reset()
    free = sim.run(0.02)
    sim.reset()
    np.testing.assert_array_equal(free.q, sim.run(0.02, np.zeros(3)).q)


def test_recording(sim: Simulator) -> None:
    sim.step(np.zeros(3))
    run = sim.run(0.01, [500.0, 1.0, 2.0])
    assert len(run) == 11
    assert run.q.shape == run.v.shape == run.tau.shape == (11, 3)
    assert run.time.shape == run.energy.shape == run.local_error.shape == (11,)
    np.testing.assert_array_equal(run.time, np.arange(1, 12) * 1e-3)
    np.testing.assert_array_equal(run.tau, np.tile([80.0, 1.0, 2.0], (11, 1)))
    np.testing.assert_array_equal(run.q[-1], sim.state.q)
    assert not any(array.flags.writeable for array in (run.time, run.q, run.v, run.tau))
    kinetic, potential = sim.dynamics.energy(run.q, run.v)
    np.testing.assert_array_equal(run.energy, kinetic + potential)


def test_run_goes_on_where_the_last_one_ended(sim: Simulator) -> None:
    whole = sim.run(0.04)
    sim.reset()
    halves = sim.run(0.02), sim.run(0.02)
    np.testing.assert_array_equal(np.vstack([halves[0].q, halves[1].q[1:]]), whole.q)
    np.testing.assert_array_equal(np.r_[halves[0].time, halves[1].time[1:]], whole.time)


def test_run_of_no_time(sim: Simulator) -> None:
    run = sim.run(0.0)
    assert len(run) == 1 and sim.arm.step_count == 0


def test_torque_is_cut_at_the_limit(sim: Simulator) -> None:
    cut = sim.step([-1e6, 39.0, 1e300])
    np.testing.assert_array_equal(sim.effort, [-80.0, 39.0, 20.0])
    sim.reset()
    np.testing.assert_array_equal(sim.step([-80.0, 39.0, 20.0]).v, cut.v)


def test_cut_torque_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    sim = Simulator(models.scene(NAME))
    with caplog.at_level(logging.WARNING):
        sim.step(LIMITS)
        assert not caplog.records, "the limit itself is allowed"
        for _ in range(3):
            sim.step([0.0, 41.0, 0.0])
        sim.run(0.01, [0.0, 0.0, 99.0])
    assert len(caplog.records) == 1
    assert all(word in caplog.text for word in ("joint2", "41", "40"))


def test_no_limit_cuts_nothing() -> None:
    sim = models.simulator("double_pendulum")
    sim.step([1e5, -1e5])
    np.testing.assert_array_equal(sim.effort, [1e5, -1e5])


def test_takes_lists_and_integers(sim: Simulator) -> None:
    by_list = sim.step([1, 2, 3]).q
    sim.reset()
    np.testing.assert_array_equal(by_list, sim.step(np.array([1.0, 2.0, 3.0])).q)


def test_zero_torque_at_rest_in_balance_stays_for_ever() -> None:
    sim = models.simulator("double_pendulum")
    sim.reset(q=[0.0, 0.0], v=[0.0, 0.0])
    run = sim.run(10.0)
    np.testing.assert_array_equal(run.q[-1], [0.0, 0.0])
