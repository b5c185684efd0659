# SPDX-License-Identifier: Apache-2.0
"""Forces of many contacts, more than the arm has motions, against least squares by numpy."""

import casadi as ca
import numpy as np
import pytest

from arm_dynamics.equations.contact import Delassus
from tolerances import ALGEBRA, INVERSE_PAIR, assert_close

N = 7


def robot(contacts: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of contacts of one body, of rank 6; M⁻¹; accelerations that some motion has."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(3 * contacts, 6)) @ rng.normal(size=(6, N))
    half = rng.normal(size=(N, N))
    return A, np.linalg.inv(half @ half.T + np.eye(N)), A @ rng.normal(size=N)


@pytest.mark.parametrize(("contacts", "seed"), [(4, 0), (8, 1)])
def test_forces_that_hold_are_the_least_ones(contacts: int, seed: int) -> None:
    A, M_inverse, free = robot(contacts, seed)
    rows = np.repeat(np.random.default_rng(seed).random(contacts) < 0.8, 3).astype(float)
    solver = Delassus(ca.SX(A), ca.SX(M_inverse @ A.T))
    force = numbers(solver.forces(ca.SX(free), ca.SX(np.diag(rows)), ca.SX(rows)))
    held = rows > 0
    W = (A @ M_inverse @ A.T)[np.ix_(held, held)]
    least = -np.linalg.lstsq(W, free[held], rcond=1e-10)[0]
    assert_close(force[held], least, INVERSE_PAIR)
    assert not force[~held].any()
    moved = numbers(solver.accelerations(ca.SX(force)))
    assert_close((moved + free)[held], np.zeros(held.sum()), ALGEBRA)


@pytest.mark.parametrize("seed", range(2))
def test_sliding_contacts_bear_friction_against_their_directions(seed: int) -> None:
    A, M_inverse, free = robot(8, seed)
    angle = np.random.default_rng(seed).uniform(0, 6.28, 8)
    D, rows = np.zeros((24, 24)), np.tile([1.0, 0.0, 0.0], 8)
    D[range(0, 24, 3), range(0, 24, 3)] = 1.0
    D[range(1, 24, 3), range(0, 24, 3)] = -0.1 * np.cos(angle)
    D[range(2, 24, 3), range(0, 24, 3)] = -0.1 * np.sin(angle)
    solver = Delassus(ca.SX(A), ca.SX(M_inverse @ A.T))
    force = numbers(solver.forces(ca.SX(free), ca.SX(D), ca.SX(rows))).reshape(8, 3)
    assert_close(np.hypot(force[:, 1], force[:, 2]), 0.1 * abs(force[:, 0]), ALGEBRA)
    rate = A @ M_inverse @ A.T @ force.ravel() + free
    assert_close(rate[::3], np.zeros(8), INVERSE_PAIR)


@pytest.mark.parametrize("light", [1e-9, 1e-5])
def test_a_light_body_on_a_heavy_one_presses_with_its_weight(light: float) -> None:
    """Stacked on a table, 1 kg below: normal forces are the weights above the contacts."""
    A, M_inverse = np.zeros((6, 2)), np.diag([1.0, 1.0 / light])
    A[0, 0], A[3] = 1.0, (-1.0, 1.0)
    rows, free = np.array([1.0, 0.0, 0.0] * 2), A @ [-9.81, -9.81]
    solver = Delassus(ca.SX(A), ca.SX(M_inverse @ A.T))
    force = numbers(solver.forces(ca.SX(free), ca.SX(np.diag(rows)), ca.SX(rows)))
    assert_close(force[[0, 3]] / [1.0 + light, light], [9.81, 9.81], INVERSE_PAIR)


def numbers(expression: ca.SX) -> np.ndarray:
    return np.array(ca.DM(expression)).ravel()
