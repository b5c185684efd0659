# SPDX-License-Identifier: Apache-2.0
"""What a simulator with bilateral constraints asks: closed states, switches, multipliers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from arm_dynamics import InvalidInput
from arm_dynamics.exceptions import known_names
from arm_dynamics.model.arm import Array
from arm_dynamics.scene.constraint import label, switchable
from arm_sim.contact_forces import outside
from arm_sim.inputs import packed_state
from arm_sim.plant.plant import Plant
from arm_sim.state import State

if TYPE_CHECKING:
    from arm_sim.simulator import Simulator

# An arm whose constraints are open by no more than this, in [m] or [m/s], needs no closing.
CLOSED = 1e-11
# Singular value, relative to the largest, under which a position is called singular.
SINGULAR = 1e-3


def consistent(plant: Plant, x: Array, names: tuple[str, ...]) -> Array:
    """The state near ``x`` that obeys the named constraints, near in the metric of M, shape (nx,).

    Raises:
        ConstraintError: If there is none near by.
    """
    if plant.project is None:
        return x
    n = plant.model.n
    q, v = plant.closure.closed(x[:n], x[n : 2 * n], names)
    return np.concatenate([q, v, x[2 * n :]])


def consistent_rows(plant: Plant, x: Array, p: Array) -> Array:
    """The same for many arms, shapes (b, nx) and (b, np); arms that obey already stay."""
    if plant.project is None:
        return x
    n = plant.model.n
    _, gap, gap_v = plant.project(x[:, : 2 * n].T, x[:, : 2 * n].T, p.T)
    off = (_row(gap) > CLOSED) | (_row(gap_v) > CLOSED)
    rows = [
        consistent(plant, x[i], active(plant, p[i])) if off[i] else x[i] for i in range(len(x))
    ]
    return np.array(rows)


def active(plant: Plant, p: Array) -> tuple[str, ...]:
    """Names of the constraints that hold under the parameters ``p``."""
    constraints = plant.model.scene.constraints
    values = dict(zip(switchable(constraints), plant.parameters.of("constraints", p), strict=True))
    return tuple(
        label(constraint, i)
        for i, constraint in enumerate(constraints)
        if constraint.type != "contact" and values.get(i, 1.0) > 0.0
    )


def placed(sim: Simulator, q: Any, v: Any, z: Any) -> Array:
    """The state nearest to a wanted one in which constraints hold and no contact is in its plane.

    Without z the laws get the states that suit q and v.
    """
    plant, n = sim.plant, sim.n
    x = packed_state(plant, q, v, z)
    x = outside(plant, consistent(plant, x, sim.held_constraints))
    if z is None and plant.nz:
        x[2 * n :] = plant.initial(x[:n], x[n : 2 * n])
    return x


def set_constraint(sim: Simulator, name: str, on: bool) -> State:
    """Switch a constraint that the scene declares switchable.

    What is switched on takes hold at once: velocities across it are lost, as in a blow without
    rebound, and a position that it does not allow is moved to the nearest one that it does.

    Args:
        sim: The simulator.
        name: Of the constraint.
        on: Whether it holds from now on.

    Returns:
        The state, time unchanged.

    Raises:
        InvalidInput: If the constraint does not exist or is not switchable; the state stays.
        ConstraintError: If it cannot hold from here; the state stays.
    """
    constraints = sim.model.scene.constraints
    places = [label(constraints[i], i) for i in switchable(constraints)]
    if name not in places:
        raise InvalidInput(
            f"constraint '{name}' cannot be switched; switchable: {known_names(places)}"
        )
    names = {*sim.held_constraints, name} if on else {*sim.held_constraints} - {name}
    state = sim.state
    x = consistent(sim.plant, np.concatenate([state.q, state.v]), tuple(names))
    sim.set_parameter("constraints", [float(place in names) for place in places])
    return sim.set_state(x[: sim.n], x[sim.n :], state.z)


def hint(sim: Simulator) -> str:
    """What may be the matter with the constraints, for the message of a failed tick."""
    if sim.plant.project is None:
        return ""
    closure, q, names = sim.plant.closure, sim.state.q, sim.held_constraints
    A = closure.rows.stacked(q, sim.state.v, names).jacobian
    rank = closure.rank(names, sim.model.q0)
    s = closure.factors(q, A, rank).s
    if len(s) < rank or (rank and s[-1] < SINGULAR * s[0]):
        return "; the constraints are near a singular position, where the motion may branch"
    return "; the constraints could not be held to the tolerance"


def multipliers(sim: Simulator) -> Array:
    """λ under the last torque, shape (m,); see ``Dynamics.constrained_forward``."""
    state, names = sim.state, sim.held_constraints
    return sim.dynamics.constrained_forward(state.q, state.v, sim.effort, names)[1]


def _row(values: object) -> Array:
    return np.asarray(values, dtype=float).ravel()
