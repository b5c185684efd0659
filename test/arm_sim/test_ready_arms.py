# SPDX-License-Identifier: Apache-2.0
"""Bundled scenes of industrial arms and of their drives: published data, and what they do."""

from itertools import pairwise

import numpy as np
import pytest

import models
from arm_dynamics import Term
from arm_dynamics.task_space import TaskSpace
from arm_dynamics.trajectory import Waypoint
from arm_sim.simulation.closed_loop import ClosedLoop
from tolerances import ALGEBRA, assert_close

G = 9.81


@pytest.mark.parametrize("name", (*models.REAL, *models.ARMS, *models.REAL_DRIVES))
def test_an_arm_begins_within_its_limits_and_can_hold_itself(name: str) -> None:
    model = models.dynamics(name).model
    assert (model.position_lower < model.q0).all() and (model.q0 < model.position_upper).all()
    holding = models.dynamics(name).gravity(model.q0)
    assert (abs(holding) < model.effort_limit).all() and np.isfinite(model.effort_limit).all()
    assert_close(holding, models.oracle(name).gravity(model.q0), ALGEBRA)


# Franka Robotics, franka_description, robots/fr3/joint_limits.yaml: lower, upper, speed, torque
FR3 = np.array([
    (-2.7437, 2.7437, 2.62, 87), (-1.7837, 1.7837, 2.62, 87), (-2.9007, 2.9007, 2.62, 87),
    (-3.0421, -0.1518, 2.62, 87), (-2.8065, 2.8065, 5.26, 12), (0.5445, 4.5169, 4.18, 12),
    (-3.0159, 3.0159, 5.26, 12),
])  # fmt: skip


def test_fr3_has_the_limits_that_its_maker_publishes() -> None:
    m = models.dynamics("fr3").model
    limits = m.position_lower, m.position_upper, m.velocity_limit, m.effort_limit
    np.testing.assert_array_equal(np.transpose(limits), FR3)


# Universal Robots, "DH parameters for calculations of kinematics and dynamics", UR5e: standard
# Denavit-Hartenberg a, d, alpha; mass and centre of mass in the link's Denavit-Hartenberg frame.
UR5E = [
    (0.0, 0.1625, np.pi / 2, 3.761, (0, -0.02561, 0.00193)),
    (-0.425, 0.0, 0.0, 8.058, (0.2125, 0, 0.11336)),
    (-0.3922, 0.0, 0.0, 2.846, (0.15, 0, 0.0265)),
    (0.0, 0.1333, np.pi / 2, 1.37, (0, -0.0018, 0.01634)),
    (0.0, 0.0997, -np.pi / 2, 1.3, (0, 0.0018, 0.01634)),
    (0.0, 0.0996, 0.0, 0.365, (0, 0, -0.001159)),
]  # fmt: skip


def ur5e_frames(q: np.ndarray) -> list[np.ndarray]:
    """Denavit-Hartenberg frames 0 to 6 in frame 0, the UR controller's base."""
    frames = [np.eye(4)]
    for angle, (a, d, alpha, _, _) in zip(q, UR5E, strict=True):
        c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(alpha), np.sin(alpha)
        step = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d]]
        frames.append(frames[-1] @ np.vstack((step, [0, 0, 0, 1])))
    return frames


def test_ur5e_is_that_of_its_published_parameters(rng: np.random.Generator) -> None:
    """τ_i = ∂/∂q_i Σ m g z, with each centre of mass carried along its frames."""
    dynamics = models.dynamics("ur5e")
    turned = np.diag([-1.0, -1.0, 1.0])  # the ROS base_link against the controller's base
    for q in rng.uniform(-np.pi, np.pi, (5, 6)):
        frames = ur5e_frames(q)
        pose = TaskSpace(dynamics, "tool0").pose(q)
        assert_close(pose.position, turned @ frames[-1][:3, 3], ALGEBRA)
        assert_close(pose.rotation, turned @ frames[-1][:3, :3], ALGEBRA)
        centres = [
            frame @ (*com, 1.0) for frame, (_, _, _, _, com) in zip(frames[1:], UR5E, strict=True)
        ]
        expected = [
            sum(
                UR5E[k][3] * G * np.cross(before[:3, 2], (centres[k] - before[:, 3])[:3])[2]
                for k in range(i, 6)
            )
            for i, (before, _) in enumerate(pairwise(frames))
        ]
        assert_close(dynamics.gravity(q), expected, 1e-9)


# Gaz et al., supplementary material: A [N m], o [rad/s], alpha [s/rad] of
# A / (1 + exp(-alpha (v + o))) - A / (1 + exp(-alpha o)).
GAZ = np.array([
    [0.54615, 0.87224, 0.64068, 1.2794, 0.83904, 0.30301, 0.56489],
    [0.039533, 0.025882, -0.04607, 0.036194, 0.026226, -0.021047, 0.0035526],
    [5.1181, 9.0657, 10.136, 5.5903, 8.3469, 17.133, 10.336],
])  # fmt: skip


@pytest.mark.parametrize("name", models.REAL_DRIVES)
def test_it_follows_a_quintic_at_half_its_limits_by_computed_torque(
    name: str, rng: np.random.Generator
) -> None:
    """All joints at once, each up to half its speed limit; 15/8 of the mean speed is the peak."""
    pair = ClosedLoop(models.SCENES / f"{name}.yaml", dt=1e-3)
    sim, duration = pair.simulator, 0.8
    model, start = sim.model, sim.state.q
    away = 0.5 * model.velocity_limit * duration * 8.0 / 15.0 * rng.choice([-1.0, 1.0], sim.n)
    beyond = (start + away > model.position_upper) | (start + away < model.position_lower)
    way = pair.follow([Waypoint(duration, start + np.where(beyond, -away, away))])
    assert way.stretch == 1.0
    run = pair.run(duration)
    wanted = np.array([way.sample(t).q for t in run.time])
    np.testing.assert_allclose(np.abs(run.v).max(0), 0.5 * model.velocity_limit, rtol=0.02)
    assert (np.sqrt(np.mean((run.q - wanted) ** 2, axis=0)) < 1e-3).all()
    assert (np.abs(run.tau) < model.effort_limit).all()


def test_friction_of_the_panda_is_the_published_one_where_it_has_levelled_off() -> None:
    A, o, alpha = GAZ
    for v in (-2.0, 2.0):
        published = A / (1 + np.exp(-alpha * (v + o))) - A / (1 + np.exp(-alpha * o))
        still = np.zeros(7)
        ours = models.dynamics("real_panda").inverse(
            still, np.full(7, v), still, terms=Term.FRICTION
        )
        np.testing.assert_allclose(ours, published, atol=7e-3)
