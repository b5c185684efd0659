# SPDX-License-Identifier: Apache-2.0
"""Answers of ``~/task_space``: matrices between joints, in the request's order, and task axes."""

from __future__ import annotations

from typing import Any

import numpy as np

from arm_dynamics.ros.convert import Array, Batch, finite_answer, to_array
from arm_dynamics.task_algebra import quaternions
from arm_dynamics.task_terms import EffectiveMass, TaskTerms


def fill_task_space(
    response: Any,
    batch: Batch,
    axes: tuple[str, ...],
    terms: TaskTerms,
    felt: EffectiveMass | None,
) -> None:
    """Write what a task space says about a batch into a response.

    Args:
        response: A ``TaskSpace`` response; left as it was on an error.
        batch: What was asked about.
        axes: Axes of the task.
        terms: Everything but the effective mass.
        felt: Mass along a direction, or None when nobody asked.

    Raises:
        InvalidInput: If numbers went out of range.
    """
    made = _in_order(batch, terms)
    if felt is not None:
        made["effective_mass"] = felt.mass
    written = {name: to_array(finite_answer(values)) for name, values in made.items()}
    for name, values in written.items():
        setattr(response, name, values)
    if felt is not None:
        response.effective_mass_bounded = felt.damped.tolist()
    response.condition = to_array(terms.condition)  # infinite at a singularity
    response.damped = terms.damped.tolist()
    response.axes = list(axes)
    response.joint_names = batch.joint_names


def _in_order(batch: Batch, terms: TaskTerms) -> dict[str, Array]:
    return {
        "pose": np.hstack([terms.position, quaternions(terms.rotation)]),
        "jacobian": batch.by_joint(terms.jacobian, -1),
        "twist": terms.velocity,
        "bias": terms.bias,
        "inertia": terms.inertia,
        "coriolis": terms.coriolis,
        "gravity": terms.gravity,
        "inverse": batch.by_joint(terms.inverse, -2),
        "null_space": batch.by_joint(batch.by_joint(terms.null_space, -1), -2),
        "manipulability": terms.manipulability,
    }
