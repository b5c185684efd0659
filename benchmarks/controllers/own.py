# SPDX-License-Identifier: Apache-2.0
"""A scene of one's own as an arm to compare on: what is not said is chosen from its size."""

from collections.abc import Iterator, Sequence
from itertools import combinations, product
from pathlib import Path

import numpy as np

from arm_dynamics import ArmError, Dynamics, InvalidInput, load_scene
from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import choices
from arm_dynamics.task_space import Pose, TaskSpace
from arm_dynamics.trajectory import joint_path, line, timed
from benchmarks.controllers.cases import Arm

PAYLOAD = 0.05  # of the mass that moves
SPEEDS = 0.25, 0.8  # of the slow and the fast line, in lengths of it a second, see _reach
LENGTHS = 0.4, 0.25, 0.15, 0.08, 0.04  # of the line, of the reach
COULOMB = 0.02  # of a joint's torque limit, or of the largest weight it carries
_REGULAR = 0.05  # smallest singular value of a Jacobian to its largest, at the least


def arm_of(
    scene: str,
    frame: str | None = None,
    step: Sequence[float] | None = None,
    payload: float | None = None,
) -> Arm:
    dynamics = Dynamics(load_scene(scene))
    _refuse(dynamics, scene)
    moving = [f.name for f in dynamics.model.pin.frames if f.parentJoint > 0]
    if frame is not None and frame not in moving:
        raise InvalidInput(f"frame '{frame}' does not move; allowed: {choices(frame, moving)}")
    hand = frame or moving[-1]
    axes = _axes(dynamics, hand)
    reach = _reach(dynamics, hand)
    mass = PAYLOAD * dynamics.model.total_mass if payload is None else payload
    task = TaskSpace(dynamics, hand, selection=axes)
    fast = SPEEDS[1] * reach
    if step is None:
        step = next((x for x in _steps(axes, reach) if _follows(task, x, fast)), None)
    if step is None:
        raise InvalidInput(
            f"no straight line of {LENGTHS[-1] * reach:.3g} m or more that '{hand}' of {scene} "
            "can follow from the scene's start; choose another start or --frame"
        )
    x, y, z = map(float, step)
    return Arm(
        Path(scene).stem, scene, hand, axes, mass, (x, y, z), (SPEEDS[0] * reach, fast),
        _coulomb(dynamics),
    )  # fmt: skip


def _refuse(dynamics: Dynamics, scene: str) -> None:
    model = dynamics.model
    trouble = "closed chains or contacts" if model.scene.constraints else ""
    trouble = trouble or ("motors or flexible joints" if any(model.drives) else "")
    if trouble:
        raise InvalidInput(f"{scene} has {trouble}; controllers are compared on arms without")


def _axes(dynamics: Dynamics, frame: str) -> tuple[str, ...] | str:
    """All of the pose where the arm has six joints for it, else the axes that it moves best."""
    q = dynamics.model.q0
    if dynamics.n >= 6 and _regularity(TaskSpace(dynamics, frame, selection="pose"), q) > 1e-3:
        return "pose"
    for size in range(min(dynamics.n, 3), 0, -1):
        tasks = {
            axes: _regularity(TaskSpace(dynamics, frame, selection=axes), q)
            for axes in combinations("xyz", size)
        }
        best = max(tasks, key=lambda axes: tasks[axes])
        if tasks[best] > _REGULAR:
            return best
    raise InvalidInput(
        f"frame '{frame}' cannot move from the scene's start; choose another start or --frame"
    )


def _regularity(task: TaskSpace, q: Array) -> float:
    """Smallest singular value of the Jacobian to the largest; of one row, its length in [m]."""
    values = np.linalg.svd(task.jacobian(q), compute_uv=False)
    if len(task.axes) > len(q):
        return 0.0
    return float(values[-1] if len(values) == 1 else values[-1] / max(values[0], 1e-300))


def _reach(dynamics: Dynamics, frame: str) -> float:
    """How far the frame is from the first joint, in [m]; 1 where it sits on it."""
    task = TaskSpace(dynamics, frame, selection="position")
    first = dynamics.model.pin.jointPlacements[1].translation
    away = float(np.linalg.norm(task.pose(dynamics.model.q0).position - first))
    return away if away > 1e-2 else 1.0


def _steps(axes: tuple[str, ...] | str, reach: float) -> Iterator[tuple[float, float, float]]:
    """Lines to try, the longest first: along the axes and between them."""
    free = [axis in axes or axes == "pose" for axis in "xyz"]
    signs = [(1.0, -1.0, 0.0) if able else (0.0,) for able in free]
    directions = [np.array(d) for d in product(*signs) if any(d)]
    for length in LENGTHS:
        for direction in directions:
            x, y, z = (length * reach * direction / np.linalg.norm(direction)).tolist()
            yield x, y, z


def _coulomb(dynamics: Dynamics) -> tuple[float, ...]:
    """Dry friction of a plant that has it, in [N m] or [N]."""
    model = dynamics.model
    weight = max(abs(dynamics.gravity(model.q0)).max(), 1e-3 * model.total_mass)
    limit = np.where(np.isfinite(model.effort_limit), model.effort_limit, 2.5 * weight)
    return tuple((COULOMB * limit).tolist())


def _follows(task: TaskSpace, step: Sequence[float], speed: float) -> bool:
    """Whether the arm can follow a line within the limits of its joints."""
    start = task.pose(task.model.q0)
    way = line(start, Pose(start.position + np.array(step), start.rotation))
    try:
        joint_path(task, timed(way, speed, 10.0))
    except ArmError:
        return False
    return True
