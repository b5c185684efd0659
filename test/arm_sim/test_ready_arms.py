# SPDX-License-Identifier: Apache-2.0
"""Bundled scenes of industrial arms: their data are the published ones, and they stand still."""

from itertools import pairwise, product
from typing import Any

import numpy as np
import pages
import pytest
from samples import always

import models
from arm_dynamics.task_space import TaskSpace
from arm_dynamics.trajectory import hold
from tolerances import ALGEBRA, assert_close

G = 9.81


@pytest.mark.parametrize("name", (*models.REAL, *models.ARMS, *models.REAL_DRIVES))
def test_an_arm_begins_within_its_limits_and_can_hold_itself(name: str) -> None:
    model = models.dynamics(name).model
    assert (model.position_lower < model.q0).all() and (model.q0 < model.position_upper).all()
    holding = models.dynamics(name).gravity(model.q0)
    assert (abs(holding) < model.effort_limit).all() and np.isfinite(model.effort_limit).all()
    assert_close(holding, models.oracle(name).gravity(model.q0), ALGEBRA)


STAND_FOR_ALL = ("fr3", "real_ur5e")  # one of rigid joints, one with rotors


@pytest.mark.parametrize("name", always((*models.ARMS, *models.REAL_DRIVES), *STAND_FOR_ALL))
def test_an_arm_stays_where_its_weight_is_carried(name: str) -> None:
    sim = models.simulator(name)
    run = sim.run(0.2, lambda state: sim.dynamics.gravity(state.q))
    assert abs(run.q - run.q[0]).max() < 1e-9


@pytest.mark.parametrize(
    ("name", "kind"),
    always(
        product(
            (*models.REAL, "puma560", *models.ARMS, *models.REAL_DRIVES), ("Gentle", "Soft")
        ),
        ("panda", "Gentle"), ("kinova", "Soft"), ("puma560", "Gentle"),
        *product(STAND_FOR_ALL, ("Gentle", "Soft")),
    ),
)  # fmt: skip
def test_controllers_of_the_page_are_stable_on_every_arm(name: str, kind: str) -> None:
    made: dict[str, Any] = {}
    for step in pages.steps(pages.ROOT / "docs/how-to/own-controller.md"):
        if step.kind == "python":
            exec(step.text, made)
    sim = models.simulator(name)
    run = sim.run(0.3, made[kind](sim.dynamics), reference=hold(sim.state.q + 0.05))
    assert abs(run.v).max() < 0.25 and abs(run.q[-1] - run.q[0] - 0.05).max() < 0.051


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


def test_ur5e_moves_as_its_published_parameters_say(rng: np.random.Generator) -> None:
    dynamics = models.dynamics("ur5e")
    turned = np.diag([-1.0, -1.0, 1.0])  # the ROS base_link against the controller's base
    for q in rng.uniform(-np.pi, np.pi, (5, 6)):
        tool = ur5e_frames(q)[-1]
        pose = TaskSpace(dynamics, "tool0").pose(q)
        assert_close(pose.position, turned @ tool[:3, 3], ALGEBRA)
        assert_close(pose.rotation, turned @ tool[:3, :3], ALGEBRA)


def test_ur5e_weighs_what_its_published_parameters_say(rng: np.random.Generator) -> None:
    """τ_i = ∂/∂q_i Σ m g z, with each centre of mass carried along its frames."""
    for q in rng.uniform(-np.pi, np.pi, (5, 6)):
        frames = ur5e_frames(q)
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
        assert_close(models.dynamics("ur5e").gravity(q), expected, 1e-9)
