# SPDX-License-Identifier: Apache-2.0
"""Sim and controller close the loop, driven by hand: no clock, so the same on every machine.

Commands of arms with drives are currents and voltages.
"""

from typing import Any

import numpy as np
import pytest
from harness import Ros
from sim_by_hand import by_hand, command, next_command
from two_link_control import point, state, trajectory

import models
from arm_dynamics.ros import ControllerNode
from arm_sim.ros.commands.latest import LatestCommand

pytestmark = pytest.mark.ros

RMS = 1e-3  # [rad] with a perfect model
HOME = models.dynamics("panda").model.q0
THERE_AND_BACK = HOME + 0.5 * np.array([[1, -1, 1, -1, 1, -1, 1], [0] * 7])


def followed(
    ros: Ros, scene: str, goals: Any, ticks: int, has_velocities: bool = True, **parameters: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Errors and positions at each tick of an arm that is led to a goal in each second.

    Each state is answered within its tick.
    """
    sim = by_hand(ros, scene, integrator="rk4")
    parameters = {"bandwidth": [20.0], **parameters}
    controller = ros.add(ControllerNode, models.scene(scene), **parameters)
    names = list(sim.simulator.joint_names)
    points = [point(second, *goal) for second, goal in enumerate(goals, 1)]
    errors, positions = [], []
    for tick in range(ticks):
        now = sim.simulator.state
        message = state(sim.engine.stamp, now.q, now.v if has_velocities else (), names)
        sim.inputs.on_joint_commands(controller.on_joint_states(message))
        if tick == 0:
            controller.on_joint_trajectory(trajectory(*points, names=names))
        sim.tick()
        now = sim.simulator.state
        reference = controller.goals.follower.reference(round(1e9 * now.time))
        errors.append(reference.q - now.q)
        positions.append(now.q)
    assert not controller._log.ignored_count
    return np.array(errors), np.array(positions)


@pytest.mark.parametrize(
    "parameters", [{}, {"velocities": "positions", "velocity_cutoff": 150.0}],
    ids=["by velocities", "without"],
)  # fmt: skip
def test_tracks_with_a_perfect_model(ros: Ros, parameters: dict[str, Any]) -> None:
    errors, positions = followed(ros, "panda", THERE_AND_BACK, 2500, not parameters, **parameters)
    assert np.sqrt(np.mean(errors**2)) < RMS
    assert np.ptp(positions, axis=0).min() > 0.4
    np.testing.assert_allclose(positions[-1], HOME, rtol=0.0, atol=RMS)


@pytest.mark.parametrize(
    ("scene", "goal", "error"),
    [("motor_pendulum", [1.2], 5e-3), ("flexible_arm", [0.3, -0.6], 1e-2)],
)
def test_controller_leads_an_arm_through_its_motors(
    ros: Ros, scene: str, goal: list[float], error: float
) -> None:
    """Voltages on a motor, a harmonic drive and a belt: the node finds commands by itself."""
    errors, _ = followed(ros, scene, [goal], 1500)
    assert np.abs(errors).max() < error
    assert np.abs(errors[-1]).max() < error / 2


def test_a_voltage_on_the_topic_and_its_limit(ros: Ros) -> None:
    sim = by_hand(ros, "motor_pendulum")
    sim.inputs.on_joint_commands(command(name=["swing"], effort=[100.0]))
    for _ in range(20):
        sim.tick()
    current = sim.simulator.state.z[0]
    assert 0.0 < current < 24.0 / 0.8
    np.testing.assert_allclose(sim.simulator.effort, 50 * 0.05 * current, rtol=1e-12)


def test_gravity_is_carried_by_commands_of_the_drives_where_springs_leave_any() -> None:
    """Volts on a motor: the current that gives the torque, times the resistance."""
    for name, *q in ("motor_pendulum", 0.7), ("spring_balanced_arm", 0.3, -0.4):
        dynamics = models.dynamics(name)
        slot, weight = LatestCommand(dynamics), dynamics.gravity(np.array(q))
        slot.configure(1, "gravity")
        assert abs(weight).max() > 0.2
        wanted = 0.8 * weight / (50 * 0.05) if name == "motor_pendulum" else np.zeros(2)
        acting = next_command(slot, np.array(q))
        np.testing.assert_allclose(acting, wanted, rtol=1e-12, atol=1e-12)
