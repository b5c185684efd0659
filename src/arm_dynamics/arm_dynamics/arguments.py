# SPDX-License-Identifier: Apache-2.0
"""Checks of the vectors that a caller hands over."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.model import Array


def vector(name: str, value: ArrayLike, n: int) -> Array:
    """Check an argument: finite numbers of shape (n,) or (k, n).

    Args:
        name: How the caller calls it.
        value: What was given.
        n: Degrees of freedom.

    Returns:
        The value as an array of float.

    Raises:
        InvalidInput: If it is anything else.
    """
    array = real_array(name, value)
    if array.ndim not in (1, 2) or array.shape[-1] != n or array.size == 0:
        raise InvalidInput(f"{name} has shape {array.shape}; ({n},) or (k, {n}) is wanted")
    if not np.isfinite(array).all():
        bad = np.argwhere(~np.isfinite(array))[0]
        raise InvalidInput(
            f"{name}{bad.tolist()} = {array[tuple(bad)]}; only finite numbers are allowed"
        )
    return array


def real_array(name: str, value: ArrayLike) -> Array:
    """The value as an array of float.

    Args:
        name: How the caller calls it.
        value: What was given.

    Raises:
        InvalidInput: If it does not consist of real numbers.
    """
    try:
        array = np.asarray(value)
    except ValueError:
        array = np.asarray(None)
    if array.dtype.kind not in "fiu":
        raise InvalidInput(f"{name} = {value!r}: real numbers are wanted")
    return np.asarray(array, dtype=float)
