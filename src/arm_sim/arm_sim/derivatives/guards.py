# SPDX-License-Identifier: Apache-2.0
"""Guards: functions of the state whose zeros are the instants of events.

The engine (``native/guards``) monitors them to find the instants; here they are expressions, for
derivatives (``guard_derivatives.h``). Each belongs to a mode of a joint or contact.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from arm_dynamics.equations.contact import MODE, Mode
from arm_sim.plant.plant import Plant
from arm_sim.plant.symbols import dense_function, expanded_function

# A guard larger than this fraction of its terms is zero at no instant nearby: it would have to
# change a thousand times as much in a tick.
CLEARANCE = 1e-6

# Mobility across the direction of sliding, relative to the whole, that is rounding
MOBILITY_ROUNDING = 1e-12

# Value of a guard, and the magnitude of its terms
Guard = tuple[ca.MX, ca.MX]
# A guard that is never active
INACTIVE: Guard = (ca.MX(1), ca.MX(0))


def guard_names(plant: Plant) -> list[str]:
    """The joint, contact or stop of each guard, for messages.

    Guards of a scene are those of contacts (normal, tangential), joints, stops (lower, upper) and
    switches.
    """
    points = [f"contact '{point.name}'" for point in plant.points]
    joints = [f"joint '{name}'" for name in plant.model.joint_names]
    stops = [f"{joint} at its {side} stop" for side in ("lower", "upper") for joint in joints]
    sliding = [f"sliding of {point}" for point in points]
    drives = plant.mechanics.symbols.drives
    driven = drives.joints if drives else ()
    limits = [f"a limit, backlash or load of the drive of {joints[i]}" for i in driven]
    cords = ["a cord"] * (plant.layout.switches - len(limits))
    return [*points, *sliding, *joints, *stops, *cords, *limits]


def guard_functions(plant: Plant, p_indices: Sequence[int] = ()) -> tuple[ca.Function, ...]:
    """What ``native/derivatives/guard_derivatives.h`` requires.

    Args:
        plant: Equations of a scene with events.
        p_indices: Indices in p of the quantities to differentiate by.

    Returns:
        ``guards`` (x, u, p, limit) -> values, magnitudes of their terms, rates, 1 for those that
        are active, accelerations of the joints; ``guard_gradient`` (x, u, p, limit, weights) ->
        gradients of the weighted sum by x, and by u and quantities; with switches ``motion``
        (x, u, p) -> x' and its derivatives by x and u side by side. ``limit`` are the fractions of
        their normal force up to which contacts stick.
    """
    n, rhs = plant.model.n, plant.rhs
    arguments = _symbols(plant)
    x, u, p, _ = arguments
    values, sizes = _guards(plant, *arguments)
    slope = rhs(x, u, p)
    active = _active(plant, arguments, values, sizes)
    results = [values, sizes, ca.jtimes(values, x, slope), active, slope[n : 2 * n]]
    weights = ca.MX.sym("weights", values.shape[0])
    by_x, by_u, by_p = (ca.jtimes(values, by, weights, True) for by in (x, u, p))
    by_w = ca.vertcat(by_u, by_p[list(p_indices)]) if p_indices else by_u
    functions = [
        expanded_function("guards", arguments, results),
        expanded_function("guard_gradient", [*arguments, weights], [by_x, by_w]),
    ]
    if plant.layout.switches:
        x, u, p = (ca.SX.sym(name, rhs.size1_in(i)) for i, name in enumerate("xup"))
        slope = rhs(x, u, p)
        slopes = ca.jacobian(slope, ca.vertcat(x, u))
        functions.append(dense_function("motion", [x, u, p], slope, slopes))
    return tuple(functions)


def mobility_across(plant: Plant) -> ca.Function:
    """``across`` (x, u, p) -> a number for each contact of a scene.

    It is positive where forces can move the contact across its direction of sliding.
    """
    mobility_of, across = plant.events["contact_mobility"], list[ca.MX]()
    x, u, p = mobility_of.mx_in()
    W, sliding = mobility_of(x, u, p)[0], Mode.of(plant.layout.parts(p)[-1]).direction
    for k in range(len(plant.points)):
        rows, direction = slice(3 * k, 3 * k + 3), sliding[2 * k : 2 * k + 2]
        lateral = ca.vertcat(0, -direction[1], direction[0])
        mobility = ca.bilin(W[rows, rows], lateral, lateral)
        across.append(mobility - MOBILITY_ROUNDING * ca.trace(W[rows, rows]))
    return expanded_function("across", [x, u, p], [ca.vertcat(*across)])


def _symbols(plant: Plant) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
    """State, command, parameters with modes, and limits."""
    x, u, p = (ca.MX.sym(name, plant.rhs.size1_in(i)) for i, name in enumerate("xup"))
    return x, u, p, ca.MX.sym("limit", len(plant.points))


def clearance(plant: Plant, may_hold: bool) -> ca.Function:
    """How far a state is from the boundaries between two modes.

    Args:
        plant: Equations of a scene with events.
        may_hold: Whether anything may be held; else no forces are computed.

    Returns:
        CasADi function (x, u, p, limit) -> the smallest active guard less ``CLEARANCE`` times its
        terms. Where it is positive, no guard is zero or a boundary.
    """
    arguments = _symbols(plant)
    values, sizes = _guards(plant, *arguments, may_hold)
    active = _active(plant, arguments, values, sizes)
    margin = ca.if_else(active > 0, ca.fabs(values) - CLEARANCE * sizes, 1)
    return ca.Function("clearance", arguments, [ca.mmin(margin)]).expand()


def _active(plant: Plant, arguments: Sequence[ca.MX], values: ca.MX, sizes: ca.MX) -> ca.MX:
    """1 for guards that are active in the modes, else 0.

    A switch that compares nothing is not active, as the engagement of teeth within their backlash:
    it is zero, and remains so.
    """
    x, u, p, _ = arguments
    count = plant.layout.switches
    active, switches = _active_besides_switches(plant, p), slice(values.shape[0] - count, None)
    varies = ca.jacobian(values[switches], ca.vertcat(x, u)) if count else ca.MX(0, 1)
    compares = ca.logic_or(sizes[switches] > 0, ca.sum2(ca.fabs(varies)) > 0)
    return ca.vertcat(active, compares)


def _active_besides_switches(plant: Plant, p: ca.MX) -> ca.MX:
    """1 for guards other than switches that are active in the modes, else 0."""
    n, friction, stops = plant.model.n, plant.model.friction, plant.model.stops
    _, direction, _, _, contacts = plant.layout.parts(p)
    modes = ca.reshape(contacts, MODE, len(plant.points)).T
    holds = _flags([point.static_friction > 0.0 for point in plant.points])
    tangential = ca.logic_and(modes[:, 0] > 0, ca.logic_or(modes[:, 1] > 0, holds))
    held, dry = ca.MX(n, 1), ca.DM(n, 1)
    if plant.layout.directions:
        held, dry = direction == 0, _flags(friction.level > 0.0)
    at_stops = [
        ca.logic_or(ca.logic_and(_flags(rigid), ca.logic_not(held)), _flags(yields))
        for rigid, yields in zip(stops.rigid, stops.compliant, strict=True)
    ]
    normal, joints = ca.DM.ones(len(plant.points)), ca.logic_or(held, dry)
    return ca.vertcat(normal, tangential, joints, *at_stops)


def _flags(values: Iterable[Any]) -> ca.DM:
    return ca.DM([float(value) for value in values])


def _guards(
    plant: Plant, x: ca.MX, u: ca.MX, p: ca.MX, limit: ca.MX, may_hold: bool = True
) -> Guard:
    """All guards, in the order of ``guard_names``; ``_active_besides_switches`` has the same.

    Values of those that are not active in the modes are meaningless. Unless something
    ``may_hold``, loads and forces are zero.
    """
    n, function = plant.model.n, plant.events
    _, direction, pressed, _, contacts = plant.layout.parts(p)
    load, force = ca.MX(n, 1), ca.MX(3 * len(plant.points), 1)
    force_scales = [ca.MX(0)] * len(plant.points)
    if may_hold:
        load, force, *_ = function["loads"](x, u, p)
    if may_hold and plant.mechanics.contact:
        force_scales = _force_scales(force, *function["contact_mobility"](x, u, p))
    qv = x[: 2 * n]
    geometry = plant.mechanics.contact.geometry(qv) if plant.mechanics.contact else ()
    push = function["pressures"](qv) if plant.layout.pressed else ca.MX(2 * n, 1)
    guards = [
        *_contact_guards(force, force_scales, geometry, contacts, limit, _speed_scale(x, n)),
        *_joint_guards(plant, x, load, direction),
        *_stop_guards(plant, x, push, pressed),
    ]
    if plant.layout.switches:
        guards += zip(*(ca.vertsplit(part) for part in function["switches"](x, u, p)), strict=True)
    values, sizes = zip(*guards, strict=True)
    return ca.vertcat(*values), ca.vertcat(*sizes)


def _speed_scale(x: ca.MX, n: int) -> ca.MX:
    return 1.0 + ca.norm_inf(x[n : 2 * n])


def _force_scales(force: ca.MX, W: ca.MX, _B: ca.MX, free: ca.MX) -> list[ca.MX]:
    """Size of the forces at each contact: of its own, and of those that would hold it alone."""
    scales, rows = [], [slice(3 * k, 3 * k + 3) for k in range(force.shape[0] // 3)]
    for k in rows:
        mobility = ca.trace(W[k, k])
        holding_force = ca.if_else(mobility > 0, ca.norm_1(free[k]) / mobility, 0)
        scales.append(ca.norm_1(force[k]) + holding_force)
    return scales


def _contact_guards(
    force: ca.MX, force_scales: Sequence[ca.MX], geometry: Sequence[ca.MX], contacts: ca.MX,
    limit: ca.MX, speed_scale: ca.MX,
) -> list[Guard]:  # fmt: skip
    """Gaps or normal forces; friction reserves, or velocities in the direction of sliding."""
    normal, tangential = [], []
    for k in range(limit.shape[0]):
        place, speed, length = geometry
        closed, sticks, *along = ca.vertsplit(contacts[MODE * k : MODE * k + 4])
        r, s = force[3 * k : 3 * k + 3], speed[3 * k + 1 : 3 * k + 3]
        gap = place[3 * k], length[k]
        reserve = (limit[k] * r[0]) ** 2 - ca.sumsqr(r[1:]), force_scales[k] ** 2
        sliding = ca.dot(ca.vertcat(*along), s), speed_scale
        normal.append(_choose(closed > 0, (r[0], force_scales[k]), gap))
        tangential.append(_choose(sticks > 0, reserve, sliding))
    return normal + tangential


def _joint_guards(plant: Plant, x: ca.MX, load: ca.MX, direction: ca.MX) -> list[Guard]:
    """Reserves of static friction, or velocities."""
    n = plant.model.n
    if not plant.layout.directions:
        return [INACTIVE] * n
    guards, (lower, upper) = [], plant.model.stops.bounds
    for i in range(n):
        push = ca.if_else(x[i] >= upper[i], -load[i], ca.fabs(load[i]))
        push = ca.if_else(x[i] <= lower[i], load[i], push)
        reserve = float(plant.model.friction.level[i]) - push, 1.0 + ca.fabs(load[i])
        guards.append(_choose(direction[i] == 0, reserve, (x[n + i], _speed_scale(x, n))))
    return guards


def _stop_guards(plant: Plant, x: ca.MX, push: ca.MX, pressed: ca.MX) -> list[Guard]:
    """Distances to stops, the lower ones first; forces of compliant stops in contact."""
    guards, n, stops = [], plant.model.n, plant.model.stops
    for side, sign in ((0, -1.0), (1, 1.0)):
        for i in range(n):
            if not np.isfinite(stops.place[side, i]):
                guards.append(INACTIVE)
                continue
            room, size = sign * (stops.place[side, i] - x[i]), 1.0 + ca.fabs(x[i])
            if stops.compliant[side, i]:  # it is met where it is both reached and pushes
                force, speed = push[n * side + i], _speed_scale(x, n)
                room = ca.if_else(pressed[i] == sign, force, ca.fmax(room, -force))
                size = stops.stiffness[side, i] * size + stops.damping[side, i] * speed
            guards.append((room, size))
    return guards


def _choose(condition: ca.MX, if_true: Guard, if_false: Guard) -> Guard:
    value, size = (ca.if_else(condition, a, b) for a, b in zip(if_true, if_false, strict=True))
    return value, size
