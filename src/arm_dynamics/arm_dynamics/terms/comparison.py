# SPDX-License-Identifier: Apache-2.0
"""Comparison of results of code with those of formulas on Pinocchio.

Each function returns the error and the size of the summands, which does not vanish where the sum
happens to.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from arm_dynamics.terms.formulas import inverse

if TYPE_CHECKING:
    from arm_dynamics.terms.arm import Arm


def torque_size(M: Any, a: Any, *torques: Any) -> Any:
    """Size of the summands of the torques of a motion, shape (…, n).

    Accelerations are compared by the torques that they require: unlike a difference of
    accelerations, one of torques does not grow with M⁻¹.
    """
    inertial = (abs(M) @ abs(a)[..., None])[..., 0]
    return inertial + sum(map(abs, torques))


def relative(arm: Arm, result: Any, formula: Any, *arguments: Any) -> Any:
    """By the size of the result itself."""
    expected = formula(arm, *arguments)
    return result - expected, expected


def by_torques(
    arm: Arm, tau: Any, formula: Any, q: Any, v: Any, a: Any, chosen: Any, external: Any
) -> Any:
    """Error of the torques of a motion, and the size of their summands."""
    return tau - formula(arm, q, v, a, chosen, external), _summands(arm, q, v, a, external)


def of_accelerations(arm: Arm, a: Any, _: Any, q: Any, v: Any, tau: Any, external: Any) -> Any:
    """Error of accelerations, in the torques that these require."""
    error = inverse(arm, q, v, a, external=external) - tau
    return error, _summands(arm, q, v, a, tau, external)


def _summands(arm: Arm, q: Any, v: Any, a: Any, *torques: Any) -> Any:
    return torque_size(arm.rigid.mass(q), a, inverse(arm, q, v, 0.0 * a), *torques)


def scaled_by_inertia(arm: Arm, tau: Any, formula: Any, q: Any, *rest: Any) -> Any:
    """Error of torques at zero acceleration, by those that an acceleration of one takes, too."""
    expected = formula(arm, q, *rest)
    return tau - expected, abs(expected) + abs(arm.rigid.mass(q)).sum(axis=1)


def scaled_by_speed(arm: Arm, C: Any, formula: Any, q: Any, v: Any) -> Any:
    """Error of the Coriolis matrix, by the inertia times the largest speed."""
    return C - formula(arm, q, v), arm.rigid.mass(q) * abs(v).max()


def of_energies(arm: Arm, energies: Any, formula: Any, q: Any, v: Any) -> Any:
    """Errors of kinetic and potential energy, the latter by the size of both."""
    kinetic, potential = abs(formula(arm, q, v))
    return energies - formula(arm, q, v), np.array([kinetic, kinetic + potential])


def of_jacobian_derivative(arm: Arm, J_dot: Any, formula: Any, q: Any, v: Any, frame: str) -> Any:
    """Error of J̇, by J times the largest speed."""
    return J_dot - formula(arm, q, v, frame), abs(v).max() * arm.rigid.jacobian(q, frame)


def of_constraint_rows(arm: Arm, rows: Any, formula: Any, q: Any, v: Any, names: Any) -> Any:
    """Error of rows A and γ = Ȧ v side by side, γ by A times the square of the largest speed."""
    expected = formula(arm, q, v, names)
    size = abs(expected)
    size[:, -1] += size[:, :-1].max(axis=1, initial=0.0) * abs(v).max() ** 2
    return rows - expected, size
