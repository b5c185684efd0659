# SPDX-License-Identifier: Apache-2.0
"""Conversion of arguments to fields of a request, and of response fields to arrays."""

from array import array
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, real_array
from arm_dynamics.exceptions import InvalidInput


def motion(joint_names: Sequence[str], **vectors: ArrayLike | None) -> dict[str, Any]:
    """Fields of a request: the joint order, and flat vectors; None is omitted."""
    flat_vectors = {name: flat(name, x) for name, x in vectors.items() if x is not None}
    return {"joint_names": words("joint_names", joint_names), **flat_vectors}


def flat(name: str, value: ArrayLike) -> array[float]:
    """Real numbers as a flat field; ``InvalidInput`` if they are anything else."""
    return array("d", real_array(name, value).tobytes())


def whole(name: str, value: int, most: int) -> int:
    """A whole number in the range of the message's field."""
    if not isinstance(value, int | np.integer) or not 0 <= value <= most:
        raise InvalidInput(f"{name} = {value!r}; expected a whole number from 0 to {most}")
    return int(value)


def words(name: str, value: str | Sequence[str]) -> list[str]:
    """One or several names for a field; ``InvalidInput`` if they are anything else."""
    listed = [value] if isinstance(value, str) or not isinstance(value, Iterable) else list(value)
    if not all(isinstance(word, str) for word in listed):
        raise InvalidInput(f"{name} = {value!r}; expected names")
    return listed


def rows(name: str, value: ArrayLike, size: int) -> tuple[int, ...]:
    """Shape of an argument of ``size`` numbers, or of ``size`` for each of k: (), or (k,)."""
    shape = np.shape(value)
    if len(shape) not in (1, 2) or shape[-1] != size:
        raise InvalidInput(f"{name} has shape {shape}; expected ({size},) or (k, {size})")
    return shape[:-1]


def fixed(name: str, value: ArrayLike, size: int) -> Array:
    """Numbers for a field of ``size``; ``InvalidInput`` if they are more or fewer."""
    numbers = np.array(flat(name, value))
    if numbers.shape != (size,):
        raise InvalidInput(f"{name} has {numbers.size} numbers; expected {size}")
    return numbers


def shaped(values: Any, shape: tuple[int, ...]) -> Array:
    """A flat field as an array."""
    return np.array(values, float).reshape(shape)


def fields_of(
    response: Any, shapes: Mapping[str, Sequence[str | int]], batch: tuple[int, ...], **sizes: int
) -> dict[str, Array]:
    """The fields of a response that are not empty, of shapes in numbers and names of sizes."""
    arrays = {}
    for name, shape in shapes.items():
        if len(values := getattr(response, name)):
            numbers = (sizes[x] if isinstance(x, str) else x for x in shape)
            arrays[name] = np.array(values).reshape((*batch, *numbers))
    return arrays
