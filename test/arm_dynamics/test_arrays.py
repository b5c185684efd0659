# SPDX-License-Identifier: Apache-2.0
"""Read-only arrays, and checks of arguments."""

import math

import numpy as np
import pytest

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import (
    all_finite,
    any_beyond,
    each,
    finite_numbers,
    numbers,
    positive,
    positive_limits,
    read_only,
    real_array,
    real_number,
    unit_vector,
    vector,
    vectors,
)

BAD = (np.nan, np.inf, -np.inf)


def test_read_only_arrays_are_immutable_copies_of_float() -> None:
    given = np.array([1, 2, 3])
    kept = read_only(given)
    given[0] = 7
    assert kept.dtype == float
    assert kept.tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 0.0


def test_each_hands_over_row_by_row() -> None:
    """A single vector is the whole second argument of every row, on either side of the batch."""
    given = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]), np.array([10.0, 20.0])
    rows = each(lambda a, b: np.array([a.sum(), b.sum()]), *given)
    assert rows.tolist() == [[3.0, 30.0], [7.0, 30.0], [11.0, 30.0]]
    assert each(lambda a: a.sum(), given[0]).tolist() == [3.0, 7.0, 11.0]


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("size", [1, 3, 64, 65, 200])
def test_one_number_that_is_not_finite_is_found_wherever_it_stands(bad: float, size: int) -> None:
    for place in {0, size // 2, size - 1}:
        numbers = np.ones(size)
        assert all_finite(numbers)
        numbers[place] = bad
        assert not all_finite(numbers)
        assert not finite_numbers(numbers.tolist())
        with pytest.raises(InvalidInput, match=rf"^q\[{place}\] = {bad}; allowed: finite numbers"):
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


@pytest.mark.parametrize(
    "value",
    ["1", None, True, 1j, [1, "2"], [[1.0], [1.0, 2.0]], [object()], [1.0, True], [(0, False)]],
)
def test_what_is_no_real_number_is_refused_with_what_was_given(value: object) -> None:
    with pytest.raises(InvalidInput) as caught:
        real_array("q", value)
    assert str(caught.value) == f"q = {value!r}: real numbers are expected"


@pytest.mark.parametrize("bad", BAD)
def test_one_number_that_is_not_finite_is_too_many(bad: float) -> None:
    for value in (bad, [1.0, bad], [[bad, 1.0], [1.0, 1.0]]):
        with pytest.raises(InvalidInput, match=rf"^gain is [^;]*{bad}[^;]*; allowed: finite"):
            numbers("gain", value)


@pytest.mark.parametrize("value", [0.0, -0.0, -5e-324, -1.0, *BAD])
def test_a_number_that_is_not_positive_and_finite_is_refused(value: float) -> None:
    with pytest.raises(InvalidInput, match=f"^dt is {value}; a positive number is expected$"):
        positive("dt", value)


@pytest.mark.parametrize("limit", [0.5, [0.5, np.inf], np.inf, [1e-300, 2.0]])
def test_limits_are_positive_and_one_for_each_joint(limit: object) -> None:
    found = positive_limits("limit", limit, 2)
    assert found.tolist() == np.broadcast_to(limit, 2).tolist()
    found[0] = 7.0  # its own, not the caller's and not one number seen twice
    assert found[1] != 7.0


@pytest.mark.parametrize(
    "limit", [0.0, -1.0, np.nan, [1.0, 0.0], [1.0, -1.0], [np.nan, 1.0], [1.0], [[1.0, 1.0]], []]
)
def test_limits_that_are_not_positive_or_not_one_for_each_joint_are_refused(limit: object) -> None:
    with pytest.raises(InvalidInput) as caught:
        positive_limits("limit", limit, 2)
    assert str(caught.value) == f"limit is {limit!r}; allowed: positive numbers, one or (2,)"


@pytest.mark.parametrize("length", [1e-12, 1e-9, 0.5, 1.0, 1e9, 1e200, 1.7e308])
def test_a_direction_of_any_length_but_zero_gets_length_one(length: float) -> None:
    found = unit_vector("direction", [0.6 * length, -0.8 * length], 2)
    np.testing.assert_allclose(found, [0.6, -0.8], rtol=1e-15)


@pytest.mark.parametrize("value", [[0.0, 0.0], [0.999e-12, 0.0], [[0.6, 0.8]]])
def test_no_direction_is_refused(value: object) -> None:
    with pytest.raises(InvalidInput, match=r"^u = \[.*; a nonzero vector of shape \(2,\) is"):
        unit_vector("u", value, 2)


@pytest.mark.parametrize("k", [1, 2, 3])
def test_beside_a_batch_all_are_of_its_length(k: int) -> None:
    batch = np.arange(2.0 * k).reshape(k, 2)
    for names in (("q", "v", "a"), ("v", "q", "a")):
        given = {name: batch if name == "q" else [8.0, 9.0] for name in names}
        for name, found in zip(names, vectors(2, **given), strict=True):
            assert found.tolist() == (batch.tolist() if name == "q" else [[8.0, 9.0]] * k)
    q, v = vectors(2, q=batch, v=2 * batch)
    assert (q.tolist(), v.tolist()) == (batch.tolist(), (2 * batch).tolist())


@pytest.mark.parametrize("value", ["1", b"1", None, [1.0, 2.0], 1j, 10**400])
def test_what_is_not_one_real_number_is_refused_as_written(value: object) -> None:
    assert math.isnan(real_number(value))
    with pytest.raises(InvalidInput, match=r"^dt is .*; a positive number is expected$") as caught:
        positive("dt", value)  # type: ignore[arg-type]
    assert repr(value) in str(caught.value)
