# SPDX-License-Identifier: Apache-2.0
"""The geometry of a stick figure: polylines through points of an arm."""

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.scene.constraint import DistanceConstraint

# Numbers of Pinocchio's joints, and points in [m] that are fixed in their frames
type Points = list[tuple[int, Array]]

_ORIGIN, _UP = np.zeros(3), np.array([0.0, 0.0, 1.0])
_GAP = 0, np.full(3, np.nan)  # between polylines of a kind
_SPARE_RAIL = 0.05  # beyond the travel of a prismatic joint, relative to the arm's reach
_PLANE_SIZE = 0.35  # half the width of what is drawn of a plane, likewise
_SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]])


class StickFigure:
    """Polylines of an arm, of each kind one with gaps.

    Args:
        model: The arm.
        q: Positions of a motion, shape (k, n), whose travel its rails have.

    Attributes:
        ground: For each joint on the world: the world's origin, the joint's place, a gap.
        arm: From joint to joint, and from the last joint of each chain to its end.
        rails: For each prismatic joint: an end of its rail, its carriage, the other end, a gap.
        rods: For each distance constraint: both of its points, a gap.
        planes: For each plane of contact: the corners of a square around its point.
    """

    def __init__(self, model: ArmModel, q: Array) -> None:
        self._model, tree, self.planes = model, model.pin, list[Points]()
        self.ground, self.arm, self.rails, self.rods = (
            list[tuple[int, Array]]() for _ in range(4)
        )
        configurations, spare = model.configuration(q), _SPARE_RAIL * model.reach
        for joint in range(1, tree.njoints):
            parent, place = tree.parents[joint], tree.jointPlacements[joint]
            link = self.arm if parent else self.ground
            link += [(parent, _ORIGIN), (parent, place.translation), _GAP]
            if joint not in tree.parents:
                self.arm += [(joint, _ORIGIN), (joint, _end(model, joint)), _GAP]
            slide = np.ravel(tree.joints[joint].createData().S)[:3]
            if slide.any():
                travel = np.append(configurations[:, tree.joints[joint].idx_q], 0.0)
                rail = np.outer([travel.min() - spare, travel.max() + spare], slide)
                first, last = ((parent, place.act(end)) for end in rail)
                self.rails += [first, (joint, _ORIGIN), last, _GAP]
        for rod in model.scene.constraints:
            if isinstance(rod, DistanceConstraint):
                ends = _ends(model, rod)
                self.rods += [*ends, _GAP]
                for joint, point in (end for end in ends if end[0]):
                    self.arm = [(joint, _ORIGIN), (joint, point), _GAP, *self.arm]
        for plane in dict.fromkeys(contact.plane for _, contact in model.scene.contacts):
            frame = model.frame(plane.frame)
            turn = pin.Quaternion.FromTwoVectors(_UP, np.array(plane.normal)).matrix()
            corners = plane.point + _PLANE_SIZE * model.reach * _SQUARE @ turn.T
            self.planes.append([(frame.parentJoint, frame.placement.act(x)) for x in corners])

    def positions(self, points: Points, q: Iterable[Array]) -> Array:
        """Points in the world at joint positions, shape (k, m, 3)."""
        model, data = self._model, pin.Data(self._model.pin)
        rows = []
        for posture in q:
            pin.forwardKinematics(model.pin, data, model.configuration(posture))
            rows.append([data.oMi[joint].act(point) for joint, point in points])
        return np.array(rows)


def _end(model: ArmModel, joint: int) -> Array:
    """The point of a last body farthest from its joint: of a frame, a loop or its mass."""
    frames = [(frame.parentJoint, frame.placement.translation) for frame in model.pin.frames]
    loops = [end for loop in model.scene.constraints for end in _ends(model, loop)]
    own = [point for carrier, point in (*frames, *loops) if carrier == joint]
    return max((model.pin.inertias[joint].lever, *own), key=np.linalg.norm)


def _ends(model: ArmModel, constraint: object) -> Points:
    """The points of a constraint between frames; none of one between joints."""
    ends = zip(getattr(constraint, "frames", ()), getattr(constraint, "points", ()), strict=False)
    frames = [(model.frame(name), np.array(point)) for name, point in ends]
    return [(frame.parentJoint, frame.placement.act(point)) for frame, point in frames]
