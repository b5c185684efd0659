# SPDX-License-Identifier: Apache-2.0
"""Read-only arrays, and checks of arguments."""

from collections.abc import Callable

import numpy as np
import pytest

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import (
    all_finite,
    any_beyond,
    are_finite,
    numbers,
    positive,
    positive_limits,
    real_array,
    unit_vector,
    vector,
)

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize("bad", [NAN, INF, -INF])
@pytest.mark.parametrize("size", [1, 64, 65])
def test_one_number_that_is_not_finite_is_found_wherever_it_stands(bad: float, size: int) -> None:
    for place in {0, size // 2, size - 1}:
        numbers = np.ones(size)
        assert all_finite(numbers)
        numbers[place] = bad
        assert not all_finite(numbers)
        with pytest.raises(InvalidInput, match=rf"^q\[{place}\] = {bad}"):
            vector("q", numbers, size)


def test_large_numbers_are_finite_even_where_their_sum_is_not() -> None:
    assert are_finite([1e308, 1e308]) and not are_finite([INF, -INF])


def test_beyond_a_limit_counts_on_both_sides_and_not_at_it() -> None:
    assert not any_beyond([1.0, -2.0], [1.0, 2.0])
    assert any_beyond([1.0, -2.0001], [1.0, 2.0]) and any_beyond([1.0001, 0.0], [1.0, 2.0])


REFUSED: list[tuple[Callable[..., object], tuple[object, ...]]] = [
    *((real_array, (x,)) for x in ("1", None, True, 1j, [1, "2"], [[1.0], [1.0, 2.0]])),
    *((real_array, (x,)) for x in ([object()], [1.0, True], [(0, False)])),
    *((numbers, (x,)) for x in (NAN, [1.0, INF], [[-INF, 1.0], [1.0, 1.0]])),
    *((positive, (x,)) for x in (0.0, -0.0, -5e-324, -1.0, NAN, INF)),
    *((positive, (x,)) for x in ("1", b"1", None, True, [1.0, 2.0], 1j, 10**400)),
    *((positive_limits, (x, 2)) for x in (0.0, -1.0, NAN, [1.0, 0.0], [1.0, -1.0], [NAN, 1.0])),
    *((positive_limits, (x, 2)) for x in ([1.0], [[1.0, 1.0]], [])),
    *((unit_vector, (x, 2)) for x in ([0.0, 0.0], [0.999e-12, 0.0], [[0.6, 0.8]])),
]


@pytest.mark.parametrize(("check", "given"), REFUSED)
def test_what_is_no_such_number_is_refused_by_name(
    check: Callable[..., object], given: tuple[object, ...]
) -> None:
    with pytest.raises(InvalidInput, match="^given "):
        check("given", *given)


def test_limits_are_positive_and_one_for_each_joint() -> None:
    found = positive_limits("limit", 0.5, 2)
    assert found.tolist() == [0.5, 0.5]
    found[0] = 7.0  # its own, not the caller's and not one number seen twice
    assert found[1] == 0.5


@pytest.mark.parametrize("length", [1e-12, 0.5, 1.7e308])
def test_a_direction_of_any_length_but_zero_gets_length_one(length: float) -> None:
    found = unit_vector("direction", [0.6 * length, -0.8 * length], 2)
    np.testing.assert_allclose(found, [0.6, -0.8], rtol=1e-15)
