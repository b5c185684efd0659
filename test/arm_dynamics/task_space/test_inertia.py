# SPDX-License-Identifier: Apache-2.0
"""The inertia of a task near a singularity: how much damping, and where it begins."""

import numpy as np
import pytest

from arm_dynamics.task_space.inertia import task_inertia
from tolerances import ALGEBRA, assert_close

THRESHOLD = 0.1


def mobility(least: float) -> np.ndarray:
    """Of two linear axes whose scaled mobility is ``least`` and two less that, with units."""
    turned = np.array([[0.8, -0.6], [0.6, 0.8]])
    return np.asarray(9.0 * turned @ np.diag([least, 2.0 - least]) @ turned.T)


@pytest.mark.parametrize("least", [0.0, 0.01, 0.05, 0.0999, 0.1, 0.3])
def test_damping_grows_with_the_square_of_what_is_lacking(least: float) -> None:
    """Λ = (A + δ S²)⁻¹ with δ = ε (1 - σ/ε)² below the threshold, A⁻¹ above."""
    A = mobility(least)
    found = task_inertia(A, 2, THRESHOLD)
    damping = THRESHOLD * max(1.0 - least / THRESHOLD, 0.0) ** 2
    assert_close(found.matrix, np.linalg.inv(A + 9.0 * damping * np.eye(2)), ALGEBRA)
    assert_close(found.least, least, ALGEBRA)
    if abs(least - THRESHOLD) > 1e-6:
        assert found.damped == (least < THRESHOLD)
