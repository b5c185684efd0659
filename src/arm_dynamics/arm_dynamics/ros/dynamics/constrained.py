# SPDX-License-Identifier: Apache-2.0
"""Answers ``~/constrained_dynamics``."""

from __future__ import annotations

from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.ros.common.convert import Batch, finite_answer, to_array


def answer_constrained_dynamics(
    request: Any, response: Any, dynamics: Dynamics, batch: Batch
) -> None:
    """Answer a ``ConstrainedDynamics`` request.

    Raises:
        InvalidInput: If it asks for something that is not allowed; nothing is written.
    """
    v = batch.read("velocity", request.velocity)
    if request.inverse:
        a = batch.read("acceleration", request.acceleration)
        lam = _multipliers(request.multipliers, dynamics, len(batch.q))
        tau = dynamics.constrained_inverse(batch.q, v, a, lam)
    else:
        tau = batch.read("effort", request.effort)
        a, lam = dynamics.constrained_forward(batch.q, v, tau)
    response.effort = batch.vectors(tau)
    response.acceleration = batch.vectors(a)
    response.multipliers = to_array(finite_answer(np.asarray(lam).ravel()))
    response.joint_names = batch.joint_names
    response.constraint_names = list(dynamics.constrained.names)


def _multipliers(values: Any, dynamics: Dynamics, points: int) -> Array:
    m = dynamics.constrained.m
    if len(values) not in (0, points * m):
        raise InvalidInput(
            f"multipliers has {len(values)} numbers; allowed is {points * m}: {m} for each of "
            f"{points} points, or none"
        )
    return np.array(values, float).reshape(points, m) if len(values) else np.zeros((points, m))
