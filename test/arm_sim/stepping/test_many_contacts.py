# SPDX-License-Identifier: Apache-2.0
"""A box on eight balls, more than it has motions: it settles, slides and is lifted."""

import numpy as np
import pytest

from arm_sim import Simulator
from models.touching import contact, free_body
from tolerances import CLOSED_FORM, assert_close

G = 9.81
MASS, MU, HEIGHT = 2.0, 0.4, 0.1
FACE = [(x, y) for x in (-0.03, 0.03) for y in (-0.08, 0.08)]
FACE += [(0.0, -0.08), (0.0, 0.08), (0.03, 0.0), (-0.03, 0.0)]


@pytest.fixture(scope="module")
def box() -> Simulator:
    """Eight places on its lower face, three on each edge: they touch where z = ``HEIGHT``."""
    r = 0.02
    feet = [
        contact("body", point=[x, y, r - HEIGHT], radius=r, friction=MU, name=f"foot{k}")
        for k, (x, y) in enumerate(FACE)
    ]
    start = {"initial": {"position": {"z": HEIGHT + 1e-3}}}
    return Simulator({**free_body(MASS, [0.02, 0.01, 0.02]), **start, "constraints": feet})


def settled(box: Simulator) -> None:
    """Dropped askew by a hundredth of a millimetre, and pressed."""
    box.reset(q=[0, 0, HEIGHT + 1e-3, 1e-4, -2e-4, 0], v=np.zeros(6))
    box.run(0.3, [0, 0, -30.0, 0, 0, 0])


def test_it_comes_to_rest_on_all_eight(box: Simulator) -> None:
    settled(box)
    run = box.run(0.1, [0, 0, -30.0, 0, 0, 0])
    forces = box.contact_forces()
    assert {force.state for force in forces} == {"sticks"}
    assert_close([force.normal for force in forces], np.full(8, (30 + MASS * G) / 8), 1e-9)
    np.testing.assert_array_equal(run.v, np.zeros_like(run.v))
    np.testing.assert_array_equal(run.q, np.broadcast_to(run.q[0], run.q.shape))


def test_it_slides_when_it_is_pushed_harder_than_friction(box: Simulator) -> None:
    """At the height of its feet, so that nothing tips it."""
    settled(box)
    press, push = 30.0 + MASS * G, 25.0
    before = box.state.q
    level = push * np.array([0.6, 0.8])
    tilt = [level[1] * HEIGHT, -level[0] * HEIGHT]
    run = box.run(0.1, [*level, -30.0, *tilt, 0.0])
    assert {force.state for force in box.contact_forces()} == {"slides"}
    a = (push - MU * press) / MASS
    way = 0.5 * a * np.outer((run.time - run.time[0]) ** 2, [0.6, 0.8])
    assert_close(run.q[:, :2] - before[:2], way, 1e-9)
    assert_close(run.q[:, 2], np.full(len(run), HEIGHT), CLOSED_FORM)


def test_it_is_lifted_off_all_eight_at_once(box: Simulator) -> None:
    settled(box)
    run = box.run(0.05, [0, 0, 2.0 * MASS * G, 0, 0, 0])
    assert {force.state for force in box.contact_forces()} == {"apart"}
    assert_close(run.q[:, 2] - HEIGHT, 0.5 * G * (run.time - run.time[0]) ** 2, 1e-10)
