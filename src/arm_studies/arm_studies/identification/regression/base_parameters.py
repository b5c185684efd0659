# SPDX-License-Identifier: Apache-2.0
"""Base parameters: combinations of inertial parameters that joint torques can determine.

Columns of the regressor that are linear combinations of others in *every* state belong to
parameters that no motion can separate; they are grouped (Gautier, Khalil, "Direct calculation of
minimum set of inertial parameters of serial robots", IEEE Trans. Robotics and Automation 6(3),
1990).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from arm_dynamics.arrays import Array

STATES = 60  # Random states per joint: of the model, and so independent of the measurements.
# Relative distance of a column from the span of the others above which it is independent.
# Dependent ones are at 1e-13, or at 1e-9 if a URDF rounds right angles to nine digits; independent
# ones are above 1e-3.
DEPENDENT = 1e-5
ROUNDED = 1e-7  # Coefficients below it are rounding, for lengths of the order of meters.


@dataclass(frozen=True)
class BaseParameters:
    """Groups of parameters, each of which some motion determines.

    Attributes:
        independent: Indices of the parameters that lead a group, in order.
        grouping: Matrix B of shape (groups, numbers): the base parameters are β = B θ, and
            Y θ = Y[:, independent] β in every state.
        names: Of each group, such as ``elbow.Ixx - elbow.Iyy + 0.04 wrist.m``.
    """

    independent: tuple[int, ...]
    grouping: Array
    names: tuple[str, ...]

    def of(self, theta: Array) -> Array:
        """β of parameters of shape (numbers,)."""
        return self.grouping @ theta


def base_parameters(
    regressor: Callable[[Array, Array, Array], Array], n: int, names: list[str]
) -> BaseParameters:
    """Group the columns of a regressor.

    Args:
        regressor: Y(q, v, a) for rows of states of shape (k, n): shape (k, n, numbers).
        n: Number of joints.
        names: Of each parameter.
    """
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-3.0, 3.0, (3, STATES * n, n))
    columns = regressor(q, v, a).reshape(-1, len(names))
    triangle = np.linalg.qr(columns, mode="r")
    lengths = np.linalg.norm(triangle, axis=0)
    # From the last parameter to the first: distal bodies lead the groups.
    basis, leading = np.zeros((len(names), 0)), list[int]()
    for k in reversed(range(len(names))):
        if lengths[k] < 1e-12 * lengths.max():
            continue
        column = triangle[:, k] / lengths[k]
        for _ in range(2):  # twice is enough (Kahan, Parlett)
            column = column - basis @ (basis.T @ column)
        distance = np.linalg.norm(column)
        if distance > DEPENDENT:
            leading.append(k)
            basis = np.column_stack([basis, column / distance])
    independent = sorted(leading)
    grouping = np.linalg.lstsq(triangle[:, independent], triangle, rcond=None)[0]
    grouping[abs(grouping) < ROUNDED] = 0.0
    grouping[:, independent] = np.eye(len(independent))
    groups = [_name(*pair, names) for pair in zip(grouping, independent, strict=True)]
    return BaseParameters(tuple(independent), grouping, tuple(groups))


def _name(row: Array, lead: int, names: list[str]) -> str:
    parts = [names[lead]]
    for k in np.flatnonzero(row):
        if k != lead:
            size = abs(float(row[k]))
            factor = "" if abs(size - 1.0) < ROUNDED else f"{size:.4g} "
            parts.append(f"{'+' if row[k] > 0.0 else '-'} {factor}{names[k]}")
    return " ".join(parts)
