# SPDX-License-Identifier: Apache-2.0
"""Answers of ``~/task_space`` and ``~/inverse_kinematics``, joints in the request's order."""

from __future__ import annotations

from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import InvalidInput, Unreachable
from arm_dynamics.ros.common.convert import Batch, finite_answer, to_array
from arm_dynamics.ros.common.params import one_or_all
from arm_dynamics.ros.dynamics.poses import pose_of
from arm_dynamics.ros.interfaces import MAX_POSES
from arm_dynamics.task_space.inertia import quaternions
from arm_dynamics.task_space.inverse_kinematics import InverseKinematics, Solution
from arm_dynamics.task_space.task_space import EffectiveMass, TaskSpace, TaskTerms


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


def answer_inverse_kinematics(request: Any, response: Any, dynamics: Dynamics) -> None:
    """Answer an ``InverseKinematics`` request.

    Raises:
        InvalidInput: If it asks for something that is not allowed; nothing is written.
        Unreachable: If a pose is not reached; what was found is written.
    """
    axes = one_or_all(request.axes) or "pose"
    solver = InverseKinematics(TaskSpace(dynamics, request.frame, selection=axes))
    count, rest = divmod(len(request.pose), 7)
    if rest or not 0 < count <= MAX_POSES:
        raise InvalidInput(
            f"pose has {len(request.pose)} numbers; allowed is 7 for each of up to {MAX_POSES} "
            "poses"
        )
    poses = [pose_of(seven) for seven in np.array(request.pose).reshape(-1, 7)]
    seeds, batch = _seeds(request, dynamics, count)
    found: list[Solution] = []
    for i, pose in enumerate(poses):
        found.append(solver.solve(pose, seeds[i] if i < len(seeds) else found[-1].q))
    response.position = batch.vectors(np.array([one.q for one in found]))
    response.reached = [one.reached for one in found]
    response.distance = to_array([one.distance for one in found])
    response.angle = to_array([one.angle for one in found])
    response.joint_names = batch.joint_names
    _check_reached(request.frame, found)


def _seeds(request: Any, dynamics: Dynamics, count: int) -> tuple[Array, Batch]:
    """Seeds of the first poses in model order, and the batch that knows the request's order."""
    n, size = dynamics.n, len(request.seed)
    if size not in (0, n, count * n):
        allowed = " or ".join(str(number) for number in dict.fromkeys((0, n, count * n)))
        raise InvalidInput(f"seed has {size} numbers; allowed is {allowed}")
    points = max(1, size // n)
    batch = Batch(request.joint_names, dynamics.joint_names, np.zeros(points * n), points)
    seeds = batch.read("seed", request.seed) if size else dynamics.model.q0[None]
    return seeds, batch


def _check_reached(frame: str, found: list[Solution]) -> None:
    missed = [i for i, one in enumerate(found) if not one.reached]
    if not missed:
        return
    one = found[missed[0]]
    limits = f"; at a limit: {', '.join(one.at_limit)}" if one.at_limit else ""
    raise Unreachable(
        f"{len(missed)} of {len(found)} poses of frame '{frame}' cannot be reached; pose "
        f"{missed[0]} misses {one.distance:.3g} m and {one.angle:.3g} rad{limits}",
        one.distance,
    )
