# SPDX-License-Identifier: Apache-2.0
"""Gaps, relative velocities and forces of contacts against Pinocchio's kinematics."""

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import ArmModel, Dynamics, load_scene
from arm_sim.plant.plant import Plant
from models.touching import contact
from reference.independent.tree import Point, Tree
from tolerances import ALGEBRA, FINITE_DIFF, assert_close

BALL, POINT = 0.07, 0.0
NORMAL = np.array([0.48, -0.6, 0.64])
PLACE, ON_PLANE = np.array([0.03, -0.05, 0.1034]), np.array([0.1, 0.2, -0.4])
FINGERS = ["panda_finger_joint1", "panda_finger_joint2"]
CASES = [
    ("panda_link3", "panda_hand", BALL), ("panda_hand", "panda_link3", POINT),
    ("panda_hand", "panda_link0", BALL), ("world", "panda_hand", POINT),
]  # fmt: skip
ANY = pytest.mark.parametrize(("plane", "frame", "radius"), CASES)


def scene(plane: str, frame: str, radius: float) -> dict[str, Any]:
    """A Panda with one contact, nothing about which lies along an axis."""
    surface = {"frame": plane, "point": ON_PLANE.tolist(), "normal": NORMAL.tolist()}
    touch = contact(frame, point=PLACE.tolist(), radius=radius, friction=0.4, plane=surface)
    robot = {"urdf": models.scene("panda").robot.urdf, "lock": FINGERS}
    joints = {"*": {"limits": {"stop": False}}}
    return {"robot": robot, "joints": joints, "constraints": [touch]}


@cache
def plant(*about: Any) -> Plant:
    return Plant(ArmModel(load_scene(scene(*about))))


class Bodies:
    """The ball and its plane at a state, by Pinocchio."""

    def __init__(self, plane: str, frame: str, radius: float) -> None:
        self.tree = Tree(scene(plane, frame, radius), {})
        self._plane, self._frame, self._radius = plane, frame, radius

    def at(self, q: np.ndarray, v: np.ndarray) -> dict[str, np.ndarray]:
        self.tree.move(q, v)
        n = self._placement(self._plane).rotation @ NORMAL
        apart = self._place(self._frame, PLACE) - self._place(self._plane, ON_PLANE)
        touching = self._place(self._frame, PLACE) - self._radius * n
        return {
            "normal": n, "point": touching, "gap": n @ apart - self._radius,
            "speed": self.rows(touching) @ v,
        }  # fmt: skip

    def rows(self, point: np.ndarray) -> np.ndarray:
        """Velocity of the ball's material point against the plane's by joint velocity, (3, n)."""
        ball, plane = (
            Point(self.tree, frame, self._placement(frame).actInv(point)).jacobian()
            for frame in (self._frame, self._plane)
        )
        return ball - plane

    def _place(self, frame: str, point: np.ndarray) -> np.ndarray:
        return Point(self.tree, frame, point).place()

    def _placement(self, frame: str) -> pin.SE3:
        model, data = self.tree.model, self.tree.data
        return pin.SE3.Identity() if frame == "world" else data.oMf[model.getFrameId(frame)]


def state(seed: int, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.5, 1.5, n), rng.normal(size=n), rng.normal(0.0, 5.0, n)


@ANY
def test_gap_velocity_and_place_are_those_of_the_material_points(
    plane: str, frame: str, radius: float
) -> None:
    made = plant(plane, frame, radius)
    for seed in range(3):
        q, v, _ = state(seed, made.model.n)
        wanted = Bodies(plane, frame, radius).at(q, v)
        assert made.mechanics.contact is not None
        place, speed, size = (
            np.array(x).ravel() for x in made.mechanics.contact.geometry(np.hstack([q, v]))
        )
        sites = np.array(made.mechanics.contact.sites(q))
        assert_close(place[0], wanted["gap"], ALGEBRA)
        assert_close(sites[:, 0], wanted["normal"], ALGEBRA)
        assert_close(sites[:, 3], wanted["point"], ALGEBRA)
        assert_close(sites[:, :3].T @ sites[:, :3], np.eye(3), ALGEBRA)
        assert_close(speed, sites[:, :3].T @ wanted["speed"], ALGEBRA)
        assert size[0] > abs(place[0]) + radius


@ANY
@pytest.mark.parametrize("sticks", [1.0, 0.0])
def test_forces_act_on_both_bodies_and_hold_what_they_are_to_hold(
    plane: str, frame: str, radius: float, sticks: float
) -> None:
    """M a + h = τ + (J_ball - J_plane)ᵀ F; material points that stick do not accelerate."""
    made = plant(plane, frame, radius)
    dynamics, bodies = Dynamics(made.model), Bodies(plane, frame, radius)
    q, v, tau = state(5, made.model.n)
    p = np.array([1.0, sticks, 0.6, 0.8, 1.0])
    assert made.mechanics.contact is not None
    a = np.array(made.mechanics.acceleration(q, v, tau, p)).ravel()
    loads = made.events["loads"]
    found = loads(np.hstack([q, v]), tau, p)
    _, force, rate, *_ = (np.array(x).ravel() for x in found)
    sites = np.array(made.mechanics.contact.sites(q))
    if not sticks:
        assert_close(force[1:], -0.4 * force[0] * p[2:4], ALGEBRA)
    bodies.at(q, v)
    push = bodies.rows(sites[:, 3]).T @ (sites[:, :3] @ force)
    assert_close(dynamics.inverse(q, v, a), tau + push, ALGEBRA)
    held = 3 if sticks else 1
    assert_close(rate[:held], np.zeros(held), 1e-8)

    def speed(h: float) -> np.ndarray:
        """In the plane's own axes, by Pinocchio's velocities, along the motion."""
        there, moving = q + h * v + 0.5 * h**2 * a, v + h * a
        assert made.mechanics.contact is not None
        axes = np.array(made.mechanics.contact.sites(there))[:, :3]
        return np.array(axes.T @ bodies.at(there, moving)["speed"])

    h = 1e-5
    assert_close(rate, (speed(h) - speed(-h)) / (2 * h), FINITE_DIFF)
