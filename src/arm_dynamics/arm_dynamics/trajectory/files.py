# SPDX-License-Identifier: Apache-2.0
"""Joint trajectories as files: YAML of a ``trajectory_msgs/JointTrajectory``.

They can be passed to ``ros2 topic pub`` unchanged, and read without ROS.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, vector
from arm_dynamics.attributes import frozen
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.scene.urdf.joint_names import JointNames, NamedJoints
from arm_dynamics.trajectory.reference import Waypoint
from arm_dynamics.trajectory.trajectory import Trajectory
from arm_dynamics.trajectory.waypoints import quintic
from arm_dynamics.writing import replacing

_ROUNDING = 1e-6  # between the end of a motion and its beginning, that is rounding
_FIELDS = {"positions": "q", "velocities": "v", "accelerations": "a", "effort": "tau"}


@frozen
class JointTrajectory:
    """Points for named joints.

    Attributes:
        joint_names: Order of the joints in each point.
        points: Waypoints, with times in [s] from the start, the first at time 0.
    """

    joint_names: tuple[str, ...]
    points: tuple[Waypoint, ...]

    @classmethod
    def of(cls, motion: Trajectory, joint_names: Sequence[str], turns: int = 1) -> JointTrajectory:
        """The knots of a motion, with position, velocity, acceleration, and torques if it has any.

        Args:
            motion: The motion.
            joint_names: Names of its joints.
            turns: Number of repetitions, for a motion that ends in its initial state.

        Raises:
            InvalidInput: If ``turns`` is not a positive whole number, or the motion cannot repeat.
        """
        if isinstance(turns, bool) or not isinstance(turns, int | np.integer) or turns < 1:
            raise InvalidInput(f"turns = {turns!r}; a whole number of at least 1 is expected")
        first, end = motion.ends
        is_apart = abs(end - first) > _ROUNDING * np.maximum(1.0, abs(first))
        if turns > 1 and is_apart.any():
            i = int(np.argmax(is_apart))
            raise InvalidInput(
                f"turns = {turns}: the motion begins at {first[i]:g} of joint '{joint_names[i]}' "
                f"and ends at {end[i]:g}, so it cannot repeat; allowed: turns = 1"
            )
        ends, last = motion.table(np.array([0.0])), motion.sample(motion.duration)
        q, v, a = (np.vstack([part, end]) for part, end in
                   zip(ends[1:], (last.q, last.v, last.a), strict=True))  # fmt: skip
        torques = motion.torques if motion.torques is not None else [None] * len(motion.times)
        points = [
            Waypoint(float(turn * motion.duration + time), q[i], v[i], a[i], torques[i])
            for turn in range(turns)
            for i, time in enumerate(motion.times)
            if i or not turn
        ]
        return cls(tuple(joint_names), tuple(points))

    @property
    def start(self) -> dict[str, float]:
        """Start position of each joint, by name, in [rad] or [m]."""
        first = np.asarray(self.points[0].q, float)
        return dict(zip(self.joint_names, first.tolist(), strict=True))

    def motion(self, joint_names: Sequence[str]) -> Trajectory:
        """Quintic segments through the points, joints in the order of an arm's.

        Mimic joints may be among those of the trajectory, if they agree with their leaders.

        Raises:
            InvalidInput: If the joints differ, or points are malformed.
        """
        arm = joint_names if isinstance(joint_names, JointNames) else JointNames(joint_names)
        if set(arm) != set(self.joint_names) - arm.rules.keys():
            raise InvalidInput(
                f"the trajectory is for joints {known_names(self.joint_names)}; the arm has "
                f"{known_names(joint_names)}"
            )
        named, rest = NamedJoints(self.joint_names, arm), np.zeros(len(arm))

        def ordered(field: str, row: ArrayLike) -> Array:
            values = vector("a point", row, self.joint_names)
            return named.spread("a point", field, values.tolist(), rest)

        def ordered_if_given(field: str, row: ArrayLike | None) -> Array | None:
            return None if row is None else ordered(field, row)

        return quintic([
            Waypoint(
                p.time, ordered("position", p.q), ordered_if_given("velocity", p.v),
                ordered_if_given("acceleration", p.a), ordered_if_given("effort", p.tau),
            )
            for p in self.points
        ])  # fmt: skip

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write it as YAML; an existing file is replaced, with a warning.

        Raises:
            NotWritten: If the system does not let it be written; an OSError.
        """
        names = (name.replace("\\", "\\\\").replace('"', '\\"') for name in self.joint_names)
        text = [f"joint_names: [{', '.join(f'"{name}"' for name in names)}]", "points:"]
        for point in self.points:
            seconds, rest = divmod(round(1e9 * point.time), 1_000_000_000)
            text.append(f"- time_from_start: {{sec: {seconds}, nanosec: {rest}}}")
            for key, part in _FIELDS.items():
                if (row := getattr(point, part)) is not None:
                    numbers = ", ".join(map(_number, np.asarray(row, float).tolist()))
                    text.append(f"  {key}: [{numbers}]")
        with replacing(Path(path)) as file:
            file.write_text("\n".join(text) + "\n", encoding="utf-8")
        return Path(path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> JointTrajectory:
        """Read it.

        Raises:
            InvalidInput: If it is not a joint trajectory.
            OSError: If it cannot be read.
        """
        try:
            content = yaml.load(Path(path).read_text(encoding="utf-8"), yaml.CSafeLoader)
            names = tuple(map(str, content["joint_names"]))
            points = list[Waypoint]()
            for point in content["points"]:
                time = point["time_from_start"]
                seconds = float(time["sec"]) + 1e-9 * float(time.get("nanosec", 0))
                rest = [point.get(key) or None for key in list(_FIELDS)[1:]]  # [] means none
                points.append(Waypoint(seconds, point["positions"], *rest))
            trajectory = cls(names, tuple(points))
            trajectory.motion(names)
        except (KeyError, TypeError, AttributeError, UnicodeDecodeError, yaml.YAMLError) as error:
            raise InvalidInput(
                f"'{path}' is not a joint trajectory: joint_names and points with positions and "
                f"time_from_start are expected ({type(error).__name__}: {error})"
            ) from None
        except InvalidInput as error:
            raise InvalidInput(f"'{path}': {error}") from None
        return trajectory


def _number(x: float) -> str:
    """Text with enough digits to be read back exactly, and never as an integer."""
    text = repr(x)
    return text.replace("e", ".0e") if "e" in text and "." not in text else text
