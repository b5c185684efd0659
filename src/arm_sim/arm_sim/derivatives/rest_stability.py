# SPDX-License-Identifier: Apache-2.0
"""Whether joints and contacts at rest would come to rest again after the smallest push.

See ``native/derivatives/rest_stability.h``.
"""

import casadi as ca
import numpy as np

from arm_dynamics.equations.contact import Mode
from arm_sim.plant.plant import Plant
from arm_sim.plant.symbols import dense_function


def is_unstable_at_rest(plant: Plant, p: ca.SX, is_first: bool) -> ca.SX:
    """Whether what is held may go on after a push, under the modes in p: 1 if so, else 0.

    A joint alone whose friction is the same at rest and as it begins to slide comes to rest again,
    whatever its load. Once it has, it is held by friction that does not vanish.
    """
    friction, points = plant.model.friction, plant.points
    coulomb, excess, static = friction.coulomb, friction.excess, friction.static
    smallest = coulomb.mean + excess.mean - abs(coulomb.skew + excess.skew)
    doubtful = (friction.efficiency < 1.0) | (smallest <= 0.0)
    if is_first:
        static_differs = [a + b != c for a, b, c in zip(coulomb, excess, static, strict=True)]
        doubtful = doubtful | plant.constrained | static_differs[0] | static_differs[1]
    _, direction, *_, contacts = plant.layout.parts(p)
    mode, doubt = Mode.of(contacts), ca.SX(0)
    closed = ca.sum1(mode.closed) > 0
    for joint in np.flatnonzero(friction.level > 0.0) if plant.layout.directions else ():
        coupled = closed if is_first else False
        held = direction[int(joint)] == 0
        doubt = ca.logic_or(doubt, ca.logic_and(held, ca.logic_or(doubtful[joint], coupled)))
    for k, point in enumerate(points if is_first else ()):
        if point.static_friction > point.friction > 0.0:
            doubt = ca.logic_or(doubt, mode.closed[k] * mode.sticks[k])
    return doubt


def rest_functions(plant: Plant) -> tuple[ca.Function, ...]:
    """What ``native/derivatives/rest_stability.h`` requires besides the functions of the engine.

    Args:
        plant: Equations of a scene with events.

    Returns:
        ``doubts`` (x, u, p) -> ``is_unstable_at_rest``, without and with ``is_first``; with
        contacts ``settled`` (q and v, p) -> velocities after contact per velocity before.
    """
    x, u, p = (ca.SX.sym(name, plant.rhs.size1_in(i)) for i, name in enumerate("xup"))
    doubts = ca.vertcat(*(is_unstable_at_rest(plant, p, is_first) for is_first in (False, True)))
    functions = [dense_function("doubts", [x, u, p], doubts)]
    if contact := plant.mechanics.contact:
        x = ca.SX.sym("x", 2 * plant.model.n)
        settled = ca.jacobian(contact.settle(x, p), x)[:, plant.model.n :]
        functions.append(dense_function("settled", [x, p], settled))
    return tuple(functions)
