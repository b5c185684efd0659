# SPDX-License-Identifier: Apache-2.0
"""Arrays of numbers, and checks of the vectors that a caller hands over."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from itertools import repeat
from operator import gt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm_dynamics.exceptions import InvalidInput

Array = NDArray[np.float64]
"""Numbers of any shape."""

_FEW = 64  # numbers up to which a list is faster than an array


def read_only(values: ArrayLike) -> Array:
    """A copy of the values as an array of float that cannot be written to."""
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array


def each(answer: Callable[..., Array], *given: Array) -> Array:
    """The answer for vectors (n,), or those for each row of batches (k, n), by ``given[0]``.

    A single vector beside batches serves every row.
    """
    if given[0].ndim == 1:
        return answer(*given)
    columns = [x if x.ndim == 2 else repeat(x) for x in given]
    return np.array([answer(*row) for row in zip(*columns, strict=False)])


Joints = int | Sequence[str]
"""Joints by name, or how many there are."""


def count(joints: Joints) -> int:
    """How many joints there are."""
    return joints if isinstance(joints, int) else len(joints)


def vector(name: str, value: ArrayLike, joints: Joints) -> Array:
    """Check an argument: finite numbers of shape (n,) or (k, n).

    Args:
        name: How the caller calls it.
        value: What was given.
        joints: Whose numbers they are, or how many.

    Returns:
        The value as an array of float.

    Raises:
        InvalidInput: If it is anything else.
    """
    array = real_array(name, value)
    n = count(joints)
    if array.ndim not in (1, 2) or array.shape[-1] != n or array.size == 0:
        raise InvalidInput(f"{name} has shape {array.shape}; ({n},) or (k, {n}) is expected")
    if not all_finite(array):
        bad = np.argwhere(~np.isfinite(array))[0]
        whose = "" if isinstance(joints, int) else f" of joint '{joints[bad[-1]]}'"
        raise InvalidInput(
            f"{name}{bad.tolist()} = {array[tuple(bad)]}{whose}; only finite numbers are allowed"
        )
    return array


def all_finite(array: Array) -> bool:
    """Whether all numbers are finite; for a few of them in a third of NumPy's time."""
    many = array.size > _FEW
    return bool(np.isfinite(array).all()) if many else finite_numbers(array.ravel().tolist())


def finite_numbers(numbers: Collection[float]) -> bool:
    """Whether all of a few plain numbers are finite."""
    # A sum that overflows is looked at again.
    return math.isfinite(sum(numbers)) or all(map(math.isfinite, numbers))


def any_beyond(numbers: Iterable[float], limits: Iterable[float]) -> bool:
    """Whether any of a few numbers is larger than its limit, whatever its sign."""
    return any(map(gt, map(abs, numbers), limits))


def real_array(name: str, value: ArrayLike) -> Array:
    """The value as an array of float.

    Raises:
        InvalidInput: If it does not consist of real numbers.
    """
    try:
        array = np.asarray(value)
    except ValueError:
        array = np.asarray(None)
    if array.dtype.kind not in "fiu" or _holds_truth(value):
        raise InvalidInput(f"{name} = {value!r}: real numbers are expected")
    return np.asarray(array, dtype=float)


def _holds_truth(value: object) -> bool:
    """Whether a truth value is among numbers, where NumPy would take it for 0 or 1."""
    if isinstance(value, list | tuple):
        return any(map(_holds_truth, value))
    return isinstance(value, bool | np.bool_)


def unit_vector(name: str, value: ArrayLike, n: int) -> Array:
    """A direction of any length but zero, made of length one, shape (n,).

    Raises:
        InvalidInput: If it is anything else.
    """
    u = vector(name, value, n)
    length = float(np.linalg.norm(u))
    if u.ndim != 1 or length < 1e-12:
        raise InvalidInput(f"{name} = {u}; a vector of shape ({n},) but zero is expected")
    return u / length


def numbers(name: str, value: ArrayLike) -> Array:
    """The value as an array of finite numbers of any shape.

    Raises:
        InvalidInput: If it is anything else.
    """
    array = real_array(name, value)
    if not np.isfinite(array).all():
        raise InvalidInput(f"{name} is {array}; allowed: finite numbers")
    return array


def positive(name: str, value: float) -> float:
    """Check a positive finite number."""
    if isinstance(value, bool | np.bool_) or not 0.0 < value < np.inf:
        raise InvalidInput(f"{name} is {value}; a positive number is expected")
    return float(value)


def positive_limits(name: str, limit: ArrayLike, n: int) -> Array:
    """Limits of n joints, positive, inf for none, from one number or shape (n,).

    Raises:
        InvalidInput: If they are anything else.
    """
    array = real_array(name, limit)
    if array.shape not in ((), (n,)) or not np.all(array > 0.0):
        raise InvalidInput(f"{name} is {limit!r}; allowed: positive numbers, one or ({n},)")
    return np.array(np.broadcast_to(array, (n,)))


def vectors(joints: Joints, **given: ArrayLike) -> list[Array]:
    """Check arguments that belong together: each of shape (n,), or all batches of one length.

    Args:
        joints: Whose numbers they are, or how many.
        given: What was given, by the caller's names.

    Returns:
        The values; beside a batch all are of its shape (k, n).

    Raises:
        InvalidInput: If one is anything else, or batches differ in length.
    """
    arrays = [vector(name, value, joints) for name, value in given.items()]
    counts = {array.shape[0] for array in arrays if array.ndim == 2}
    if len(counts) > 1:
        raise InvalidInput(f"batches must be of one length, got {sorted(counts)}")
    if not counts:
        return arrays
    return [x if x.ndim == 2 else np.broadcast_to(x, (*counts, x.size)) for x in arrays]
