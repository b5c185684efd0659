# SPDX-License-Identifier: Apache-2.0
"""Where joints, springs, stops and forces are drawn."""

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, load_scene
from arm_sim import Simulator
from arm_sim.view.marks import Instant, Marker


def test_joints_are_where_the_textbook_has_them() -> None:
    """The elbow of a two-link arm at l (cos a, sin a), turned by a + b."""
    marker, (a, b) = Marker(models.dynamics("two_link").model), (0.7, -1.1)
    marks = marker.at(Instant(np.array([a, b])))
    elbow = marks.position[2] - marks.position[1]
    np.testing.assert_allclose(elbow, 0.5 * np.array([np.cos(a), 0.0, np.sin(a)]), atol=1e-12)
    angle = 2 * np.arccos(abs(marks.rotation[:, 0]))
    np.testing.assert_allclose(angle, [0.0, abs(a), abs(a + b)], atol=1e-7)


@pytest.mark.parametrize("scene", ["four_bar", "pen_arm"])
def test_forces_of_constraints_do_the_work_of_their_multipliers(
    scene: str, rng: np.random.Generator
) -> None:
    """Over all ways to open the loop: λ·A w = -f·(u̇ of its points), both by differences."""
    sim = Simulator(scene)
    sim.run(0.05)
    marker, q, lam = Marker(sim.model), sim.state.q, sim.multipliers()
    rows = sim.dynamics.constrained.closure.rows
    (point, force), *more = marker.at(Instant(q, multipliers=lam)).constraints
    assert not more
    assert np.linalg.norm(force) > 1e-3
    constraint, h = rows.constraints[0], 1e-6

    def apart(q: np.ndarray) -> np.ndarray:
        marker.at(Instant(q))
        ends = zip(constraint.frames, constraint.points, strict=True)
        first, second = (marker._point(*end) for end in ends)
        return np.asarray(first - second)

    for _ in range(3):
        w = rng.standard_normal(sim.n)
        opening = (apart(q + h * w) - apart(q - h * w)) / (2 * h)
        work = lam @ (rows.stacked(q, 0 * w, rows.names).jacobian @ w)
        np.testing.assert_allclose(force @ opening, -work, rtol=1e-6, atol=1e-7)


def test_a_coupling_is_not_drawn_and_keeps_its_own_multiplier() -> None:
    scene = models.scene("four_bar").model_dump(exclude_unset=True)
    (loop,), gear = scene["constraints"], {
        "type": "coupling", "joints": ["crank_pivot", "knee"], "ratio": -2.0,
    }  # fmt: skip
    alone = ArmModel(load_scene(scene))
    scene["constraints"] = [gear, loop]
    together, own = ArmModel(load_scene(scene)), [3.0, -2.0, 0.5]
    lam = [7.0, *own]
    (mark,) = Marker(together).at(Instant(alone.q0, multipliers=np.array(lam))).constraints
    (wanted,) = Marker(alone).at(Instant(alone.q0, multipliers=np.array(own))).constraints
    np.testing.assert_allclose(mark, wanted, atol=1e-12)


def test_a_spring_is_between_its_points_and_a_stop_where_the_joint_is() -> None:
    model = models.dynamics("spring_balanced_arm").model
    marks = Marker(model).at(Instant(model.q0))
    assert marks.springs.shape == (len(model.scene.springs), 2, 3)
    panda = models.dynamics("panda").model
    q = panda.q0.copy()
    q[3] = panda.position_lower[3]
    marks = Marker(panda).at(Instant(q))
    np.testing.assert_array_equal(marks.at_stop, np.arange(7) == 3)
    held = Instant(q, stop_torque=np.zeros(7))  # it is there, and nothing holds it
    assert not Marker(panda).at(held).at_stop.any()


def test_the_hand_is_the_link_farthest_out() -> None:
    assert Marker(models.dynamics("panda").model).hand == "panda_hand_tcp"
