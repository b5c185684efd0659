# SPDX-License-Identifier: Apache-2.0
"""Arrays that cannot be changed, and checks of what a caller hands over."""

from __future__ import annotations

import numpy as np
import pytest

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import all_finite, any_beyond, each, finite_numbers, read_only, vector

BAD = (np.nan, np.inf, -np.inf)


def test_read_only_arrays_are_copies_of_float_that_nobody_can_change() -> None:
    given = np.array([1, 2, 3])
    kept = read_only(given)
    given[0] = 7
    assert kept.dtype == float
    assert kept.tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 0.0


def test_each_answers_a_vector_or_every_row() -> None:
    assert each(lambda a, b: a + b, np.array([1.0]), np.array([2.0])).tolist() == [3.0]
    rows = each(lambda a, b: a + b, np.array([[1.0], [2.0]]), np.array([10.0]))
    assert rows.tolist() == [[11.0], [12.0]]


@pytest.mark.parametrize("value", [[1, 2], [[1, 2], [3, 4]], np.float32([1, 2])])
def test_vectors_and_batches_become_float(value: object) -> None:
    found = vector("q", value, 2)
    assert found.dtype == np.float64
    assert found.tolist() == np.asarray(value).tolist()


@pytest.mark.parametrize("value", [[1.0], [1.0, 2.0, 3.0], 1.0, [[[1.0, 2.0]]], np.zeros((0, 2))])
def test_other_shapes_are_refused(value: object) -> None:
    with pytest.raises(InvalidInput, match=r"^q has shape .*; \(2,\) or \(k, 2\) is expected$"):
        vector("q", value, 2)


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("size", [1, 3, 64, 65, 200])
def test_one_number_that_is_not_finite_is_found_wherever_it_stands(bad: float, size: int) -> None:
    for place in {0, size // 2, size - 1}:
        numbers = np.ones(size)
        assert all_finite(numbers)
        numbers[place] = bad
        assert not all_finite(numbers)
        assert not finite_numbers(numbers.tolist())
        with pytest.raises(InvalidInput, match=rf"^q\[{place}\] = {bad}; only finite numbers"):
            vector("q", numbers, size)


def test_large_numbers_are_finite_even_where_their_sum_is_not() -> None:
    assert finite_numbers([1e308, 1e308])
    assert all_finite(np.array([1e308, 1e308]))
    assert not finite_numbers([np.inf, -np.inf])


def test_beyond_a_limit_counts_on_both_sides_and_not_at_it() -> None:
    limits = [1.0, 2.0]
    assert not any_beyond([1.0, -2.0], limits)
    assert any_beyond([1.0, -2.0001], limits)
    assert any_beyond([1.0001, 0.0], limits)
