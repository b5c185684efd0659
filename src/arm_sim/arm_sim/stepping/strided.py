# SPDX-License-Identifier: Apache-2.0
"""Arrays whose entries are shared along some axes, by strides of zero."""

from __future__ import annotations

import numpy as np

from arm_dynamics.arrays import Array


def repeated(array: Array, shape: tuple[int, ...]) -> Array:
    """The array in another shape, repeated by strides of zero."""
    return array if array.shape == shape else np.broadcast_to(array, shape)


def strides(array: Array, axes: int) -> list[int]:
    """Numbers from one entry to the next along the first axes."""
    return [stride // 8 for stride in array.strides[:axes]]
