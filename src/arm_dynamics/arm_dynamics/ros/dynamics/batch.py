# SPDX-License-Identifier: Apache-2.0
"""Vectors of a request and its response: k points of n joints, in the request's order."""

from array import array
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, all_finite, finite_answer, without_number
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.ros.common.convert import to_array
from arm_dynamics.scene.urdf.joint_names import JointNames

_Order = NDArray[np.intp] | slice
_ALL = slice(None)  # the order of the model, which most requests use


class Batch:
    """Vectors of one request: k points of n joints in the request's order.

    Attributes:
        joint_names: Order of vectors in request and response.
        q: Positions, shape (k, n), in model order.
    """

    def __init__(
        self, names: Sequence[str], model_names: JointNames, position: Sequence[float], most: int
    ) -> None:
        """Read the positions of up to ``most`` points, in the order of ``names``, if any.

        Raises:
            InvalidInput: If joints are unknown, repeated or missing, or lengths do not match.
        """
        self.joint_names = list(names) or list(model_names)
        self._request_order: _Order = _ALL
        self._model_order: _Order = _ALL
        if self.joint_names != list(model_names):
            self._request_order = _order(self.joint_names, model_names)
            self._model_order = np.argsort(self._request_order)
        n, size = len(model_names), len(position)
        if size == 0 or size % n:
            text = f"position has {size} numbers; allowed: a multiple of {n}"
            raise InvalidInput(text + without_number(model_names, np.zeros(size)))
        if size > most * n:
            raise InvalidInput(
                f"position has {size // n} points; allowed: up to {most} in one call"
            )
        self.q = self._rows("position", position)

    def read(self, name: str, values: Sequence[float]) -> Array:
        """Another vector, as long as the positions or empty for zeros; (k, n), in model order.

        Raises:
            InvalidInput: If the length does not match or a number is not finite.
        """
        if len(values) == 0:
            return np.zeros_like(self.q)
        if len(values) != self.q.size:
            raise InvalidInput(f"{name} has {len(values)} numbers; allowed: 0 or {self.q.size}")
        return self._rows(name, values)

    def write(self, values: Array, shape: Sequence[str | int] = ("n",)) -> array[float]:
        """Write k values of a shape in n and numbers as the flat vector of a response."""
        if self._request_order is not _ALL:
            for axis, size in enumerate(shape, 1):
                values = np.take(values, self._request_order, axis) if size == "n" else values
        return to_array(finite_answer(values))

    def _rows(self, name: str, values: Sequence[float]) -> Array:
        rows = np.array(values, float).reshape(-1, len(self.joint_names))
        if not all_finite(rows):
            point, joint = np.argwhere(~np.isfinite(rows))[0]
            raise InvalidInput(
                f"{name} of joint '{self.joint_names[joint]}' at point {point} is "
                f"{rows[point, joint]}; allowed: finite numbers"
            )
        return rows[:, self._model_order]


def _order(names: Sequence[str], model_names: JointNames) -> NDArray[np.intp]:
    """Index into model order of each name, every joint once."""
    allowed = f"allowed: each of {known_names(model_names)} once"
    if len(names) > len(model_names) + len(model_names.rules):
        raise InvalidInput(f"{len(names)} joint names; {allowed}")
    for name in names:
        model_names.check([name])
    if len(set(names)) != len(names) or len(names) != len(model_names):
        raise InvalidInput(f"joint names are {known_names(names)}; {allowed}")
    return np.array([model_names.index(name) for name in names], np.intp)
