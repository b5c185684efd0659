# SPDX-License-Identifier: Apache-2.0
"""Guards: functions of the state whose zeros are the instants of events.

The engine (``native/segments.h``) monitors them to find the instants; here they are expressions,
for derivatives. Each belongs to a mode of a joint or contact.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_dynamics.equations.contact import AT_REST, MODE
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import jacobian_by
from arm_sim.stepping.events import Modes

# A guard that reaches zero within this fraction of a tick is treated as zero; likewise one that is
# smaller than this fraction of its terms.
INSTANT, ROUNDING = 1e-9, 1e-12
# Relative difference of slopes that is none.
DIFFERENT = 1e-9
# A guard larger than this fraction of its terms is zero at no instant nearby: it would have to
# change a thousand times as much in a tick.
FAR = 1e-6
# A guard that approaches zero this much more slowly than it did at the beginning grazes it.
GRAZING = 1e-4


NONE = (ca.MX(1), ca.MX(0))
"""A guard that is never active."""


class Guards:
    """Guards of a scene with events: contacts (normal, tangential), joints, stops, switches.

    Args:
        plant: The scene's equations.
        tuned: Places in p of the quantities to differentiate by.

    Attributes:
        names: The joint, contact or stop of each guard, for messages.
    """

    def __init__(self, plant: Plant, tuned: Sequence[int] = ()) -> None:
        self._plant = plant
        points = [f"contact '{point.name}'" for point in plant.points]
        joints = [f"joint '{name}'" for name in plant.model.joint_names]
        stops = [f"{joint} at its {side} stop" for side in ("lower", "upper") for joint in joints]
        sliding = [f"sliding of {p}" for p in points]
        self.names = [*points, *sliding, *joints, *stops, *plant.switch_names]
        x, u, p, limit = (
            ca.MX.sym("x", plant.nx), ca.MX.sym("u", plant.model.n),
            ca.MX.sym("p", plant.rhs.numel_in(2)), ca.MX.sym("limit", len(points)),
        )  # fmt: skip
        self._joints = slice(2 * len(points), 2 * len(points) + len(joints))
        values, sizes = _guards(plant, x, u, p, limit)
        watched = _watched(plant, p)
        rates = ca.jtimes(values, x, plant.rhs(x, u, p))
        by_w = ca.horzcat(ca.jacobian(values, u), jacobian_by(values, p, tuned))
        slopes = ca.jacobian(values, x), by_w
        arguments = [x, u, p, limit]
        results = [values, sizes, rates, watched]
        self._values = ca.Function("guards", arguments, results).expand("guards", {"cse": True})
        self._slopes = ca.Function("slopes", arguments, slopes).expand("slopes", {"cse": True})

    def zero(self, x: Array, u: Array, modes: Modes, limit: Array, h: float) -> list[int]:
        """Active guards that are zero, or pass zero within an instant, in a tick ``h``.

        Args:
            x: State, shape (nx,).
            u: Command that acts, shape (n,).
            modes: Modes of joints and contacts.
            limit: Fraction of its normal force up to which each contact sticks.
            h: Length of a tick in [s].
        """
        value, size, rate, watched = self._at(x, u, modes, limit)
        near = abs(value) <= INSTANT * h * abs(rate) + ROUNDING * size
        near[self._joints] &= ~self._carried(x, u, modes)
        if switches := self._plant.switches:  # one that stays where it switches does not switch
            near[-switches:] &= abs(rate[-switches:]) * h > ROUNDING * size[-switches:]
        found: list[int] = np.flatnonzero(near & (watched > 0.0)).tolist()
        return found

    def boundaries(self, x: Array, u: Array, modes: Modes, limit: Array, h: float) -> list[int]:
        """Guards that are zero as of ``zero``, and on whose sides motions change differently.

        A switch that does not change the slopes is none of them, and neither is one at which both
        sides lead back, such as that of a current at its limit. One that stays at zero is.
        """
        value, size, rate, _ = self._at(x, u, modes, limit)
        first = len(value) - self._plant.switches
        found = [guard for guard in self.zero(x, u, modes, limit, h) if guard < first]
        near = abs(value) <= INSTANT * h * abs(rate) + ROUNDING * size
        for guard in np.flatnonzero(near[first:]).tolist():
            stays = abs(rate[first + guard]) * h <= ROUNDING * size[first + guard]
            jumps, bends = self._differ(guard, x, u, modes)
            if (bends and not jumps) or (jumps and not stays):
                found.append(first + guard)
        return found

    def _differ(self, switch: int, x: Array, u: Array, modes: Modes) -> tuple[bool, bool]:
        """Whether x' and its derivatives differ between the sides of a switch."""
        sides, place = [], len(modes.tunable) + len(modes.direction) + len(modes.pressed) + switch
        for holds in (0.0, 1.0):
            p = modes.p.copy()
            p[place] = holds
            sides.append([np.array(part) for part in self._motion(x, u, p)])
        jumps, bends = (
            abs(a - b).max() > DIFFERENT * (abs(a) + abs(b)).max()
            for a, b in zip(*sides, strict=True)
        )
        return bool(jumps), bool(bends)

    @built_once
    def _motion(self) -> ca.Function:
        """(x, u, p) -> x' and its derivatives by x and u side by side."""
        rhs = self._plant.rhs
        x, u, p = (ca.SX.sym(name, rhs.size1_in(i)) for i, name in enumerate("xup"))
        slope = rhs(x, u, p)
        return ca.Function("motion", [x, u, p], [slope, ca.jacobian(slope, ca.vertcat(x, u))])

    def _carried(self, x: Array, u: Array, modes: Modes) -> NDArray[np.bool_]:
        """Joints in a sliding mode that a loop holds at rest because other joints stick."""
        n, plant = self._plant.model.n, self._plant
        if plant.project is None or not plant.directions:
            return np.zeros(n, dtype=bool)
        a = np.array(plant.rhs(x, u, modes.p)).ravel()[n : 2 * n]
        still = np.maximum(abs(x[n : 2 * n]), abs(a)) <= AT_REST
        carried: NDArray[np.bool_] = still & (modes.direction != 0.0)
        return carried

    def grazes(
        self, guard: int, begin: Array, end: Array, u: Array, modes: Modes, limit: Array
    ) -> bool:
        """Whether a guard reaches zero at ``end`` with no rate, relative to that at ``begin``."""
        before, after = (abs(self._at(x, u, modes, limit)[2][guard]) for x in (begin, end))
        return not after > GRAZING * before

    def slopes(self, guard: int, x: Array, u: Array, modes: Modes, limit: Array) -> list[Array]:
        """Derivatives of a guard by x, shape (nx,), and by u and the quantities, (n + nt,)."""
        return [np.array(slope)[guard] for slope in self._slopes(x, u, modes.p, limit)]

    def _at(self, x: Array, u: Array, modes: Modes, limit: Array) -> list[Array]:
        return [np.array(found).ravel() for found in self._values(x, u, modes.p, limit)]


Guard = tuple[ca.MX, ca.MX]
"""Value of a guard, and the magnitude of its terms."""


def clearance(plant: Plant, held: bool) -> ca.Function:
    """How far a state is from the boundaries between two modes.

    Args:
        plant: Equations of a scene with events.
        held: Whether anything may be held; else forces are neither computed nor watched.

    Returns:
        CasADi function (x, u, p, limit) -> the smallest active guard less ``FAR`` times its terms.
        Where it is positive, ``Guards.zero`` and ``Guards.boundaries`` find none.
    """
    x, u, p, limit = (
        ca.MX.sym("x", plant.nx), ca.MX.sym("u", plant.model.n),
        ca.MX.sym("p", plant.rhs.numel_in(2)), ca.MX.sym("limit", len(plant.points)),
    )  # fmt: skip
    values, sizes = _guards(plant, x, u, p, limit, held)
    far = ca.if_else(_watched(plant, p) > 0, ca.fabs(values) - FAR * sizes, 1)
    return ca.Function("clearance", [x, u, p, limit], [ca.mmin(far)]).expand()


def _watched(plant: Plant, p: ca.MX) -> ca.MX:
    """1 for guards that are active in the modes, else 0."""
    n, friction, stops = plant.model.n, plant.model.friction, plant.model.stops
    _, direction, _, _, contacts = plant.parts(p)
    modes = ca.reshape(contacts, MODE, len(plant.points)).T
    holds = _flags([point.static_friction > 0.0 for point in plant.points])
    tangential = ca.logic_and(modes[:, 0] > 0, ca.logic_or(modes[:, 1] > 0, holds))
    held, dry = ca.MX(n, 1), ca.DM(n, 1)
    if plant.directions:
        held, dry = direction == 0, _flags(friction.level > 0.0)
    at_stops = [
        ca.logic_or(ca.logic_and(_flags(rigid), ca.logic_not(held)), _flags(yields))
        for rigid, yields in zip(stops.rigid, stops.compliant, strict=True)
    ]
    everywhere = ca.DM.ones(len(plant.points)), ca.DM.ones(plant.switches)
    joints = ca.logic_or(held, dry)
    return ca.vertcat(everywhere[0], tangential, joints, *at_stops, everywhere[1])


def _flags(values: Iterable[Any]) -> ca.DM:
    return ca.DM([float(value) for value in values])


def _guards(plant: Plant, x: ca.MX, u: ca.MX, p: ca.MX, limit: ca.MX, held: bool = True) -> Guard:
    """All guards; values of those that are not active in the modes are meaningless.

    Where nothing is ``held``, loads and forces are zero.
    """
    n, function = plant.model.n, {event.name(): event for event in plant.events}
    _, direction, pressed, _, contacts = plant.parts(p)
    load, force = ca.MX(n, 1), ca.MX(3 * len(plant.points), 1)
    heaviest = [ca.MX(0)] * len(plant.points)
    if held:
        load, force, *_ = function["loads"](x, u, p)
    if held and plant.contact:
        heaviest = _heaviest(force, *function["contact_inertia"](x, u, p))
    whole = x[: 2 * n]
    geometry = plant.contact.geometry(whole) if plant.contact else ()
    push = function["pressures"](whole) if plant.pressed else ca.MX(2 * n, 1)
    guards = [
        *_contact_guards(force, heaviest, geometry, contacts, limit, _fastest(x, n)),
        *_joint_guards(plant, x, load, direction),
        *_stop_guards(plant, x, push, pressed),
    ]
    if plant.switches:
        guards += zip(*(ca.vertsplit(part) for part in function["switches"](x, u, p)), strict=True)
    values, sizes = zip(*guards, strict=True)
    return ca.vertcat(*values), ca.vertcat(*sizes)


def _fastest(x: ca.MX, n: int) -> ca.MX:
    return 1.0 + ca.norm_inf(x[n : 2 * n])


def _heaviest(force: ca.MX, W: ca.MX, _: ca.MX, free: ca.MX) -> list[ca.MX]:
    """Size of the forces at each contact: of its own, and of those that would hold it alone."""
    own, rows = [], [slice(3 * k, 3 * k + 3) for k in range(force.shape[0] // 3)]
    for k in rows:
        mobility = ca.trace(W[k, k])
        alone = ca.if_else(mobility > 0, ca.norm_1(free[k]) / mobility, 0)
        own.append(ca.norm_1(force[k]) + alone)
    return own


def _contact_guards(
    force: ca.MX, heaviest: Sequence[ca.MX], geometry: Sequence[ca.MX], contacts: ca.MX,
    limit: ca.MX, fastest: ca.MX,
) -> list[Guard]:  # fmt: skip
    """Gaps or normal forces; friction reserves, or velocities in the direction of sliding."""
    normal, tangential = [], []
    for k in range(limit.shape[0]):
        place, speed, length = geometry
        closed, sticks, *along = ca.vertsplit(contacts[MODE * k : MODE * k + 4])
        r, s = force[3 * k : 3 * k + 3], speed[3 * k + 1 : 3 * k + 3]
        gap = place[3 * k], length[k]
        spare = (limit[k] * r[0]) ** 2 - ca.sumsqr(r[1:]), heaviest[k] ** 2
        ahead = ca.dot(ca.vertcat(*along), s), fastest
        normal.append(_either(closed > 0, (r[0], heaviest[k]), gap))
        tangential.append(_either(sticks > 0, spare, ahead))
    return normal + tangential


def _joint_guards(plant: Plant, x: ca.MX, load: ca.MX, direction: ca.MX) -> list[Guard]:
    """Reserves of static friction, or velocities."""
    n = plant.model.n
    if not plant.directions:
        return [NONE] * n
    guards, (lower, upper) = [], plant.model.stops.bounds
    for i in range(n):
        away = ca.if_else(x[i] >= upper[i], -load[i], ca.fabs(load[i]))
        away = ca.if_else(x[i] <= lower[i], load[i], away)
        spare = float(plant.model.friction.level[i]) - away, 1.0 + ca.fabs(load[i])
        guards.append(_either(direction[i] == 0, spare, (x[n + i], _fastest(x, n))))
    return guards


def _stop_guards(plant: Plant, x: ca.MX, push: ca.MX, pressed: ca.MX) -> list[Guard]:
    """Distances to stops, the lower ones first; forces of compliant stops in contact."""
    guards, n, stops = [], plant.model.n, plant.model.stops
    for side, sign in ((0, -1.0), (1, 1.0)):
        for i in range(n):
            if not np.isfinite(stops.place[side, i]):
                guards.append(NONE)
                continue
            room, size = sign * (stops.place[side, i] - x[i]), 1.0 + ca.fabs(x[i])
            if stops.compliant[side, i]:  # it is met where it is both reached and pushes
                pushes = push[n * side + i]
                room = ca.if_else(pressed[i] == sign, pushes, ca.fmax(room, -pushes))
                size = stops.stiffness[side, i] * size + stops.damping[side, i] * _fastest(x, n)
            guards.append((room, size))
    return guards


def _either(condition: ca.MX, one: Guard, other: Guard) -> Guard:
    value, size = (ca.if_else(condition, a, b) for a, b in zip(one, other, strict=True))
    return value, size
