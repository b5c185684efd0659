# SPDX-License-Identifier: Apache-2.0
"""Services of the dynamics node: one function each, and their table.

A function reads the request, calls the core and writes the response, with joints in the order of
the request. It raises ``InvalidInput`` for an invalid request, before anything is written.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array, finite_answer
from arm_dynamics.dynamics.dynamics import Dynamics, call_entry
from arm_dynamics.exceptions import InvalidInput, Unreachable
from arm_dynamics.ros import interfaces
from arm_dynamics.ros.common.convert import to_array
from arm_dynamics.ros.common.poses import pose_of
from arm_dynamics.ros.dynamics.batch import Batch
from arm_dynamics.ros.interfaces import MAX_POINTS, MAX_POSES, MAX_TERMS_POINTS
from arm_dynamics.task_space.inertia import quaternions
from arm_dynamics.task_space.inverse_kinematics import InverseKinematics, Solution
from arm_dynamics.task_space.task_space import TaskSpace
from arm_dynamics.terms.table import OF_SERVICE, TASK_SPACE


def _states(dynamics: Dynamics, request: Any, most: int) -> tuple[Batch, Array]:
    """The positions of a request, as a batch, and its velocities, shape (k, n)."""
    batch = Batch(request.joint_names, dynamics.joint_names, request.position, most)
    return batch, batch.read("velocity", request.velocity)


def inverse_dynamics(dynamics: Dynamics, request: Any, response: Any) -> None:
    """Inverse dynamics: torques of motions."""
    batch, v = _states(dynamics, request, MAX_POINTS)
    a = batch.read("acceleration", request.acceleration)
    response.effort = batch.write(dynamics.inverse(batch.q, v, a, request.terms))
    response.joint_names = batch.joint_names


def forward_dynamics(dynamics: Dynamics, request: Any, response: Any) -> None:
    """Forward dynamics: accelerations under torques."""
    batch, v = _states(dynamics, request, MAX_POINTS)
    tau = batch.read("effort", request.effort)
    response.acceleration = batch.write(dynamics.forward(batch.q, v, tau))
    response.joint_names = batch.joint_names


def dynamics_terms(dynamics: Dynamics, request: Any, response: Any) -> None:
    """The terms of the equation of motion, and the energies."""
    batch, v = _states(dynamics, request, MAX_TERMS_POINTS)
    for entry in OF_SERVICE:
        term = call_entry(dynamics, entry, {"q": batch.q, "v": v})
        parts = zip(entry.parts.items(), term if entry.fields else [term], strict=True)
        for (name, shape), values in parts:
            setattr(response, name, batch.write(values, shape))
    response.joint_names = batch.joint_names


def constrained_dynamics(dynamics: Dynamics, request: Any, response: Any) -> None:
    """Forward or inverse dynamics under the scene's constraints."""
    batch, v = _states(dynamics, request, MAX_TERMS_POINTS)
    for computed in ("effort",) if request.inverse else ("acceleration", "multipliers"):
        if len(getattr(request, computed)):
            raise InvalidInput(
                f"{computed} is given, which is computed where inverse is "
                f"{str(request.inverse).lower()}; allowed: empty"
            )
    if request.inverse:
        a = batch.read("acceleration", request.acceleration)
        lam, points, m = request.multipliers, len(batch.q), dynamics.constrained.m
        if len(lam) not in (0, points * m):
            raise InvalidInput(
                f"multipliers has {len(lam)} numbers; allowed: {points * m}: {m} for each of "
                f"{points} points, or none"
            )
        lam = np.reshape(lam, (points, m)) if len(lam) else np.zeros((points, m))
        tau = dynamics.constrained_inverse(batch.q, v, a, lam)
    else:
        tau = batch.read("effort", request.effort)
        a, lam = dynamics.constrained_forward(batch.q, v, tau)
    response.effort = batch.write(tau)
    response.acceleration = batch.write(a)
    response.multipliers = to_array(finite_answer(np.asarray(lam).ravel()))
    response.joint_names = batch.joint_names
    response.constraint_names = list(dynamics.constrained.names)


def model_info(dynamics: Dynamics, request: Any, response: Any) -> None:
    """Properties of the arm."""
    model = dynamics.model
    response.joint_names = list(model.joint_names)
    response.joint_types = list(model.joint_types)
    response.position_lower = to_array(model.position_lower)
    response.position_upper = to_array(model.position_upper)
    response.velocity_limits = to_array(model.velocity_limit)
    response.effort_limits = to_array(model.effort_limit)
    response.frame_names = list(model.frame_names)
    response.total_mass = model.total_mass
    response.gravity = [float(g) for g in model.scene.gravity]
    response.summary = (
        f"{model.n} joints ({', '.join(sorted(set(model.joint_types)))}), "
        f"{len(model.frame_names)} frames, {model.total_mass:.3f} kg moving"
        + (f", commands in {', '.join(model.command_unit)}" if any(model.drives) else "")
    )


def task_space(dynamics: Dynamics, request: Any, response: Any) -> None:
    """The equation of motion at a frame, and the effective mass along a direction, if given."""
    batch, v = _states(dynamics, request, MAX_TERMS_POINTS)
    axes = " ".join(request.axes) or "pose"
    task = TaskSpace(dynamics, request.frame, request.reference, axes)
    effective = task.effective_mass(batch.q, request.direction) if len(request.direction) else None
    terms = task.terms(batch.q, v)
    pose = np.hstack([terms.position, quaternions(terms.rotation)])
    computed = {"pose": pose, "twist": terms.velocity}
    vectors = {  # all of them, before any is written
        name: batch.write(computed.get(name, getattr(terms, name, None)), shape)
        for name, shape in TASK_SPACE.items()
        if name not in ("condition", "damped")
    }
    if effective is not None:
        vectors["effective_mass"] = batch.write(effective.mass, ())
        response.effective_mass_bounded = effective.damped.tolist()
    for name, vector in vectors.items():
        setattr(response, name, vector)
    response.condition = to_array(terms.condition)  # infinite at a singularity
    response.damped = terms.damped.tolist()
    response.axes = list(task.axes)
    response.joint_names = batch.joint_names


def inverse_kinematics(dynamics: Dynamics, request: Any, response: Any) -> None:
    """Joint positions for poses of a frame.

    Raises:
        Unreachable: If a pose is not reached; the nearest result is written.
    """
    axes = " ".join(request.axes) or "pose"
    solver = InverseKinematics(TaskSpace(dynamics, request.frame, selection=axes))
    count, rest = divmod(len(request.pose), 7)
    if rest or not 0 < count <= MAX_POSES:
        raise InvalidInput(
            f"pose has {len(request.pose)} numbers; allowed: 7 for each of up to {MAX_POSES} poses"
        )
    poses = [pose_of(numbers) for numbers in np.array(request.pose).reshape(-1, 7)]
    n, size = dynamics.n, len(request.seed)
    if size not in (0, n, count * n):
        allowed = " or ".join(str(number) for number in dict.fromkeys((0, n, count * n)))
        raise InvalidInput(f"seed has {size} numbers; allowed: {allowed}")
    points = max(1, size // n)
    batch = Batch(request.joint_names, dynamics.joint_names, np.zeros(points * n), points)
    seeds = batch.read("seed", request.seed) if size else dynamics.model.q0[None]
    solutions: list[Solution] = []
    for i, pose in enumerate(poses):
        solutions.append(solver.solve(pose, seeds[i] if i < len(seeds) else solutions[-1].q))
    response.position = batch.write(np.array([solution.q for solution in solutions]))
    response.reached = [solution.reached for solution in solutions]
    response.distance = to_array([solution.distance for solution in solutions])
    response.angle = to_array([solution.angle for solution in solutions])
    response.joint_names = batch.joint_names
    if missed := [i for i, solution in enumerate(solutions) if not solution.reached]:
        first = solutions[missed[0]]
        limits = f"; at a limit: {', '.join(first.at_limit)}" if first.at_limit else ""
        raise Unreachable(
            f"{len(missed)} of {count} poses of frame '{request.frame}' cannot be reached; pose "
            f"{missed[0]} misses {first.distance:.3g} m and {first.angle:.3g} rad{limits}",
            first.distance,
        )


ANSWERS: dict[interfaces.Service, Callable[[Dynamics, Any, Any], None]] = {
    interfaces.INVERSE_DYNAMICS: inverse_dynamics,
    interfaces.FORWARD_DYNAMICS: forward_dynamics,
    interfaces.DYNAMICS_TERMS: dynamics_terms,
    interfaces.CONSTRAINED_DYNAMICS: constrained_dynamics,
    interfaces.MODEL_INFO: model_info,
    interfaces.TASK_SPACE: task_space,
    interfaces.INVERSE_KINEMATICS: inverse_kinematics,
}
