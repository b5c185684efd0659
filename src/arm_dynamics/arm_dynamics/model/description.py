# SPDX-License-Identifier: Apache-2.0
"""The complete robot description: all joints, including mimic and locked ones, and all links.

Vectors of the suite have one entry for each independent joint; drawing a robot or publishing its
frames requires all joints.
"""

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.model.robot import Robot, configuration_of


class AllJoints:
    """Positions and velocities of all joints of the description, from those of the arm model.

    Attributes:
        names: The arm's joints in model order, then the others in the order of the description.
    """

    def __init__(self, robot: Robot) -> None:
        own, whole = robot.joint_names, robot.whole
        others = [name for name in list(whole.names)[1:] if name not in own]
        self.names = (*own, *others)
        rows = {name: row for row, name in enumerate(list(robot.pin.names)[1:])}
        E, e = np.eye(len(self.names), robot.n), np.zeros(len(self.names))
        for i, name in enumerate(others, robot.n):
            if name in rows:
                E[i], e[i] = robot.followers[rows[name]], robot.offsets[rows[name]]
            else:
                e[i] = robot.locked[name]
        self._E, self._e = read_only(E), read_only(e)

    def positions(self, q: Array) -> Array:
        """Positions in [rad] or [m] of all joints for those of the arm, shape (n,)."""
        return np.asarray(self._E @ q + self._e)

    def velocities(self, v: Array) -> Array:
        """Velocities in [rad/s] or [m/s] of all joints for those of the arm, shape (n,)."""
        return np.asarray(self._E @ v)


class Links:
    """Poses of the links, each relative to its parent.

    Attributes:
        fixed: Parent and child of links that never move relative to each other.
        moving: Parent and child of the others.
        root: The root link.
    """

    def __init__(self, robot: Robot) -> None:
        self._model, self._data = robot.whole, pin.Data(robot.whole)
        still = {"universe", *robot.locked}
        fixed, moving = list[tuple[int, int]](), list[tuple[int, int]]()
        frames = list(self._model.frames)
        bodies = [i for i, f in enumerate(frames) if f.type == pin.FrameType.BODY]
        for child in bodies[1:]:
            joint = frames[frames[child].parentFrame]
            rests = joint.type == pin.FrameType.FIXED_JOINT or joint.name in still
            (fixed if rests else moving).append((joint.parentFrame, child))
        self._fixed, self._moving, self.root = fixed, moving, frames[bodies[0]].name
        self.fixed = [(frames[parent].name, frames[child].name) for parent, child in fixed]
        self.moving = [(frames[parent].name, frames[child].name) for parent, child in moving]
        self._locked = robot.locked

    def place(self, positions: dict[str, float]) -> None:
        """Set joint positions in [rad] or [m], by name; locked joints keep theirs."""
        q = configuration_of(self._model, {**positions, **self._locked})
        pin.framesForwardKinematics(self._model, self._data, q)

    def fixed_transforms(self) -> Array:
        """Position [m] and quaternion x y z w of each of ``fixed`` in its parent, shape (k, 7)."""
        return self._transforms(self._fixed)

    def transforms(self) -> Array:
        """Position [m] and quaternion of each of ``moving`` in its parent, shape (k, 7)."""
        return self._transforms(self._moving)

    def _transforms(self, pairs: list[tuple[int, int]]) -> Array:
        at = self._data.oMf
        poses = [pin.SE3ToXYZQUAT(at[parent].actInv(at[child])) for parent, child in pairs]
        return np.array(poses).reshape(-1, 7)
