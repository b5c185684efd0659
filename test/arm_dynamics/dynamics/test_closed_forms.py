# SPDX-License-Identifier: Apache-2.0
"""Equations of motion that a textbook writes out, and positions that wrap around."""

import numpy as np

import models
from tolerances import CLOSED_FORM, assert_close

G = 9.81


def test_pendulum(rng: np.random.Generator) -> None:
    """m l² a + m g l sin q = tau."""
    dyn = models.dynamics("pendulum")
    for _ in range(20):
        q, v, a = models.random_state(rng, 1)
        assert_close(dyn.inverse(q, v, a), a + G * np.sin(q), CLOSED_FORM)
        assert_close(dyn.forward(q, v, a), a - G * np.sin(q), CLOSED_FORM)
        kinetic, potential = dyn.energy(q, v)
        assert_close([kinetic, potential], [v[0] ** 2 / 2, -G * np.cos(q[0])], CLOSED_FORM)


def test_gantry(rng: np.random.Generator) -> None:
    """Slides only: M is constant, nothing couples, and gravity acts along the incline of 0.6."""
    dyn = models.dynamics("gantry")
    for _ in range(20):
        q, v, a = models.random_state(rng, 2)
        assert_close(dyn.inverse(q, v, a), [15 * a[0] + 15 * G * 0.6, 3 * a[1]], CLOSED_FORM)
        assert_close(dyn.coriolis_matrix(q, v), np.zeros((2, 2)), CLOSED_FORM)


def test_scara_weight_is_on_the_slide_alone(rng: np.random.Generator) -> None:
    """Its revolute axes are vertical; the slide points down, so the drive pulls the quill up."""
    dyn = models.dynamics("scara")
    for q in rng.uniform(-2, 2, (10, 4)):
        assert_close(dyn.gravity(q), [0.0, 0.0, -G * (0.8 + 0.3), 0.0], CLOSED_FORM)


def test_a_turn_more_changes_nothing(rng: np.random.Generator) -> None:
    """Continuous joints may wind up without limit."""
    for name in ("kinova", "scara", "skew_axes", "double_pendulum"):
        dyn = models.dynamics(name)
        continuous = np.array([kind == "continuous" for kind in dyn.model.joint_types])
        assert continuous.any()
        q, v, a = models.random_state(rng, dyn.n)
        turned = q + 2 * np.pi * continuous
        assert_close(dyn.inverse(turned, v, a), dyn.inverse(q, v, a), CLOSED_FORM)
