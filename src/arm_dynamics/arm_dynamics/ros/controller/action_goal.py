# SPDX-License-Identifier: Apache-2.0
"""Goals of FollowJointTrajectory: which are refused, and the tolerances of the others.

The rules are those by which joint_trajectory_controller (ros2_controllers, Jazzy) accepts goals,
but goals that ask for something it would silently ignore are refused.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, make_dataclass
from typing import Any

from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.ros.common.convert import to_nanoseconds
from arm_dynamics.ros.common.params import parameter
from arm_dynamics.ros.controller.tolerances import NONE, StateTolerance, Tolerances, effective
from arm_dynamics.ros.interfaces import MAX_GOAL_POINTS
from arm_dynamics.scene.urdf.joint_names import JointNames, NamedJoints, check_finite
from arm_dynamics.trajectory.splines import REST_SPEED


@dataclass(frozen=True)
class FollowParams:
    """Parameters of the action, with the names and defaults of joint_trajectory_controller.

    ``follow_params`` adds ``constraints.<joint>.trajectory`` and ``constraints.<joint>.goal``.
    """

    allow_partial_joints_goal: bool = parameter(
        False, "Whether action goals may omit joints, which then do not move", read_only=False
    )
    action_monitor_rate: float = parameter(
        20.0, "Rate of the action's feedback [Hz], in the time of the states", low=0.1, high=1e4
    )
    stretch_goals: bool = parameter(
        False, "Make action goals slower instead of refusing those beyond velocity, acceleration "
        "or effort limits", read_only=False,
    )  # fmt: skip
    limit_margin: float = parameter(
        0.02, "Fraction by which goals may exceed velocity, acceleration and effort limits: "
        "interpolation between points within the limits overshoots slightly",
        low=0.0, high=10.0, read_only=False,
    )  # fmt: skip
    stopped_velocity_tolerance: float = parameter(
        0.01, "Speed below which joints are considered stopped at the goal [rad/s]; 0: any",
        low=0.0, high=1e6, read_only=False, name="constraints.stopped_velocity_tolerance",
    )  # fmt: skip
    goal_time: float = parameter(
        0.0, "Time after its end until a goal must be reached [s]; 0: any",
        low=0.0, high=1e6, read_only=False, name="constraints.goal_time",
    )  # fmt: skip

    def of_joints(self, kind: str, n: int) -> list[float]:
        """Position tolerances of n joints, ``trajectory`` or ``goal``; inf for none."""
        return [getattr(self, f"{kind}_{i}") or NONE for i in range(n)]


def follow_params(joint_names: Sequence[str]) -> type[FollowParams]:
    """The parameters of the action of an arm with these joints."""
    about = {
        "trajectory": "Largest position error during the motion [rad or m]; 0: any",
        "goal": "Largest position error at the goal [rad or m]; 0: any",
    }
    tolerances = [
        (f"{kind}_{i}", float, parameter(
            0.0, text, low=0.0, high=1e6, read_only=False, name=f"constraints.{joint}.{kind}"
        ))
        for kind, text in about.items() for i, joint in enumerate(joint_names)
    ]  # fmt: skip
    return make_dataclass("FollowParams", tolerances, bases=(FollowParams,), frozen=True)


class TrajectoryMessage:
    """A JointTrajectory of a goal, with the interface of ``TrajectoryBytes``.

    Its header is checked at once, its points in the background.
    """

    def __init__(self, message: Any, model_names: JointNames, partial: bool) -> None:
        """Check the header of a message that names all joints, or some if it may be ``partial``.

        Raises:
            InvalidInput: If joints are missing, unknown or repeated, or there are no points or too
                many.
        """
        self.stamp = to_nanoseconds(message.header.stamp)
        self.joint_names, self.count = tuple(message.joint_names), len(message.points)
        self._points = message.points
        if not self.joint_names:
            raise InvalidInput(f"no joint names; allowed: those of {known_names(model_names)}")
        NamedJoints(self.joint_names, model_names)
        missing = [name for name in model_names if name not in self.joint_names]
        if missing and not partial:
            raise InvalidInput(
                f"joints {known_names(missing)} are missing; allowed: a goal for all joints, or "
                "the parameter allow_partial_joints_goal"
            )
        if not 1 <= self.count <= MAX_GOAL_POINTS:
            raise InvalidInput(f"{self.count} points; allowed: 1 to {MAX_GOAL_POINTS}")

    def points(self) -> Iterator[tuple[int, Any, Any, Any, Any]]:
        """Time from start in [ns], positions, velocities, accelerations, efforts of each."""
        for point in self._points:
            time = to_nanoseconds(point.time_from_start)
            yield time, point.positions, point.velocities, point.accelerations, point.effort

    def check_points(self) -> None:
        """Check that times increase, numbers are finite, and the last velocities are zero."""
        before = -1
        for i, point in enumerate(self._points):
            time = to_nanoseconds(point.time_from_start)
            if time <= before:
                raise InvalidInput(
                    f"time_from_start of point {i} is {1e-9 * time:g} s; allowed: "
                    + (f"more than {1e-9 * before:g} s" if i else "at least 0 s")
                )
            before = time
            for field in ("positions", "velocities", "accelerations", "effort"):
                check_finite(f"{field} of point {i}", self.joint_names, getattr(point, field))
        for joint, v in zip(self.joint_names, self._points[-1].velocities, strict=False):
            if abs(v) > REST_SPEED:
                raise InvalidInput(f"the last velocity of joint '{joint}' is {v:g}; allowed: 0")


def refuse_multi_dof(goal: Any) -> None:
    """Refuse goals for joints of several degrees of freedom by ``InvalidInput``."""
    multi_dof = goal.multi_dof_trajectory
    for field, entries in (
        ("multi_dof_trajectory", [*multi_dof.joint_names, *multi_dof.points]),
        ("component_path_tolerance", goal.component_path_tolerance),
        ("component_goal_tolerance", goal.component_goal_tolerance),
    ):
        if len(entries):
            raise InvalidInput(f"{field} is given; allowed: none (joints have one degree)")


def tolerances(
    goal: Any, params: FollowParams, model_names: JointNames, continuous: tuple[int, ...]
) -> Tolerances:
    """Tolerances of a goal: its own, else those of the parameters.

    Raises:
        InvalidInput: If a tolerance is not allowed, or a joint does not exist or is named twice.
    """
    n, seconds = len(model_names), 1e-9 * to_nanoseconds(goal.goal_time_tolerance)
    path_defaults = params.of_joints("trajectory", n), [NONE] * n
    goal_defaults = params.of_joints("goal", n), [params.stopped_velocity_tolerance or NONE] * n
    return Tolerances(
        _joint_tolerances("path_tolerance", goal.path_tolerance, model_names, *path_defaults),
        _joint_tolerances("goal_tolerance", goal.goal_tolerance, model_names, *goal_defaults),
        effective("goal_time_tolerance", seconds, params.goal_time or NONE),
        continuous,
    )


def _joint_tolerances(
    field: str, messages: Sequence[Any], names: JointNames, position: Sequence[float],
    velocity: Sequence[float],
) -> StateTolerance:  # fmt: skip
    position, velocity = list(position), list(velocity)
    for k, message in enumerate(messages):
        names.check([message.name], f"{field} names joint")
        if any(message.name == other.name for other in messages[:k]):
            raise InvalidInput(f"{field} names joint '{message.name}' twice; allowed: each once")
        joint, entry = names.index(message.name), f"{field} of joint '{message.name}'"
        position[joint] = effective(f"position in {entry}", message.position, position[joint])
        velocity[joint] = effective(f"velocity in {entry}", message.velocity, velocity[joint])
        if effective(f"acceleration in {entry}", message.acceleration, NONE) != NONE:
            raise InvalidInput(
                f"acceleration in {entry} is {message.acceleration:g}; allowed: 0 or -1, since "
                "joint states have no accelerations"
            )
    return StateTolerance(tuple(position), tuple(velocity))
