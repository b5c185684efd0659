# SPDX-License-Identifier: Apache-2.0
"""Arrays of numbers, and checks of arguments that are vectors."""

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from itertools import repeat
from operator import gt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm_dynamics.exceptions import InvalidInput, known_names

# Numbers of any shape
Array = NDArray[np.float64]

_LIST_SIZE = 64  # largest size for which a list is faster than an array
_SHORTEST = 1e-12  # length below which a vector has no direction


def read_only(values: ArrayLike) -> Array:
    """A copy of the values as an array of float that cannot be written to."""
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array


def each(function: Callable[..., Array], *arguments: Array) -> Array:
    """The result for vectors (n,), or those for each row of batches (k, n), as the first is.

    A single vector among batches is used for every row.
    """
    if arguments[0].ndim == 1:
        return function(*arguments)
    columns = [x if x.ndim == 2 else repeat(x) for x in arguments]
    return np.array([function(*row) for row in zip(*columns, strict=False)])


# Joint names, or the number of joints
Joints = int | Sequence[str]


def count(joints: Joints) -> int:
    """Number of joints."""
    return joints if isinstance(joints, int) else len(joints)


def without_number(joints: Joints, values: Array) -> str:
    """The joints to which no number belongs, as the end of a message, if there are too many."""
    if not values.ndim or values.shape[-1] <= count(joints):
        return ""
    locked, rules = getattr(joints, "locked", ()), getattr(joints, "rules", ())
    names = {"locked": locked, "mimic": [name for name in rules if name not in locked]}
    return "".join(f"; {kind}: {known_names(of, 8)}" for kind, of in names.items() if of)


def vector(name: str, value: ArrayLike, joints: Joints) -> Array:
    """Check an argument of a name: finite numbers of shape (n,)."""
    return _finite_vectors(name, value, joints, batch=False)


def vector_or_batch(name: str, value: ArrayLike, joints: Joints) -> Array:
    """Check an argument of a name: finite numbers of shape (n,) or (k, n)."""
    return _finite_vectors(name, value, joints, batch=True)


def _finite_vectors(name: str, value: ArrayLike, joints: Joints, *, batch: bool) -> Array:
    array = real_array(name, value)
    n = count(joints)
    if array.ndim not in (1, 2 if batch else 1) or array.shape[-1] != n or array.size == 0:
        least = " with k ≥ 1" if array.size == 0 else ""
        raise InvalidInput(
            f"{name} has shape {array.shape}; ({n},){f' or (k, {n}){least}' * batch} is expected"
            + without_number(joints, array)
        )
    if not all_finite(array):
        bad = np.argwhere(~np.isfinite(array))[0]
        owner = "" if isinstance(joints, int) else f" of joint '{joints[bad[-1]]}'"
        raise InvalidInput(
            f"{name}{bad.tolist()} = {array[tuple(bad)]}{owner}; allowed: finite numbers"
        )
    return array


def all_finite(array: Array) -> bool:
    """Whether all numbers are finite; three times as fast as NumPy for small arrays."""
    is_long = array.size > _LIST_SIZE
    return bool(np.isfinite(array).all()) if is_long else are_finite(array.ravel().tolist())


def are_finite(numbers: Collection[float]) -> bool:
    """Whether all numbers of a short list are finite."""
    # A sum that overflows is checked number by number.
    return math.isfinite(sum(numbers)) or all(map(math.isfinite, numbers))


def finite_answer(answer: Array) -> Array:
    """Return a result of finite numbers, or refuse them if it overflowed."""
    if not all_finite(answer):
        raise InvalidInput("the answer is not finite: the numbers given are too large")
    return answer


def any_beyond(numbers: Iterable[float], limits: Iterable[float]) -> bool:
    """Whether the magnitude of any number of a short list exceeds its limit."""
    return any(map(gt, map(abs, numbers), limits))


def real_array(name: str, value: ArrayLike) -> Array:
    """The value as a float array of real numbers."""
    if type(value) is np.ndarray and value.dtype == float:
        return value
    try:
        array = np.asarray(value)
    except ValueError:
        array = np.asarray(None)
    if array.dtype.kind not in "fiu" or _contains_boolean(value):
        raise InvalidInput(f"{name} = {value!r}: real numbers are expected")
    return np.asarray(array, dtype=float)


def _contains_boolean(value: object) -> bool:
    """Whether a Boolean is among numbers, which NumPy would convert to 0 or 1."""
    if isinstance(value, list | tuple):
        return any(map(_contains_boolean, value))
    return isinstance(value, bool | np.bool_)


def unit_vector(name: str, value: ArrayLike, n: int) -> Array:
    """A nonzero vector, normalized to unit length, shape (n,)."""
    u = vector(name, value, n)
    if math.hypot(*u) < _SHORTEST:
        raise InvalidInput(f"{name} = {u}; a nonzero vector is expected")
    return unit(u)


def unit(u: ArrayLike) -> Array:
    """A nonzero vector, normalized to unit length even if its squares overflow."""
    scaled: Array = np.ldexp(u, -np.frexp(np.abs(u).max())[1])  # exact, unlike a division
    return scaled / np.linalg.norm(scaled)


def numbers(name: str, value: ArrayLike) -> Array:
    """The value as an array of finite numbers of any shape."""
    array = real_array(name, value)
    if not np.isfinite(array).all():
        raise InvalidInput(f"{name} is {array}; allowed: finite numbers")
    return array


def real_number(value: object) -> float:
    """The value as a float; NaN if it is not one real number, as text and truth values are not."""
    if isinstance(value, bool | np.bool_ | str | bytes):
        return math.nan
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return math.nan


def positive(name: str, value: float) -> float:
    """Check a positive finite number."""
    number = real_number(value)
    if not 0.0 < number < np.inf:
        raise InvalidInput(f"{name} is {value!r}; a positive number is expected")
    return number


def positive_limits(name: str, limit: ArrayLike, n: int) -> Array:
    """Limits of n joints, positive, inf for none, from one number or shape (n,)."""
    array = real_array(name, limit)
    if array.shape not in ((), (n,)) or not np.all(array > 0.0):
        raise InvalidInput(f"{name} is {limit!r}; allowed: positive numbers, one or ({n},)")
    return np.array(np.broadcast_to(array, (n,)))


def vectors(joints: Joints, **values: ArrayLike) -> list[Array]:
    """Check related arguments: each of shape (n,), or a batch of a common length.

    Args:
        joints: Names or number of the joints.
        values: By the names of the arguments.

    Returns:
        The values; if one is a batch, all have its shape (k, n).

    Raises:
        InvalidInput: If one is anything else, or batches differ in length.
    """
    arrays = [vector_or_batch(name, value, joints) for name, value in values.items()]
    counts = {array.shape[0] for array in arrays if array.ndim == 2}
    if len(counts) > 1:
        raise InvalidInput(f"batches must have the same length, got {sorted(counts)}")
    if not counts:
        return arrays
    return [x if x.ndim == 2 else np.broadcast_to(x, (*counts, x.size)) for x in arrays]
