# SPDX-License-Identifier: Apache-2.0
"""Controllers in a run: objects with ``torque(state, reference)``, ours and others."""

import numpy as np
import own_controllers
import pytest

import models
from arm_dynamics import InvalidInput
from arm_dynamics.control import ComputedTorque, Settings
from arm_dynamics.exceptions import ControllerFailed
from arm_dynamics.trajectory import Waypoint, quintic
from arm_sim import ClosedLoop
from tolerances import assert_close


def test_a_controller_follows_a_motion_from_the_beginning_of_the_run() -> None:
    sim = models.simulator("two_link", dt=1e-3)
    control, q = ComputedTorque(sim.dynamics, 30.0), sim.state.q
    sim.run(0.1, control)
    way = quintic([Waypoint(0.0, q), Waypoint(0.5, q + [0.4, -0.3])])
    done = sim.run(0.5, control, way)
    expected = np.array([way.sample(0.001 * k).q for k in range(501)])
    assert_close(done.q, expected, 1e-4)


def test_one_of_ones_own_leads_a_closed_loop_along_trajectories() -> None:
    pair = ClosedLoop("two_link", "own_controllers:Springs", dt=1e-3)
    q = pair.simulator.state.q
    goal = q + [0.3, -0.2]
    pair.follow([Waypoint(0.5, goal)])
    done = pair.run(1.5)
    assert_close(done.q[-1], goal, 1e-3)
    other = ClosedLoop("two_link", own_controllers.Springs, dt=1e-3)
    other.follow([Waypoint(0.5, goal)])
    np.testing.assert_array_equal(other.run(1.5).q, done.q)


def test_a_failed_one_reports_it_in_a_closed_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    pair = ClosedLoop("two_link", own_controllers.Fails, dt=1e-3)
    pair.run(0.01)
    monkeypatch.setattr(own_controllers.Fails, "how", "nan")
    with pytest.raises(ControllerFailed, match="controller Fails returned"):
        pair.run(0.01)
    assert pair.simulator.arm.step_count == 10


def test_a_controller_for_another_arm_or_other_ticks_is_told(
    caplog: pytest.LogCaptureFixture,
) -> None:
    ClosedLoop("two_link", settings=Settings(bandwidth=10.0), dt=2e-3)
    assert "have dt = 0.001 s, but its torques act for 0.002 s" in caplog.text
    ClosedLoop("real_xarm7", controller_scene="panda")
    assert "panda_joint7, command the arm's, joint1, " in caplog.text
    with pytest.raises(
        InvalidInput, match="scene has the joints panda_.*; the arm has shoulder, "
    ):
        ClosedLoop("two_link", controller_scene="panda")
