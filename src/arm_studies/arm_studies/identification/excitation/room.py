# SPDX-License-Identifier: Apache-2.0
"""Constraints of an exciting motion: limits of the joints, and the workspace."""

from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics import ArmModel, Dynamics
from arm_dynamics.arrays import Array, numbers, positive_limits, read_only, vector
from arm_dynamics.attributes import frozen
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_dynamics.equations.frame import placement, relative
from arm_dynamics.equations.rigid_body import placements
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.model.tree_builder import frame_of, tree_of
from arm_dynamics.trajectory import Bounds, Limits, Trajectory

_HALF_TURN = np.pi  # [rad] or [m] to either side for a joint without position limits
_INSIDE = 0.1  # distance of the default start from both limits, as a fraction of the range
_POINTS = np.linspace(0.0, 1.0, 5)[:-1]  # of every segment, at which gaps are checked
_BATCH = 200  # points at once: for more, Dynamics would compile, which takes a second when new


@frozen
class Box:
    """A box in the world that contains the origins of some frames.

    Attributes:
        lower: Its lowest corner x, y, z in [m], shape (3,).
        upper: Its highest corner, likewise.
        frames: Names of links or joints of the URDF.
    """

    lower: ArrayLike
    upper: ArrayLike
    frames: tuple[str, ...]

    def __post_init__(self) -> None:
        """Check it."""
        lower, upper = numbers("box.lower", self.lower), numbers("box.upper", self.upper)
        if lower.shape != (3,) or upper.shape != (3,) or not np.all(lower < upper):
            raise InvalidInput(
                f"box from {lower} to {upper}; two corners x, y, z in m are expected, the first "
                "below the second in each coordinate"
            )
        if not self.frames:
            raise InvalidInput("the box has no frames; at least one is expected")


@frozen
class Room:
    """The constraints of a motion.

    Args:
        dynamics: The arm; used from one thread only.
        share: Fraction of the velocity and torque limits that may be used.
        margin: Distance to both position limits, as a fraction of each joint's range.
        acceleration: Limits in [rad/s²] or [m/s²], one or shape (n,); inf for none.
        box: Where frames must stay; None: anywhere.
        clearance: Distance in [m] to keep from the planes of the scene's contacts.
        given_start: Position at which the motion begins and ends, shape (n,); None for the scene's
            initial position, moved inwards if it is near a limit.

    Raises:
        InvalidInput: If an argument is not allowed, the arm has closed loops, or the start
            violates a limit.
    """

    dynamics: Dynamics
    share: float = 0.8
    margin: float = 0.05
    acceleration: ArrayLike = np.inf
    box: Box | None = None
    clearance: float = 0.05
    given_start: ArrayLike | None = None

    def __post_init__(self) -> None:
        """Check the arguments, and that the arm can hold the start position."""
        if not 0.0 < self.share <= 1.0:
            raise InvalidInput(f"share = {self.share}; more than 0 and at most 1 is expected")
        if not 0.0 <= self.margin < 0.5:
            raise InvalidInput(f"margin = {self.margin}; at least 0 and below 0.5 is expected")
        if not 0.0 <= self.clearance < np.inf:
            raise InvalidInput(
                f"clearance = {self.clearance}; a distance in m of at least 0 is expected"
            )
        if loops := self.model.scene.bilateral:
            raise InvalidInput(
                f"the scene has {len(loops)} constraints that close loops or hold frames, so its "
                "joints cannot move independently; an open chain is expected"
            )
        self._check_start()

    @property
    def model(self) -> ArmModel:
        """The arm."""
        return self.dynamics.model

    @cached_property
    def limits(self) -> Limits:
        """Limits of positions without margins, of velocities and of accelerations, as used."""
        model = self.model
        lower = np.where(np.isfinite(model.position_lower), model.position_lower, np.nan)
        upper = np.where(np.isfinite(model.position_upper), model.position_upper, np.nan)
        lower = np.where(np.isnan(lower), np.fmin(model.q0, upper) - _HALF_TURN, lower)
        upper = np.where(np.isnan(upper), np.fmax(model.q0, lower) + _HALF_TURN, upper)
        off = self.margin * (upper - lower)
        acceleration = positive_limits("acceleration", self.acceleration, model.n)
        velocity = self.share * model.velocity_limit
        return Limits(velocity, acceleration, lower + off, upper - off, model.joint_names)

    @property
    def effort(self) -> Array:
        """Limits of torques as used, in [N m] or [N], inf where there is none, shape (n,)."""
        return self.share * self.model.effort_limit

    @cached_property
    def start(self) -> Array:
        """Position at which the motion begins and ends, shape (n,)."""
        lower, upper = self.limits.lower, self.limits.upper
        if self.given_start is not None:
            return vector("start", self.given_start, self.model.joint_names)
        off = _INSIDE * (upper - lower)
        return read_only(np.clip(self.model.q0, lower + off, upper - off))

    @built_once
    def gaps(self) -> tuple[ca.Function, tuple[str, ...]]:
        """Distances in [m] that must not be negative, as a function of q, and their names."""
        model = self.model
        q, tree = ca.SX.sym("q", model.n), tree_of(model)
        pose = placements(tree, q)
        distances, names = list[ca.SX](), list[str]()
        for name, contact in model.scene.contacts:
            plane = contact.plane
            pair = frame_of(model, contact.frame), frame_of(model, plane.frame)
            _, u = relative(tree, pose, pair, (contact.point, plane.point))
            height = ca.dot(ca.DM(plane.normal), u) - contact.radius
            distances.append(height - self.clearance)
            names.append(f"the distance of '{name}' from its plane")
        box = self.box
        for frame in box.frames if box else ():
            if not model.has_frame(frame):
                raise InvalidInput(
                    f"box: unknown frame '{frame}'; allowed: {known_names(model.frame_names)}"
                )
            place, _ = placement(tree, frame_of(model, frame), q)
            assert box  # it has the frame
            distances += [place - ca.DM(box.lower), ca.DM(box.upper) - place]
            names += [f"the distance of '{frame}' from the {end} side of the box in {axis}"
                      for end in ("lower", "upper") for axis in "xyz"]  # fmt: skip
        rows = ca.densify(ca.vertcat(ca.SX(0, 1), *distances))
        return ca.Function("gaps", [q], [rows], {"cse": True}), tuple(names)

    def torques(self, q: Array, v: Array, a: Array) -> Array:
        """Torques of a motion in [N m] or [N], shape (k, n)."""
        rows = np.array_split(np.arange(len(q)), len(q) // _BATCH + 1)
        return np.vstack([self.dynamics.inverse(q[i], v[i], a[i]) for i in rows])

    def check(self, motion: Trajectory) -> None:
        """Check a motion: limits by the extrema of its polynomials, torques and gaps at points.

        Raises:
            InvalidInput: If it violates a constraint.
        """
        within = Limits(
            self.limits.velocity / self.share, self.limits.acceleration / self.share,
            self.limits.lower, self.limits.upper, self.limits.joint_names,
        )  # fmt: skip
        Bounds(within, self.dynamics, self.share - 1.0).check(motion)
        self._check_gaps(motion.table(_POINTS)[1], "along the motion")

    def _check_start(self) -> None:
        limits, q = self.limits, self.start
        beyond = np.maximum(limits.lower - q, q - limits.upper)
        for i in np.flatnonzero(beyond > 0.0):
            raise InvalidInput(
                f"start: joint '{limits.name(int(i))}' at {q[i]:.6g} rad or m; allowed: "
                f"{limits.lower[i]:.6g} to {limits.upper[i]:.6g}"
            )
        tau = self.dynamics.inverse(q, np.zeros_like(q), np.zeros_like(q))
        for i in np.flatnonzero(abs(tau) >= self.effort):
            raise InvalidInput(
                f"start: gravity loads joint '{limits.name(int(i))}' with {abs(tau[i]):.4g} N m "
                f"or N; allowed: less than {self.effort[i]:.4g}"
            )
        self._check_gaps(q[None], "at the start")

    def _check_gaps(self, q: Array, where: str) -> None:
        gaps, names = self.gaps
        if not names:
            return
        distance = gaps.map(len(q))(q.T).full()
        i = int(np.argmin(distance.min(axis=1)))
        if distance[i].min() < 0.0:
            raise InvalidInput(
                f"{where} {names[i]} is too short by {-distance[i].min():.4g} m; another start, "
                "box or clearance is expected"
            )
