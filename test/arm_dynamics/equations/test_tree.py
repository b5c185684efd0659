# SPDX-License-Identifier: Apache-2.0
"""Coefficients of a tree: rounding errors of zeros and ones make no operations."""

import numpy as np

from arm_dynamics.equations.tree import clean, sparse


def test_zeros_and_ones_are_exact_and_everything_else_stays() -> None:
    rounding = 1e-16
    values = np.array([rounding, -rounding, 1 + 2 * rounding, 1 - rounding, rounding - 1, 0.5, -3])
    np.testing.assert_array_equal(clean(values), [0, 0, 1, 1, -1, 0.5, -3])
    near = np.array([1e-6, 1 + 1e-6, -1 - 1e-6])
    np.testing.assert_array_equal(clean(near), near)


def test_small_quantities_keep_small_entries() -> None:
    np.testing.assert_array_equal(clean(np.array([1e-17]), size=1e-6), [1e-17])
    np.testing.assert_array_equal(clean(np.array([1e-16]), size=1.0), [0.0])
    np.testing.assert_array_equal(clean(np.array([1e-9]), size=1e9), [1e-9])  # not a rounding


def test_zeros_take_no_place_in_an_expression() -> None:
    assert sparse(np.diag([2.0, 1e-17, -1.0])).nnz() == 2
