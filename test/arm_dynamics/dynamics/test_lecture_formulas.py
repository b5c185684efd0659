# SPDX-License-Identifier: Apache-2.0
"""Formulas of lecture notes as docs/concepts/equations.md gives them, errata corrected.

The arm is the one of most lectures: two massless links with a point mass at the end of each.
"""

import numpy as np
import pytest

from arm_dynamics import Dynamics, Term
from models.two_bodies import two_bodies
from tolerances import CLOSED_FORM, assert_close

G, M1, M2, L1, L2 = 9.81, 1.3, 0.7, 0.6, 0.4
POINT_MASSES = two_bodies(L1, (M1, M2), (L1, L2))


@pytest.fixture(scope="module")
def arm() -> Dynamics:
    return Dynamics(POINT_MASSES)


def states(rng: np.random.Generator) -> np.ndarray:
    """Positions with the elbow bent, where the Jacobian has an inverse, and velocities."""
    q = np.column_stack([rng.uniform(-3, 3, 50), rng.uniform(0.3, 2.8, 50)])
    return np.hstack([q, rng.normal(size=(50, 2))])


def jacobian(q: np.ndarray) -> np.ndarray:
    """Velocity of the tip in the axes of the last link, per joint speed."""
    s2, c2 = np.sin(q[1]), np.cos(q[1])
    return np.array([[L1 * s2, 0.0], [L1 * c2 + L2, L2]])


def test_equation_of_motion(arm: Dynamics, rng: np.random.Generator) -> None:
    for x in states(rng):
        (q, v), a = np.split(x, 2), rng.normal(size=2)
        s2, c2, c1, c12 = np.sin(q[1]), np.cos(q[1]), np.cos(q[0]), np.cos(q[0] + q[1])
        m12 = M2 * (L1 * L2 * c2 + L2**2)
        M = [[M1 * L1**2 + M2 * (L1**2 + 2 * L1 * L2 * c2 + L2**2), m12], [m12, M2 * L2**2]]
        c = M2 * L1 * L2 * s2 * np.array([-(2 * v[0] * v[1] + v[1] ** 2), v[0] ** 2])
        g = [(M1 + M2) * L1 * G * c1 + M2 * G * L2 * c12, M2 * G * L2 * c12]
        assert_close(arm.mass_matrix(q), M, CLOSED_FORM)
        assert_close(arm.inverse(q, v, a, Term.CORIOLIS), c, CLOSED_FORM)
        assert_close(arm.gravity(q), g, CLOSED_FORM)


def test_mass_felt_at_the_tip(arm: Dynamics, rng: np.random.Generator) -> None:
    """Λ = J⁻ᵀ M J⁻¹ has m₂ + m₁ / s₂² in its corner, not m₁ / s₂; and Vᵀ Λ V = q̇ᵀ M q̇."""
    for x in states(rng):
        q, v = np.split(x, 2)
        J, M, s2 = jacobian(q), arm.mass_matrix(q), np.sin(q[1])
        felt = np.linalg.inv(J).T @ M @ np.linalg.inv(J)
        assert_close(felt, np.diag([M2 + M1 / s2**2, M2]), 100 * CLOSED_FORM)
        tip = J @ v
        assert_close(tip @ felt @ tip, v @ M @ v, 100 * CLOSED_FORM)


def test_multiplier_needs_independent_rows(arm: Dynamics, rng: np.random.Generator) -> None:
    """A M⁻¹ Aᵀ has no inverse if a row repeats; its pseudo-inverse gives the same acceleration."""
    for x in states(rng):
        q, torque = x[:2], rng.normal(size=2)
        W = np.linalg.inv(arm.mass_matrix(q))
        row = jacobian(q)[:1]
        once = row.T @ np.linalg.solve(row @ W @ row.T, row @ W @ torque)
        A = np.vstack([row, 2.0 * row])
        assert np.linalg.matrix_rank(A @ W @ A.T) == 1
        twice = A.T @ np.linalg.pinv(A @ W @ A.T, rcond=1e-12) @ (A @ W @ torque)
        assert_close(twice, once, 1e4 * CLOSED_FORM)


def test_mass_by_direction_of_force_and_of_acceleration(
    arm: Dynamics, rng: np.random.Generator
) -> None:
    """1 / (uᵀ Λ⁻¹ u) where the force has the direction u, uᵀ Λ u where the acceleration has it."""
    for x in states(rng):
        q, angle = x[:2], rng.uniform(0.3, 1.2)
        J, u = jacobian(q), np.array([np.cos(angle), np.sin(angle)])
        mobility = J @ np.linalg.solve(arm.mass_matrix(q), J.T)
        pushed = 1.0 / (u @ mobility @ u)
        led = u @ np.linalg.solve(mobility, u)
        assert led > pushed * (1.0 + 1e-6)
        along = np.eye(2)[0]  # an axis of Λ
        assert_close(
            1.0 / (along @ mobility @ along),
            along @ np.linalg.solve(mobility, along),
            100 * CLOSED_FORM,
        )


def test_gear_reflects_damping_by_its_square(rng: np.random.Generator) -> None:
    """B = r² B_m + B_l with θ_m = r θ_l, not r B_m + B_l: the power lost must be the same."""
    ratio, motor, link = 50.0, 2e-4, 0.3
    scene = {
        "robot": {"urdf": POINT_MASSES},
        "joints": {"shoulder": {"friction": {"viscous": ratio**2 * motor + link}}},
    }
    dyn = Dynamics(scene)
    for speed in rng.normal(size=10):
        v = np.array([speed, 0.0])
        lost = motor * (ratio * speed) ** 2 + link * speed**2
        assert_close(dyn.friction(v) @ v, lost, CLOSED_FORM)
        assert not np.isclose((ratio * motor + link) * speed**2, lost, rtol=0.1)
