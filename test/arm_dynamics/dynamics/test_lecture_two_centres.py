# SPDX-License-Identifier: Apache-2.0
"""The two-link arm of lecture notes with two centres of mass, as docs/concepts/errata.md has it.

Kinetic energy by Jacobians, Christoffel's symbols one by one, and the weight.
"""

import numpy as np
import pytest

from arm_dynamics import Dynamics, Term
from models.two_bodies import two_bodies
from tolerances import CLOSED_FORM, assert_close

G, M1, M2, L1, C1, C2, I1, I2 = 9.81, 1.3, 0.7, 0.6, 0.25, 0.15, 0.03, 0.011


@pytest.fixture(scope="module")
def arm() -> Dynamics:
    return Dynamics(two_bodies(L1, (M1, M2), (C1, C2), (I1, I2)))


def inertia(q: np.ndarray) -> np.ndarray:
    """D = m₁ J₁ᵀJ₁ + m₂ J₂ᵀJ₂ + I₁ [1 0; 0 0] + I₂ [1 1; 1 1], the Jacobians as printed."""
    s1, c1, s12, c12 = np.sin(q[0]), np.cos(q[0]), np.sin(q.sum()), np.cos(q.sum())
    one = np.array([[-C1 * s1, 0.0], [C1 * c1, 0.0]])
    two = np.array([[-L1 * s1 - C2 * s12, -C2 * s12], [L1 * c1 + C2 * c12, C2 * c12]])
    turning = I1 * np.array([[1.0, 0.0], [0.0, 0.0]]) + I2 * np.ones((2, 2))
    return M1 * one.T @ one + M2 * two.T @ two + turning


def test_mass_matrix_and_weight(arm: Dynamics, rng: np.random.Generator) -> None:
    for q in rng.normal(size=(20, 2)):
        far = M2 * C2 * G * np.cos(q.sum())
        weight = [(M1 * C1 + M2 * L1) * G * np.cos(q[0]) + far, far]
        assert_close(arm.mass_matrix(q), inertia(q), CLOSED_FORM)
        assert_close(arm.gravity(q), weight, CLOSED_FORM)


def symbols(q: np.ndarray) -> np.ndarray:
    """c_ijk as printed, shape (2, 2, 2): h = -m₂ l₁ l_c2 sin q₂."""
    h, c = -M2 * L1 * C2 * np.sin(q[1]), np.zeros((2, 2, 2))
    c[0, 0, 1] = -h  # C_112
    c[0, 1, 0] = c[1, 0, 0] = c[1, 1, 0] = h  # C_121, C_211, C_221
    return c


def test_elements_of_c_are_sums_of_christoffel_symbols(
    arm: Dynamics, rng: np.random.Generator
) -> None:
    """c_kj = Σ_i c_ijk q̇_i; the printed "elements of matrix C" are the symbols c_ijk."""
    for q, v in rng.normal(size=(20, 2, 2)):
        c = symbols(q)
        C = np.einsum("ijk,i->kj", c, v)
        assert_close(arm.coriolis_matrix(q, v), C, CLOSED_FORM)
        torque = arm.inverse(q, v, np.zeros(2), Term.CORIOLIS)
        assert_close(torque, np.einsum("ijk,i,j->k", c, v, v), CLOSED_FORM)
        turned = inertia(q + 1e-6 * v) - inertia(q - 1e-6 * v)
        skew = turned / 2e-6 - 2 * C
        np.testing.assert_allclose(skew, -skew.T, atol=1e-8)


def test_only_christoffel_symbols_make_a_skew_matrix(
    arm: Dynamics, rng: np.random.Generator
) -> None:
    """C = [0, h (2 q̇₁ + q̇₂); -h q̇₁, 0] gives the same torques, and Ḋ - 2 C is not skew."""
    for q, v in rng.normal(size=(20, 2, 2)):
        h = -M2 * L1 * C2 * np.sin(q[1])
        C = np.array([[0.0, h * (2 * v[0] + v[1])], [-h * v[0], 0.0]])
        assert_close(C @ v, arm.inverse(q, v, np.zeros(2), Term.CORIOLIS), CLOSED_FORM)
        turned = (inertia(q + 1e-6 * v) - inertia(q - 1e-6 * v)) / 2e-6
        assert abs((turned - 2 * C) + (turned - 2 * C).T).max() > abs(h * v[1])
