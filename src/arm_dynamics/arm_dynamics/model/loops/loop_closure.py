# SPDX-License-Identifier: Apache-2.0
"""States that satisfy the constraints, found by Newton's method.

Steps are the shortest in the metric of M, see ``mass_metric``.
"""

from collections.abc import Collection, Sequence

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import ConstraintError, InvalidInput, choices
from arm_dynamics.model.constraint_rows import ConstraintRows
from arm_dynamics.model.loops.mass_metric import Factors, cholesky, factored, whitened
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.model.robot import Robot
from arm_dynamics.model.stops import Stops

# Largest residual of a closed constraint in [m] or [rad]; Newton's method continues to rounding.
TOLERANCE = 1e-10
NEWTON_STEPS = 100  # at most; far from closure, each is shortened to ``STEP_SIZE``
# Largest Newton step of a joint in [rad], or in [m] on an arm of a reach of up to 1 m.
STEP_SIZE = 0.3
# Halvings of a step at most, and the decrease of the residual that is enough, relative to what a
# whole step promises (Armijo's rule).
HALVINGS, DECREASE = 12, 1e-3
# Number of positions at which the rank is evaluated, and the step between them.
SAMPLES, SAMPLE_STEP = 6, 0.2
# A position whose smallest singular value is below this fraction of the largest is singular.
SINGULAR = 1e-5
# Starts that are tried in place of one that is singular, and how far the last ones are from it, in
# [rad] or relative to the arm's reach.
STARTS, RADIUS = 30, 1.5


class Closure:
    """Closed states of one robot; for single states of shape (n,).

    Args:
        robot: The robot; used from one thread only.
        stops: Stops of its joints; positions beyond them are avoided where possible.

    Attributes:
        rows: Its constraint rows.

    Raises:
        SceneError: If a constraint leaves no degree of freedom.
    """

    def __init__(self, robot: Robot, stops: Stops) -> None:
        self.rows, self._rigid = ConstraintRows(robot), RigidTerms(robot)
        self._stops = stops
        self._reach = np.where(robot.turning, 1.0, robot.reach)
        self._ranks: dict[tuple[str, ...], int] = {}

    @property
    def initially_active(self) -> tuple[str, ...]:
        """Names of the initially active constraints."""
        pairs = zip(self.rows.names, self.rows.constraints, strict=True)
        return tuple(name for name, constraint in pairs if constraint.active)

    def active_names(self, active: Collection[str] | None) -> tuple[str, ...]:
        """Validate names of constraints; None selects the initially active ones."""
        if active is None:
            return self.initially_active
        for name in active:
            if name not in self.rows.names:
                allowed = choices(name, self.rows.names)
                raise InvalidInput(f"there is no constraint '{name}'; allowed: {allowed}")
        return tuple(name for name in self.rows.names if name in active)

    def closed(
        self, q: Array, v: Array, active: Collection[str] | None = None, hold: Sequence[int] = ()
    ) -> tuple[Array, Array]:
        """A state that satisfies the constraints, close to a given one in the metric of M.

        Args:
            q: Joint positions, shape (n,).
            v: Joint velocities, shape (n,).
            active: Names of the active constraints; None for the initially active ones.
            hold: Indices of joints that keep position and velocity.

        Returns:
            Positions and velocities.

        Raises:
            ConstraintError: If Newton's method finds none from here, or the held velocities allow
                none.
        """
        names = self.active_names(active)
        q = self._inside_stops(self._closed_position(q, names, hold), names, hold)
        A = self.rows.stacked(q, v, names).jacobian
        if not hold:
            return q, v + self.factors(q, A, self.rank(names, q)).nearest(-(A @ v))
        v = v + self._nearest_of_others(q, A, -(A @ v), hold)
        if float(np.max(abs(A @ v), initial=0.0)) > TOLERANCE * max(1.0, float(abs(v).max())):
            held = ", ".join(f"'{self.rows.joint_names[i]}' = {v[i]:g}" for i in hold)
            raise ConstraintError(
                f"no velocities of the other joints satisfy the constraints while {held} is held"
            )
        return q, v

    def is_singular(self, q: Array) -> bool:
        """Whether the initially active constraints are singular at a position.

        There, fewer rows are independent than at a generic position: a closed linkage may branch,
        and an open one may not be closable though it is from elsewhere.

        Raises:
            ConstraintError: If they cannot be closed from here, and have not been before.
        """
        names = self.initially_active
        rank = self.rank(names, q)
        s = self.factors(q, self.rows.stacked(q, 0 * q, names).jacobian, rank).s
        return len(s) < rank or bool(rank and s[-1] < SINGULAR * s[0])

    def other_start(self, near: Array, hold: Sequence[int] = ()) -> Array | None:
        """A closed position near another that is not singular, and that the stops allow.

        Args:
            near: Joint positions, shape (n,).
            hold: Indices of joints that keep their positions.

        Returns:
            The first one from deterministic random starts, ever farther from ``near``; None if
            there is none.
        """
        rng, names = np.random.default_rng(0), self.initially_active
        for k in range(STARTS):
            shift = RADIUS * (k + 1) / STARTS * self._reach * rng.uniform(-1, 1, len(near))
            start = self._stops.within(near + shift)
            start[list(hold)] = near[list(hold)]
            try:
                q = self._inside_stops(self._closed_position(start, names, hold), names, hold)
                if not (self._stops.beyond(q) > 0.0).any() and not self.is_singular(q):
                    return q
            except ConstraintError:
                continue
        return None

    def residuals(self, q: Array, active: Collection[str] | None = None) -> dict[str, float]:
        """Residual norm of each constraint in [m] or [rad]."""
        names = self.active_names(active)
        pairs = zip(self.rows.names, self.rows.at(q, np.zeros_like(q)), strict=True)
        return {name: float(abs(row.residual).max()) for name, row in pairs if name in names}

    def factors(self, q: Array, A: Array, rank: int) -> Factors:
        """Factors of rows A of shape (m, n) with at most ``rank`` singular values."""
        return factored(self._rigid.mass(q), A, rank)

    def whitened(self, q: Array, A: Array) -> Array:
        """Rows A, shape (m, n), in coordinates whose metric is the identity: Y = A C^-ᵀ."""
        return whitened(cholesky(self._rigid.mass(q)), A)

    def _nearest_of_others(self, q: Array, A: Array, b: Array, hold: Sequence[int]) -> Array:
        """Shortest motion with A a = b in the metric of M in which some joints do not move."""
        free = np.setdiff1d(np.arange(len(q)), hold)
        motion, M = np.zeros(len(q)), self._rigid.mass(q)
        if len(free):
            rows = A[:, free]
            motion[free] = factored(M[np.ix_(free, free)], rows, min(rows.shape)).nearest(b)
        return motion

    def rank(self, names: tuple[str, ...], near: Array) -> int:
        """Number of independent rows of the named constraints at a generic closed position.

        An overconstrained linkage moves only because its rows are dependent wherever it is closed;
        elsewhere, even within rounding of it, they seem independent. The first call counts them,
        at positions closed from ``near``; later ones return that count.
        """
        if names not in self._ranks:
            places = self.sample_positions(near, names)
            A = [self.rows.stacked(q, 0 * q, names).jacobian for q in places]
            values = [self.factors(q, a, min(a.shape)).s for q, a in zip(places, A, strict=True)]
            self._ranks[names] = max(map(len, values))
        return self._ranks[names]

    def sample_positions(self, start: Array, names: tuple[str, ...]) -> list[Array]:
        """Sample closed positions along the motion that the named constraints allow.

        Args:
            start: Joint positions to start from, shape (n,).
            names: Active constraints, in the order of the scene.

        Returns:
            Deterministic positions of shape (n,), the one nearest to ``start`` first.

        Raises:
            ConstraintError: If none can be closed from ``start``.
        """
        rng, places = np.random.default_rng(0), [self._closed_position(start, names)]
        for _ in range(SAMPLES - 1):
            q = places[-1]
            A = self.rows.stacked(q, 0 * q, names).jacobian
            v = rng.normal(size=len(q))
            v = v - self.factors(q, A, min(A.shape)).nearest(A @ v)
            try:
                q = self._closed_position(q + SAMPLE_STEP * v / max(1e-9, abs(v).max()), names)
            except ConstraintError:
                continue
            places.append(q)
        return places

    def _inside_stops(self, q: Array, names: tuple[str, ...], hold: Sequence[int]) -> Array:
        """A closed position near ``q`` with joints moved back to their stops, if there is one.

        Returns ``q`` if there is none; the caller may reject it.
        """
        inside, held = q, set(hold)
        while more := set(np.flatnonzero(self._stops.beyond(inside) > 0.0).tolist()) - held:
            held |= more
            try:
                inside = self._closed_position(self._stops.within(inside), names, sorted(held))
            except ConstraintError:
                return q
        return inside

    def _closed_position(
        self, q: Array, names: tuple[str, ...], hold: Sequence[int] = ()
    ) -> Array:
        """Newton's method in the metric of M, damped such that the residual decreases."""
        row = self.rows.stacked(q, 0 * q, names)
        size = float(np.linalg.norm(row.residual))
        for _ in range(NEWTON_STEPS):
            if size == 0.0:
                break
            A = row.jacobian
            step = self._nearest_of_others(q, A, -row.residual, hold)
            largest = abs(step / np.maximum(self._reach, 1.0)).max()
            step *= min(1.0, STEP_SIZE / max(largest, 1e-300))
            for halving in range(HALVINGS):
                trial = self.rows.stacked(q + 0.5**halving * step, 0 * q, names)
                if np.linalg.norm(trial.residual) < (1.0 - DECREASE * 0.5**halving) * size:
                    break
            else:
                break
            q, row = q + 0.5**halving * step, trial
            size = float(np.linalg.norm(row.residual))
        if size > TOLERANCE:
            raise self._gap_error(q, names, hold)
        return q

    def _gap_error(self, q: Array, names: tuple[str, ...], hold: Sequence[int]) -> ConstraintError:
        """The error of constraints that are not closed at ``q``, the end of the search."""
        residuals = self.residuals(q, names)
        gaps = {name: size for name, size in residuals.items() if size > TOLERANCE}
        listed = ", ".join(f"'{name}' by {size:.3g}" for name, size in gaps.items())
        held = ", ".join(f"'{self.rows.joint_names[i]}' at {q[i]:g}" for i in hold)
        keeping = f" while {held} is held" if hold else ""
        return ConstraintError(
            f"constraints cannot be closed from this position{keeping}; left open, in m or rad: "
            f"{listed}. Do they contradict one another, or is the position too far off?",
            residuals,
        )
