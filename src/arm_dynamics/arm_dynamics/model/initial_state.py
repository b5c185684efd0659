# SPDX-License-Identifier: Apache-2.0
"""The initial state of an arm: within its stops, and with the loops of its constraints closed."""

import logging
from typing import NamedTuple

import numpy as np

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.exceptions import ConstraintError, SceneError
from arm_dynamics.model.loops.independent_rows import independent_rows
from arm_dynamics.model.loops.loop_closure import Closure
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.model.regularity import check_regular
from arm_dynamics.model.robot import Robot
from arm_dynamics.model.stops import ROUNDING, Stops

_log = logging.getLogger(__name__)


class InitialState(NamedTuple):
    """Positions and velocities of shape (n,), and independent rows of each constraint."""

    q: Array
    v: Array
    constraint_rows: dict[int, tuple[int, ...]]


def initial_state(robot: Robot, stops: Stops) -> InitialState:
    """The initial state of the scene.

    Raises:
        SceneError: If a position is beyond a stop.
        ConstraintError: If loops cannot be closed from here.
        ModelError: If there are constraints and the mass matrix is singular.
    """
    q, velocity = _positions(robot, stops), robot.scene.initial.velocity
    v = np.array([velocity.get(name, 0.0) for name in robot.joint_names])
    rows: dict[int, tuple[int, ...]] = {}
    if robot.scene.bilateral:
        check_regular(RigidTerms(robot).mass(q)[None], robot.joint_names)
        closure = Closure(robot, stops)
        q, v = _closed(robot, closure, q, v)
        _check_stops(robot, stops, q, "scene: when its constraints are closed, ")
        rows = independent_rows(closure, q)
    return InitialState(read_only(q), read_only(v), rows)


def _positions(robot: Robot, stops: Stops) -> Array:
    """Initial positions before constraints are closed, shape (n,)."""
    initial = robot.scene.initial.position
    for name in set(robot.scene.robot.lock) & initial.keys():
        (lower, upper), at = robot.described_range(name), initial[name]
        if max(lower - at, at - upper) > ROUNDING * max(1.0, abs(at)):
            raise SceneError(
                f"scene: 'initial.position': locked joint '{name}' at {at:.6g} is "
                f"beyond its limits; allowed: {lower:.6g} to {upper:.6g}"
            )
    q = np.array([initial.get(name, 0.0) for name in robot.joint_names])
    nearest, is_named = stops.within(q), [name in initial for name in robot.joint_names]
    named = np.where(is_named, q, nearest)
    _check_stops(robot, stops, named, "scene: 'initial.position': ")
    return nearest


def _closed(robot: Robot, closure: Closure, q: Array, v: Array) -> tuple[Array, Array]:
    """The start with its loops closed; offers another one if it is singular."""
    hold = tuple(map(robot.joint_names.index, robot.scene.initial.hold))
    try:
        start, v = closure.closed(q, v, hold=hold)
    except ConstraintError as error:
        if (other := closure.other_start(q, hold)) is None:
            raise
        kind = "Here the start is singular; from" if closure.is_singular(q) else "From"
        offer = f"{kind} {_in_yaml(robot, other)} they can be closed"
        raise ConstraintError(f"{error} {offer}", error.residuals) from None
    if closure.is_singular(start) and (other := closure.other_start(start, hold)) is not None:
        _log.warning(
            "scene: the start is singular: the joints can move in more ways there than "
            "elsewhere, and the motion may branch; one that is not: %s", _in_yaml(robot, other),
        )  # fmt: skip
    return start, v


def _in_yaml(robot: Robot, q: Array) -> str:
    """Initial positions as a scene gives them."""
    pairs = zip(robot.joint_names, q, strict=True)
    return f"initial: {{position: {{{', '.join(f'{name}: {x:.6g}' for name, x in pairs)}}}}}"


def _check_stops(robot: Robot, stops: Stops, q: Array, where: str) -> None:
    if refusal := stops.refusal(q, robot.joint_names):
        raise SceneError(where + refusal)
