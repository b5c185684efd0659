# SPDX-License-Identifier: Apache-2.0
"""Cost of a trajectory: a protocol, and weighted squares of states and commands."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array, read_only, real_array
from arm_dynamics.attributes import frozen


@frozen
class Expansion:
    """Second-order expansion of a cost about a trajectory, without mixed derivatives.

    Attributes:
        x: Gradient by the state of each node, shape (nodes + 1, nx).
        xx: Its Hessian, or preferably the Gauss-Newton approximation, (nodes + 1, nx, nx).
        u: Gradient by the command of each node, shape (nodes, n).
        uu: Its Hessian, positive definite, shape (nodes, n, n).
    """

    x: Array
    xx: Array
    u: Array
    uu: Array


class Cost(Protocol):
    """Cost to be minimized, a sum over the nodes of a trajectory; may be user-defined."""

    def value(self, x: Array, u: Array) -> Array:
        """Cost of trajectories.

        Args:
            x: States, shape (b, nodes + 1, nx); NaN for a diverging trajectory.
            u: Commands, shape (b, nodes, n).

        Returns:
            One number for each, shape (b,).
        """

    def expansion(self, x: Array, u: Array) -> Expansion:
        """The cost about a trajectory, x of shape (nodes + 1, nx), u of shape (nodes, n)."""


@frozen
class QuadraticCost:
    """½ Σ w (x - x_d)² + ½ Σ r (u - u_d)², summed over nodes and entries.

    Attributes:
        x: Desired states x_d, shape (nodes + 1, nx).
        x_weight: Weights w, not negative, of the same shape.
        u: Desired commands u_d, shape (nodes, n).
        u_weight: Weights r, above zero, of the same shape.

    Raises:
        InvalidInput: If shapes do not match, or a weight is not allowed.
    """

    x: Array
    x_weight: Array
    u: Array
    u_weight: Array

    def __post_init__(self) -> None:
        """Validate shapes and weights."""
        for name in ("x", "x_weight", "u", "u_weight"):
            object.__setattr__(self, name, read_only(real_array(name, getattr(self, name))))
        shapes, weights = (self.x.shape, self.u.shape), (self.x_weight.shape, self.u_weight.shape)
        if weights != shapes or [len(s) for s in shapes] != [2, 2]:
            raise InvalidInput(f"x, u have shapes {shapes}, their weights {weights}; equal ones "
                               "of (nodes + 1, nx) and (nodes, n) are expected")  # fmt: skip
        if shapes[0][0] != shapes[1][0] + 1:
            raise InvalidInput(
                f"x has {shapes[0][0]} rows, u {shapes[1][0]}; one more is expected"
            )
        if not np.all(self.x_weight >= 0.0):
            least = np.min(self.x_weight)
            raise InvalidInput(f"x_weight contains {least:g}; allowed: zero and above")
        if not np.all(self.u_weight > 0.0):
            raise InvalidInput(f"u_weight contains {np.min(self.u_weight):g}; allowed: "
                               "numbers above zero")  # fmt: skip

    def value(self, x: Array, u: Array) -> Array:
        """See ``Cost``.

        Raises:
            InvalidInput: If the trajectories have other shapes than the cost.
        """
        shapes, expected = (self.x.shape, self.u.shape), (x.shape[1:], u.shape[1:])
        if shapes != expected:
            raise InvalidInput(f"the cost has x and u of shapes {shapes}; the trajectory needs "
                               f"{expected}")  # fmt: skip
        by_state = (self.x_weight * (x - self.x) ** 2).sum(axis=(1, 2))
        return np.asarray(0.5 * (by_state + (self.u_weight * (u - self.u) ** 2).sum(axis=(1, 2))))

    def expansion(self, x: Array, u: Array) -> Expansion:
        """See ``Cost``."""
        w, r = self.x_weight, self.u_weight
        return Expansion(w * (x - self.x), _diagonal(w), r * (u - self.u), _diagonal(r))


def _diagonal(rows: Array) -> Array:
    """Diagonal matrices, one for each row."""
    return np.asarray(rows[:, :, None] * np.eye(rows.shape[1]))
