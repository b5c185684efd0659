# SPDX-License-Identifier: Apache-2.0
"""Goals of the controller node: trajectories, poses and paths, planned in the background.

Planning may take longer than a tick, so it runs in its own thread; a planned motion starts between
two ticks, at the reference from which it was planned. The newest goal takes precedence.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from geometry_msgs.msg import PoseStamped

from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import ArmError, InvalidInput, counted, plain
from arm_dynamics.logs import Throttled
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.ros.common.poses import in_world
from arm_dynamics.ros.common.threads.background import Background
from arm_dynamics.ros.controller.controller_params import ControllerParams
from arm_dynamics.ros.controller.messages import PathBytes, TrajectoryBytes, path_of, waypoints
from arm_dynamics.task_space.task_space import TaskSpace
from arm_dynamics.trajectory.follower import Follower, Outset
from arm_dynamics.trajectory.joint_paths import paced
from arm_dynamics.trajectory.limits import Limits
from arm_dynamics.trajectory.planner import CartesianGoals, Pace
from arm_dynamics.trajectory.reference import Motion, Reference
from arm_dynamics.trajectory.time_optimal import retimed
from arm_dynamics.trajectory.trajectory import Trajectory, hold
from arm_dynamics.trajectory.waypoints import stop

_TIMINGS = {"smooth": paced, "time_optimal": retimed}
MOST_POINTS_AT_ONCE = 10  # number of points that can be planned within two ticks
_LEAD = 50_000_000  # [ns] for planning while the arm moves
_TRIES = 8  # each with twice the planning time


@dataclass(frozen=True)
class Goal:
    """A goal of the controller; its kind and content are for messages."""

    kind: str
    about: str
    start: int | None  # stamp in [ns] at which its time is zero; None for its beginning
    plan: Callable[[Outset], Motion]
    then: Callable[[Motion | None], None] = lambda motion: None  # None when it is refused


class Goals:
    """Plans goals and passes the motions to a follower.

    Attributes:
        follower: Computes references; None until the first joint state.
        stamp: Stamp of the newest state in [ns].
        outcome: Outcome of the newest goal, as text; empty before the first.
        refused: Number of goals that were refused.
        planner: Plans in the background; its results are delivered between two ticks.
    """

    def __init__(
        self, model: ArmModel, limits: Limits, log: Throttled,
        on_planned: Callable[[], None] = lambda: None,
        on_motion: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        """Begin.

        Args:
            model: The arm; never modified.
            limits: Limits of all motions.
            log: Logger for the outcomes of goals.
            on_planned: Called on the planner's thread when a result is ready to be delivered.
            on_motion: Called when a new motion will be followed.
        """
        self.follower: Follower | None = None
        self.stamp = -1
        self.outcome = ""
        self.refused = self._unlogged = 0
        self._model, self._limits, self._log = model, limits, log
        self._on_motion = on_motion
        self.planner = Background("planner", on_planned)

    def hold(self, q: Array, why: str = "") -> None:
        """Hold position ``q``, shape (n,), and discard goals; ``why`` tells what ended them."""
        self.drop(why)
        self.follower = Follower(q, self._limits)
        if self.planner.give_up():
            self.outcome = f"given up{why and f', {why}'}; the arm is held where it is"

    def drop(self, why: str) -> None:
        """Discard the motion, because of ``why``; the arm will be held where it is then."""
        if self.is_moving:
            self.outcome = f"the motion ended, {why}; the arm is held where it is"
        self.follower = None

    def reference(self, stamp: int) -> Reference:
        """The reference at a stamp in [ns]."""
        self.stamp = stamp
        return self.follower.reference(stamp)

    def brake(self, here: Reference | None = None) -> None:
        """End a motion, or that of the reference, smoothly, and hold the arm there."""
        here = here or self.follower.reference(self.stamp)
        at_any_speed = replace(self._limits, velocity=np.full_like(here.v, np.inf))
        try:
            motion: Motion = stop(here, at_any_speed)
        except InvalidInput:  # would exceed a position limit before it stops
            motion = hold(np.clip(here.q, self._limits.lower, self._limits.upper), here.tau)
        self.follower.begin(motion, self.stamp)

    def trajectory(self, raw: bytes) -> None:
        """Follow a serialized JointTrajectory from the current reference, or report why not."""
        names = self._model.joint_names
        most = len(names) + len(names.rules)
        if (message := self._attempt("trajectory", lambda: TrajectoryBytes(raw, most))) is None:
            return

        def plan(outset: Outset) -> Motion:
            points = waypoints(message, names, outset.reference)
            motion = outset.through(points, self._limits)
            while points:  # released one by one: releasing all at once would delay the loop
                points.pop()
            return motion

        goal = Goal("trajectory", counted(message.count, "point"), message.stamp or None, plan)
        self.follow(goal, at_once=message.count <= MOST_POINTS_AT_ONCE)

    def pose(self, message: PoseStamped, params: ControllerParams) -> None:
        """Move the task frame along a straight line to a pose, or report why not."""

        def plan(outset: Outset) -> Motion:
            at, turn = message.pose.position, message.pose.orientation
            numbers = at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w
            goal = in_world(numbers, message.header.frame_id, self._model)
            return self._cartesian(params).line(outset.reference, goal)

        self.follow(Goal("Cartesian goal", "a straight line", None, plan))

    def path(self, raw: bytes, params: ControllerParams) -> None:
        """Move the task frame through the poses of a serialized Path, or report why not."""
        if (message := self._attempt("Cartesian path", lambda: PathBytes(raw))) is None:
            return

        def plan(outset: Outset) -> Motion:
            poses = path_of(message, self._model)
            return self._cartesian(params).through(outset.reference, poses)

        self.follow(Goal("Cartesian path", f"{message.count} poses", None, plan))

    def _cartesian(self, params: ControllerParams) -> CartesianGoals:
        """A new instance for every plan, since it runs in the planner's thread."""
        frame, axes = params.settings.frame, params.settings.axes
        if not frame:
            raise InvalidInput("parameter 'task_frame' is empty; allowed: a frame that moves")
        dynamics = Dynamics(self._model)
        task = TaskSpace(dynamics, frame, selection=axes)
        pace = Pace(params.cartesian_speed, params.cartesian_acceleration, self._limits)
        return CartesianGoals(task, dynamics, pace, _TIMINGS[params.cartesian_timing])

    def follow(self, goal: Goal, *, at_once: bool = False, tries: int = 0) -> None:
        """Plan a goal, in the background unless ``at_once``, and follow it.

        ``tries`` is the number of previous plans that were ready too late.
        """
        if (follower := self.follower) is None:
            self.refuse(goal.kind, ": no joint state has been seen yet")
            goal.then(None)
            return
        lead = 0 if at_once or not self.is_moving else _LEAD << tries
        outset = follower.outset(self.stamp, goal.start, lead)
        plan = partial(goal.plan, outset)
        if at_once:
            self._follow_planned(goal, follower, outset, _TRIES, plan)
            return
        self.outcome = f"planning {goal.kind}: {goal.about}"
        if self.planner.start(plan, partial(self._follow_planned, goal, follower, outset, tries)):
            self._log.info("a newer goal replaces the one that was being planned")

    def _follow_planned(
        self, goal: Goal, follower: Follower, outset: Outset, tries: int,
        result: Callable[[], Motion],
    ) -> None:  # fmt: skip
        """Follow a planned motion, or plan it again if it was ready too late."""
        motion = self._attempt(goal.kind, result)
        if motion is None:
            goal.then(None)
        elif follower.take(outset, motion, self.stamp):
            self.planner.give_up()
            stretch = motion.stretch if isinstance(motion, Trajectory) else 1.0
            slower = f", {stretch:.3g} times slower for the limits" if stretch > 1.0 else ""
            self.outcome = f"following {goal.about} for {motion.duration:.3f} s{slower}"
            self._log.info(self.outcome)
            self._on_motion()
            goal.then(motion)
        elif tries < _TRIES:
            self.follow(goal, tries=tries + 1)
        else:
            self.refuse(goal.kind, ": the arm's reference changed faster than it was planned")
            goal.then(None)

    def _attempt[T](self, kind: str, result: Callable[[], T]) -> T | None:
        """The result of a function; None, and the goal is refused, if it fails."""
        try:
            return result()
        except Exception as error:
            why = error if isinstance(error, ArmError) else f"unexpected failure: {error!r}"
            self.refuse(kind, f"{self.continuation}: {why}")
            return None

    @property
    def is_moving(self) -> bool:
        """Whether a motion is followed."""
        return self.follower is not None and self.follower.remaining(self.stamp) > 0.0

    @property
    def continuation(self) -> str:
        """Part of a refusal: that the present motion, if there is one, goes on."""
        return ", the previous one continues" if self.is_moving else ""

    def refuse(self, kind: str, why: str) -> None:
        """Log that a goal of a kind is refused, and why, and count it."""
        outcome = plain(f"{kind} refused{why}")
        self.outcome = f"{outcome} (again)" if outcome == self.outcome else outcome
        self.refused += 1
        self._unlogged += not self._log.error(outcome, outcome)  # its numbers are a reason, too

    def log_unlogged(self) -> None:
        """Log how many goals were refused without a log message, once they are few again."""
        text = f"{counted(self._unlogged, 'more goal')} refused since, too many to log each"
        if self._unlogged and self._log.error(text):
            self._unlogged = 0
