# SPDX-License-Identifier: Apache-2.0
"""Admissible states: bilateral constraints closed, no contact point inside its plane."""

import logging
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.plausibility import excessive_velocity
from arm_dynamics.exceptions import ConstraintError, InvalidInput, degrees_meant
from arm_dynamics.scene.constraint import Constraint, label, switchable
from arm_sim.inputs import check_row
from arm_sim.plant.plant import Plant

# Constraints with residuals up to this, in [m] or [m/s], are treated as closed.
CLOSURE_TOLERANCE = 1e-11
# Penetration in [m] up to which a contact point is treated as touching its plane.
PENETRATION_TOLERANCE = 1e-9
# Singular value, relative to the largest, below which a position is called singular.
NEAR_SINGULARITY = 1e-3
# Distance in [rad] or [m] by which closing loops may move a joint without a word: four digits.
_UNREPORTED_MOVE = 1e-3

_log = logging.getLogger(__name__)


def pack_state(plant: Plant, q: Any, v: Any, z: Any = None) -> Array:
    """Validate a state and stack it as x = (q, v, z), shape (nx,); z None for initial values."""
    joints = plant.model.joint_names
    q, v = check_row("q", q, joints), check_row("v", v, joints)
    z = plant.laws.initial(q, v) if z is None else check_row("z", z, plant.nz)
    return np.concatenate([q, v, z])


def admissible_state(
    plant: Plant, q: Any, v: Any, z: Any, names: Collection[str], hold: Sequence[int] = ()
) -> Array:
    """The admissible state nearest to a given one.

    Args:
        plant: The scene's equations.
        q: Joint positions, shape (n,).
        v: Joint velocities, shape (n,).
        z: Internal states, shape (nz,); None for the initial ones at q and v.
        names: Active constraints.
        hold: Indices of joints that keep position and velocity.

    Returns:
        x = (q, v, z), shape (nx,).

    Raises:
        InvalidInput: If a shape or value is not allowed.
        ConstraintError: If there is no such state nearby.
    """
    n, x = plant.model.n, close_loops(plant, pack_state(plant, q, v, z), names, hold)
    x[:n] = clip_to_stops(plant, x[:n])
    _check_outside(plant, x)
    if z is None and plant.nz:
        x[2 * n :] = plant.laws.initial(x[:n], x[n : 2 * n])
    return x


def clip_to_stops(plant: Plant, q: Array, prefix: str = "") -> Array:
    """Positions of shape (n,) clipped to rigid stops up to rounding; else InvalidInput."""
    stops, model = plant.model.stops, plant.model
    if refusal := stops.refusal(q, model.joint_names):
        remark = degrees_meant(_largest_angle(plant, q))
        raise InvalidInput(prefix + refusal + (remark and f"; {remark}"))
    return stops.within(q)


def warn_of_speeds(plant: Plant, v: Array) -> None:
    """Warn of velocities far beyond their limits that are not the scene's initial ones."""
    if (fast := excessive_velocity(plant.model, v)) and not np.array_equal(v, plant.model.v0):
        _log.warning("%s; velocities are in rad/s and m/s", fast)


def warn_of_degrees(plant: Plant, q: Array, *reached: Array) -> None:
    """Warn of positions of many turns, farther than those that the arm has reached by itself."""
    distance = _largest_angle(plant, q)
    farthest = max(_largest_angle(plant, place) for place in reached)
    if (remark := degrees_meant(distance)) and distance > farthest:
        _log.warning("position %s", remark)


def warn_of_closing(plant: Plant, wanted: Any, q: Array) -> None:
    """Warn of the joint that is farthest from where it was wanted, since the loops are closed."""
    distance = abs(q - np.asarray(wanted, dtype=float))
    if distance[k := np.argmax(distance)] > _UNREPORTED_MOVE:
        name = plant.model.joint_names[k]
        _log.warning("joint '%s' is at %.6g, not %.6g, so that loops close", name, q[k], wanted[k])


def _largest_angle(plant: Plant, q: Array) -> float:
    return float(np.max(abs(q) * plant.model.turning))


def close_loops(plant: Plant, x: Array, names: Collection[str], hold: Sequence[int] = ()) -> Array:
    """The state nearest to ``x`` in the metric of M that satisfies the constraints, shape (nx,).

    Raises:
        ConstraintError: If there is none nearby.
    """
    if not plant.constrained:
        return x
    n = plant.model.n
    q, v = plant.closure.closed(x[:n], x[n : 2 * n], names, hold)
    return np.concatenate([q, v, x[2 * n :]])


def close_loops_of_arms(plant: Plant, x: Array, p: Array) -> Array:
    """``close_loops`` for b arms, p of shape (np,) or (b, np); closed states are kept."""
    if not plant.constrained:
        return x
    n, p = plant.model.n, np.broadcast_to(p, (len(x), p.shape[-1]))
    project = plant.mechanics.project
    assert project is not None
    modes = np.zeros((len(p), project.size1_in(2) - p.shape[1]))  # gaps have no names
    _, gap, gap_v = project(x[:, : 2 * n].T, x[:, : 2 * n].T, np.hstack([p, modes]).T)
    is_open = np.maximum(np.array(gap), np.array(gap_v)).ravel() > CLOSURE_TOLERANCE
    x = x.copy()
    for arm in np.flatnonzero(is_open):
        x[arm] = close_loops(plant, x[arm], active_constraints(plant, p[arm]))
    return x


def active_constraints(plant: Plant, p: Array) -> tuple[str, ...]:
    """Names of the active constraints under the tunable quantities ``p``."""
    return active_names(plant.model.scene.constraints, p)


def active_names(constraints: tuple[Constraint, ...], p: Array) -> tuple[str, ...]:
    """Names of the active ones of a scene's constraints; their switches are the last of p."""
    places = switchable(constraints)
    values = dict(zip(places, p[len(p) - len(places) :], strict=True))
    return tuple(
        label(constraint, i)
        for i, constraint in enumerate(constraints)
        if constraint.type != "contact" and values.get(i, 1.0) > 0.0
    )


def constraint_hint(plant: Plant, q: Array, v: Array, names: tuple[str, ...]) -> str:
    """Possible problem with the constraints at a state, for the message of a failed tick."""
    if not plant.constrained:
        return ""
    closure = plant.closure
    A = closure.rows.stacked(q, v, names).jacobian
    rank = closure.rank(names, plant.model.q0)
    s = closure.factors(q, A, rank).s
    if len(s) < rank or (rank and s[-1] < NEAR_SINGULARITY * s[0]):
        return "; the constraints are near a singular position, where the motion may branch"
    return "; the constraints could not be held to the tolerance"


def _check_outside(plant: Plant, x: Array) -> None:
    """Reject contact points inside their planes, naming the deepest; a nanometre is tolerated."""
    if not plant.points:
        return
    gaps = np.array(plant.gaps(x[: plant.model.n])).ravel()
    k = np.argmin(gaps)
    if gaps[k] < -PENETRATION_TOLERANCE:
        depths = {point.name: float(gap) for point, gap in zip(plant.points, gaps, strict=True)}
        raise ConstraintError(
            f"contact '{plant.points[k].name}' is {-gaps[k]:.6g} m inside its plane; "
            "a position at or above it is expected",
            depths,
        )
