# SPDX-License-Identifier: Apache-2.0
"""The law of a spring between two points: tension, energy, cords, and ends that meet."""

from typing import Any

import numpy as np
import pytest

from arm_dynamics import Dynamics
from arm_dynamics.equations.spring import NEAR, stored, tension
from arm_dynamics.scene import PointSpring
from models.sprung import slope
from tolerances import CLOSED_FORM, SPRING, assert_close

# A bead of 1 kg on a wire along x, 0.3 m beside the world's origin.
BEAD = """<robot name="bead"><link name="ground"/><link name="bead"><inertial><mass value="1"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="wire" type="prismatic"><parent link="ground"/><child link="bead"/>
  <axis xyz="1 0 0"/><limit lower="-9" upper="9" effort="99" velocity="99"/></joint></robot>"""


def bead(aside: float, **about: Any) -> Dynamics:
    given = {"frames": ["bead", "world"], "points": [[0, 0, 0], [0, aside, 0]], **about}
    return Dynamics({"robot": {"urdf": BEAD}, "springs": [given]})


@pytest.mark.parametrize(("x", "speed"), [(-0.7, -2.0), (0.05, 0.0), (0.4, 3.0)])
def test_tension_along_the_line(x: float, speed: float) -> None:
    """k (L - L0) + c L' + T0, times x / L along the wire."""
    arm = bead(0.3, stiffness=200.0, rest_length=0.2, damping=5.0, force=7.0)
    L = np.hypot(x, 0.3)
    pull = 200.0 * (L - 0.2) + 5.0 * speed * x / L + 7.0
    assert_close(arm.spring([x], [speed]), [pull * x / L], CLOSED_FORM)


@pytest.mark.parametrize(
    ("x", "speed", "wanted"),
    [
        (0.4, 0.0, 20.0),  # taut at rest
        (0.4, 1.0, 25.0),  # drawn out: the damper adds
        (0.4, -1.0, 15.0),  # drawn in: it takes off
        (0.4, -9.0, 0.0),  # so fast that spring and damper would push
        (0.2, 9.0, 0.0),  # slack: the damper does nothing
        (0.2, -9.0, 0.0),
    ],
)
def test_a_cord_pulls_or_does_nothing(x: float, speed: float, wanted: float) -> None:
    arm = bead(0.0, stiffness=200.0, rest_length=0.3, damping=5.0, tension_only=True)
    assert_close(arm.spring([x], [speed]), [wanted], CLOSED_FORM)


LAWS: dict[str, dict[str, Any]] = {
    "spring": {"stiffness": 200.0, "rest_length": 0.3, "damping": 5.0, "force": -4.0},
    "cord": {"stiffness": 200.0, "rest_length": 0.3, "damping": 50.0, "tension_only": True},
    "cord of no length": {"stiffness": 200.0, "damping": 50.0, "tension_only": True},
    "weight": {"force": 12.0, "damping": 50.0, "tension_only": True},
}


@pytest.mark.parametrize("about", LAWS.values(), ids=LAWS)
def test_tension_is_the_slope_of_the_energy_and_dampers_only_ever_take(
    about: dict[str, Any], rng: np.random.Generator
) -> None:
    law = PointSpring(frames=("bead", "world"), **about)
    for L, speed in zip(rng.uniform(0.05, 0.8, 20), rng.normal(0.0, 5.0, 20), strict=True):
        if abs(L - law.rest_length) < 0.05:  # no difference across the kink of a cord
            continue
        pull = slope(lambda x: stored(law, x[0] ** 2), np.array([L]))
        assert_close(tension(law, L**2, 0.0)[0] * L, pull[0], SPRING)
        assert tension(law, L**2, L * speed)[1] * L * speed >= 0.0


@pytest.mark.parametrize("about", LAWS.values(), ids=LAWS)
def test_ends_that_meet_push_nowhere(about: dict[str, Any]) -> None:
    """The force passes through zero, from both sides and in both implementations."""
    arm = bead(0.0, **about)
    many = np.zeros((300, 1))
    for q, v in (([0.0], [0.0]), ([0.0], [3.0])):
        np.testing.assert_array_equal(arm.spring(q, v), [0.0])
        np.testing.assert_array_equal(arm.spring(many + q, many + v), many)
    assert np.isfinite(arm.energy([0.0], [0.0])).all()
    left, right = arm.spring([-NEAR / 10], [0.0]), arm.spring([NEAR / 10], [0.0])
    assert_close(left, -right, CLOSED_FORM)
