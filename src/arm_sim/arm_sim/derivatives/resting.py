# SPDX-License-Identifier: Apache-2.0
"""Whether joints and contacts at rest would come to rest again after the smallest push.

See ``native/derivatives/rest_stability.h``.
"""

import casadi as ca
import numpy as np

from arm_dynamics.equations.contact import Mode
from arm_sim.plant.plant import Plant
from arm_sim.plant.symbols import dense_function


def may_go_on(plant: Plant, p: ca.SX, begins: bool) -> ca.SX:
    """Whether what is held may go on after a push, under the modes in p: 1 if so, else 0.

    A joint alone whose friction is the same at rest and as it begins to slide comes to rest again,
    whatever its load. Once it has, it is held by friction that does not vanish.
    """
    friction, points = plant.model.friction, plant.points
    coulomb, excess, static = friction.coulomb, friction.excess, friction.static
    least = coulomb.mean + excess.mean - abs(coulomb.skew + excess.skew)
    doubtful = (friction.efficiency < 1.0) | (least <= 0.0)
    if begins:
        falls = [a + b != c for a, b, c in zip(coulomb, excess, static, strict=True)]
        doubtful = doubtful | plant.constrained | falls[0] | falls[1]
    _, direction, *_, contacts = plant.layout.parts(p)
    mode, doubt = Mode.of(contacts), ca.SX(0)
    closed = ca.sum1(mode.closed) > 0
    for joint in np.flatnonzero(friction.level > 0.0) if plant.layout.directions else ():
        coupled = closed if begins else False
        held = direction[int(joint)] == 0
        doubt = ca.logic_or(doubt, ca.logic_and(held, ca.logic_or(doubtful[joint], coupled)))
    for k, point in enumerate(points if begins else ()):
        if point.static_friction > point.friction > 0.0:
            doubt = ca.logic_or(doubt, mode.closed[k] * mode.sticks[k])
    return doubt


def resting_functions(plant: Plant) -> tuple[ca.Function, ...]:
    """What ``native/derivatives/rest_stability.h`` requires besides the functions of the engine.

    Args:
        plant: Equations of a scene with events.

    Returns:
        ``doubts`` (x, u, p) -> ``may_go_on``, without and with ``begins``; with contacts
        ``settled`` (q and v, p) -> velocities after contact per velocity before.
    """
    x, u, p = (ca.SX.sym(name, plant.rhs.size1_in(i)) for i, name in enumerate("xup"))
    doubts = ca.vertcat(*(may_go_on(plant, p, begins) for begins in (False, True)))
    functions = [dense_function("doubts", [x, u, p], doubts)]
    if contact := plant.mechanics.contact:
        x = ca.SX.sym("x", 2 * plant.model.n)
        settled = ca.jacobian(contact.settle(x, p), x)[:, plant.model.n :]
        functions.append(dense_function("settled", [x, p], settled))
    return tuple(functions)
