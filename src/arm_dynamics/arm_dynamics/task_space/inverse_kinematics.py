# SPDX-License-Identifier: Apache-2.0
"""Joint positions for a pose: damped least squares within joint limits, from several seeds.

Levenberg-Marquardt with damping that follows the error (Sugihara, "Solvability-unconcerned inverse
kinematics by the Levenberg-Marquardt method", IEEE Trans. Robotics 27(5), 2011), and joints that
reach a limit are held there while the others continue.
"""

from itertools import compress
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, numbers, read_only, vector
from arm_dynamics.attributes import frozen, sealed
from arm_dynamics.exceptions import InvalidInput, Unreachable
from arm_dynamics.model.arm import postures
from arm_dynamics.task_space.task_space import Pose, TaskSpace

_ANGLE_WEIGHT = 0.3  # [m/rad]: weight of an angle relative to a distance
_LEAST_DAMPING = 1e-6  # damping that remains at zero error
_PATIENCE = 8  # steps without progress after which a descent ends
_PROGRESS = 0.95  # of the error before, up to which a step is progress
_LARGEST_STEP = 1.0  # largest step of a joint in [rad] or [m]
_CORRECTIONS = 4  # iterations to a nearby pose


@frozen
class Solution:
    """Result of a search.

    Attributes:
        q: Joint positions in [rad] or [m], within limits, shape (n,).
        reached: Whether the pose is reached.
        distance: Remaining position error in [m].
        angle: Remaining orientation error in [rad].
        seeds: Number of starting points that were tried.
        iterations: Total number of iterations.
        at_limit: Names of the joints that are at a limit.
    """

    q: Array
    reached: bool
    distance: float
    angle: float
    seeds: int
    iterations: int
    at_limit: tuple[str, ...]


class _Attempt(NamedTuple):
    """Where a descent from one seed ended."""

    q: Array
    distance: float
    angle: float
    steps: int


@sealed
class InverseKinematics:
    """Finds joint positions for poses of a task's frame, for the axes of the task.

    Args:
        task: The task, in axes ``local_world_aligned``; used from one thread only.
        distance: Largest error in [m].
        angle: Largest error in [rad].
        iterations: Steps from one seed.
        seeds: Largest number of starting points: the given one, the scene's, then deterministic
            random ones. Some poses of a Puma 560 are reached from one start in twenty only: with
            20, 12 of 1000 random poses were missed, with 100 none.

    Raises:
        InvalidInput: If the task has other axes or a number is not allowed.
    """

    def __init__(
        self,
        task: TaskSpace,
        distance: float = 1e-9,
        angle: float = 1e-9,
        iterations: int = 100,
        seeds: int = 100,
    ) -> None:
        task.require_world_axes()
        if not (distance > 0.0 and angle > 0.0 and iterations > 0 and seeds > 0):
            raise InvalidInput(
                f"distance, angle, iterations, seeds = {distance}, {angle}, {iterations}, {seeds};"
                " positive numbers are expected"
            )
        self.task = task
        self._distance, self._angle = distance, angle
        self._iterations, self._seeds = iterations, seeds
        self._lower, self._upper = task.model.position_lower, task.model.position_upper
        self._weight = np.where(np.arange(6) < 3, 1.0, _ANGLE_WEIGHT)[task.rows]

    def solve(self, pose: Pose | ArrayLike, seed: ArrayLike | None = None) -> Solution:
        """Search for joint positions; the result states whether the pose is reached.

        Args:
            pose: Desired pose of the frame in the world, or its matrix, shape (4, 4), as
                ``Dynamics.pose`` returns it.
            seed: Initial guess, shape (n,); None for the scene's initial position.

        Raises:
            InvalidInput: If the pose is invalid, or the seed has a wrong shape or value.
        """
        pose = checked_pose(pose)
        attempts = list[_Attempt]()
        model = self.task.model
        first = model.q0 if seed is None else vector("seed", seed, model.joint_names)
        starts = [first] if seed is None else [first, model.q0]
        starts = [*starts, *postures(model, self._seeds)][: self._seeds]
        for start in np.clip(starts, self._lower, self._upper):
            attempts.append(attempt := self._descend(pose, start))
            if self._is_reached(attempt):
                break
        best = min(attempts, key=lambda attempt: attempt.distance + _ANGLE_WEIGHT * attempt.angle)
        q = read_only(best.q)
        limited = compress(model.joint_names, (q <= self._lower) | (q >= self._upper))
        return Solution(
            q=q,
            reached=self._is_reached(best),
            distance=best.distance,
            angle=best.angle,
            seeds=len(attempts),
            iterations=sum(attempt.steps for attempt in attempts),
            at_limit=tuple(limited),
        )

    def reach(self, pose: Pose | ArrayLike, seed: ArrayLike | None = None) -> Array:
        """Joint positions for a pose in [rad] or [m], shape (n,); arguments as of ``solve``.

        Raises:
            Unreachable: If it is not reached from any seed; states the remaining errors.
            InvalidInput: If the pose or the seed is not allowed.
        """
        pose = checked_pose(pose)
        solution = self.solve(pose, seed)
        if solution.reached:
            return solution.q
        limits = f"; at a limit: {', '.join(solution.at_limit)}" if solution.at_limit else ""
        raise Unreachable(
            f"frame '{self.task.frame}' cannot be brought to position {pose.position}: "
            f"{solution.distance:.3g} m and {solution.angle:.3g} rad remain after "
            f"{solution.seeds} seeds{limits}",
            solution.distance + _ANGLE_WEIGHT * solution.angle,
        )

    def correct(self, pose: Pose, q: Array) -> Array:
        """A few iterations from q, shape (n,), to a nearby pose, without limits."""
        for _ in range(_CORRECTIONS):
            error, J = self._error(pose, q)
            if np.max(abs(error)) < 1e-13:
                break
            q = q + np.linalg.lstsq(J, error, rcond=1e-9)[0]
        return q

    def pose_error(self, pose: Pose, q: Array) -> tuple[float, float]:
        """Distance of the frame from a pose, in [m] and [rad], for joint positions (n,)."""
        return self._norms(self._error(pose, q)[0])

    def _descend(self, pose: Pose, q: Array) -> _Attempt:
        """Iterate until the pose is reached or the error no longer decreases."""
        error, J = self._error(pose, q)
        size, patience = np.linalg.norm(self._weight * error), 0
        for step in range(self._iterations):
            distance, angle = self._norms(error)
            if distance <= 0.5 * self._distance and angle <= 0.5 * self._angle:
                return _Attempt(q, distance, angle, step)
            new = np.clip(q + self._step(error, J, q), self._lower, self._upper)
            error_new, J_new = self._error(pose, new)
            size_new = np.linalg.norm(self._weight * error_new)
            patience = 0 if size_new < _PROGRESS * size else patience + 1
            if patience > _PATIENCE:
                break
            q, error, J, size = new, error_new, J_new, min(size, size_new)
        return _Attempt(q, *self._norms(error), step + 1)

    def _step(self, error: Array, J: Array, q: Array) -> Array:
        """Levenberg-Marquardt step.

        Joints at a limit that it would push beyond are held and the step is computed again, at
        most twice; ``_descend`` cuts off what is left beyond.
        """
        e, Jw = self._weight * error, self._weight[:, None] * J
        damping = 0.5 * (e @ e) + _LEAST_DAMPING**2
        free = np.ones(len(q), bool)
        for _ in range(3):
            part = Jw[:, free]
            H = part.T @ part + damping * np.eye(part.shape[1])
            dq = np.zeros(len(q))
            dq[free] = np.linalg.solve(H, part.T @ e)
            stops = free & (((q <= self._lower) & (dq < 0.0)) | ((q >= self._upper) & (dq > 0.0)))
            if not stops.any():
                break
            free &= ~stops
        largest = float(abs(dq).max())
        return dq if largest <= _LARGEST_STEP else dq * _LARGEST_STEP / largest

    def _error(self, pose: Pose, q: Array) -> tuple[Array, Array]:
        motion, rows = self.task.motion, self.task.rows
        position, rotation = motion.placement(q)
        turn = pin.log3(pose.rotation @ rotation.T)
        error = np.concatenate([pose.position - position, turn])
        return error[rows], motion.jacobian(q)[rows]

    def _norms(self, error: Array) -> tuple[float, float]:
        """Norms of an error's position and rotation."""
        linear = self.task.linear
        return float(np.linalg.norm(error[:linear])), float(np.linalg.norm(error[linear:]))

    def _is_reached(self, attempt: _Attempt) -> bool:
        return attempt.distance <= self._distance and attempt.angle <= self._angle


def checked_pose(pose: Pose | ArrayLike) -> Pose:
    """Check a pose from a caller, which may be a matrix of shape (4, 4)."""
    if not isinstance(pose, Pose):
        matrix = numbers("pose", pose)
        if matrix.shape != (4, 4):
            raise InvalidInput(f"pose has shape {matrix.shape}; a Pose or (4, 4) is expected")
        pose = Pose(matrix[:3, 3], matrix[:3, :3])
    position = vector("pose.position", pose.position, 3)
    rotation = numbers("pose.rotation", pose.rotation)
    if rotation.shape != (3, 3):
        raise InvalidInput(f"pose.rotation has shape {rotation.shape}; (3, 3) is expected")
    defect = abs(rotation @ rotation.T - np.eye(3)).max()
    if defect > 1e-6 or np.linalg.det(rotation) < 0.0:
        raise InvalidInput(
            f"pose.rotation = {rotation.tolist()} is not a rotation: R Rᵀ is off by {defect:.3g}, "
            f"det R = {np.linalg.det(rotation):.3g}; allowed: 1e-6 and a determinant of one"
        )
    return Pose(position, rotation)
