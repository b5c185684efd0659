# SPDX-License-Identifier: Apache-2.0
"""The installed package answers the equations of motion of a pendulum as the books do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from arm_dynamics import Dynamics, Term, load_scene
from arm_dynamics.control import make_controller
from arm_dynamics.trajectory import Reference

ANGLES = np.linspace(-3.0, 3.0, 13)[:, None]


@pytest.fixture(scope="module")
def dynamics(pendulum: Any) -> Dynamics:
    return Dynamics(load_scene(pendulum.urdf))


def test_inverse_dynamics(dynamics: Dynamics, pendulum: Any) -> None:
    q, v, a = ANGLES, 0.5 * ANGLES, 1.0 - ANGLES
    inertia = pendulum.about_joint * a
    expected = inertia + pendulum.weight * np.sin(q) + pendulum.damping * v
    np.testing.assert_allclose(dynamics.inverse(q, v, a), expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(dynamics.inverse(q, v, a, terms=Term.INERTIA), inertia, rtol=1e-12)


def test_a_controller_holds_the_weight(dynamics: Dynamics, pendulum: Any) -> None:
    q, still = np.array([0.7]), np.zeros(1)
    control = make_controller("computed_torque", dynamics)
    tau = control.torque(Reference(q, still, still), Reference(q, still, still))
    np.testing.assert_allclose(tau, pendulum.weight * np.sin(q), rtol=1e-9)
