# SPDX-License-Identifier: Apache-2.0
"""The scene's equation of motion as one function x' = f(x, u, p).

It contains only the terms that the scene has.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import cache, cached_property, partial

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.actuation.internal_state import Ensemble
from arm_dynamics.actuation.joint_laws import laws_of
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.one_at_a_time import built_once, one_at_a_time
from arm_dynamics.equations.contact import ContactPoint
from arm_dynamics.equations.derivatives import inverse_derivatives
from arm_dynamics.equations.forward_dynamics import DENSE_AT_MOST
from arm_dynamics.equations.rigid_body import inverse, mass_matrix
from arm_dynamics.model.loop_closure import Closure
from arm_dynamics.model.tree_builder import contact_points
from arm_sim.plant.contact import ContactFunctions, gaps
from arm_sim.plant.mechanics import Mechanics
from arm_sim.plant.parameters import Parameters
from arm_sim.plant.switches import SwitchedLaw
from arm_sim.plant.symbols import Joints, Symbols, dense_function, has_cords, mode_counts

Power = Callable[[ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]
"""Function (q, v, tau, p) -> power in [W]."""


class Plant:
    """Equation of motion of one scene.

    With dry friction, stops, cords, or drives with limits or backlash, the equation depends on
    modes, which follow the tunable quantities in p: first a direction for each joint, -1 or 1 for
    sliding, 0 for sticking or being held by a rigid stop; then the joints in contact with
    compliant stops; then the case distinctions of cords and drives (``switches``); last the modes
    of the contacts.

    Equations are built on first use: if their compiled code is cached, they are not needed.

    Attributes:
        model: The robot.
        variant: How the equations differ from those of the scene itself.
        free: The same arm away from its stops and with comparisons for ``switches``, if nothing
            else causes events: simpler equations, with the tunable quantities alone in p. None
            without either, or if there are always modes.
        parameters: Tunable quantities.
        laws: Drives and friction with internal states z; None if the scene has none.
        directions: Number of joint directions that follow in p.
        pressed: Number of joints with compliant stops, likewise.
        moving: Whether all joints slide and nothing touches, whatever the modes.
        glides: Whether there is dry friction or contact, so that ``in_motion`` is simpler.
        eventful: Whether joints may stick or meet stops, points touch, or drives and cords switch.
        constrained: Whether there are bilateral constraints.
        torques: CasADi function (x, u) -> torques of the drives, and of all models together, on
            the links; None where the command acts directly.
    """

    @one_at_a_time
    def __init__(self, model: ArmModel, stops: bool = True) -> None:
        """Build the equations; without ``stops``, those of ``free``."""
        self.model = model
        self.variant = "" if stops else "free"
        self.parameters = Parameters(model)
        self.stops = stops and bool(model.stops)
        self.directions, self.pressed = mode_counts(model, stops)
        laws = laws_of(model)
        drives = (law for law in laws if stops and law.replaces_command.any())
        gears = model.friction.gears
        self._drives = {law: SwitchedLaw(law, model.n, gears) for law in drives}
        modes = ca.vertcat(ca.SX(0, 1), *(drive.modes for drive in self._drives.values()))
        forward = {i: sign for drive in self._drives.values() for i, sign in drive.forward.items()}
        switches = modes.numel() > 0 or (stops and has_cords(model))
        touches = bool(model.scene.contacts)
        self.eventful = bool(self.directions or self.pressed or touches or switches)
        self.constrained = bool(model.scene.bilateral)
        self.glides = model.has_dry_friction or touches
        leaves = (self.stops or switches) and not self.glides
        self.free = Plant(model, stops=False) if leaves else None
        self._make_mechanics = partial(Mechanics, model, self.parameters, stops, modes, forward)
        self._mechanics = cache(one_at_a_time(self._make_mechanics))
        self.moving = False
        self._switching = switches
        self._compose(Ensemble(laws, model.n) if laws else None)

    @property
    def switches(self) -> int:
        """Number of modes of cords and drives."""
        return int(self._mechanics().joints.switches.numel()) if self._switching else 0

    def parts(self, p: ca.SX) -> tuple[ca.SX, ...]:
        """Tunable quantities, directions, compliant stops, ``switches``, and contacts, from p."""
        numbers = self.directions, self.pressed, self.switches
        ends = np.cumsum([0, len(self.parameters.nominal), *numbers]).tolist()
        return tuple(ca.vertsplit(p, [*ends, p.shape[0]]))

    @property
    def switch_names(self) -> tuple[str, ...]:
        """What switches, for messages, in the order of ``switches``."""
        if not self._switching:
            return ()
        names, cords = self.model.joint_names, self._mechanics().symbols.cords
        owners = [joint for drive in self._drives.values() for joint in drive.joints]
        own = [f"a limit, backlash or load of the drive of joint '{names[i]}'" for i in owners]
        return (*["a cord"] * (cords.modes.numel() if cords else 0), *own)

    def under_torques(self) -> Plant:
        """The same arm without drives and friction that have states: commands are torques."""
        other = copy(self)
        other.variant += " under torques"
        other.free = self.free and self.free.under_torques()
        other._compose(None)
        return other

    def in_motion(self) -> Plant:
        """The same arm while all joints slide and nothing touches: simpler equations.

        The modes in p are the same; those of sticking and touching do nothing.
        """
        return self._moving(f"{self.variant} in motion")

    def smoothed(self, speed: float) -> Plant:
        """The same arm with dry friction of the smooth direction v / √(v² + speed²).

        For derivatives that do not vanish where friction holds a joint. Its motion has no events:
        nothing sticks or touches, and joints pass their stops.
        """
        away = Plant(self.model, stops=False)
        other = away._moving(f"{away.variant} smoothed over {speed!r}", smoothing=speed)
        other.eventful = False
        return other

    def _moving(self, variant: str, smoothing: float = 0.0) -> Plant:
        other = copy(self)
        other.variant, other.moving = variant, True
        make = partial(self._make_mechanics, moving=True, smoothing=smoothing)
        other._mechanics = cache(one_at_a_time(make))
        other._compose(self.laws, self._powers)
        return other

    def accounted(self, ledger: Ensemble, powers: Sequence[Power]) -> Plant:
        """The same arm with additional states that integrate powers, see ``_composed``."""
        other = copy(self)
        other.variant += " accounted"
        other.free = self.free and self.free.accounted(ledger, powers)
        other._compose(ledger, powers)
        return other

    def _compose(self, laws: Ensemble | None, powers: Sequence[Power] = ()) -> None:
        """Add models with states, and powers as additional states, to the arm."""
        self.laws, self._powers = laws, powers
        self.torques = _torques(laws) if laws else None
        if laws:
            moded = tuple(self._drives.get(law, law) for law in laws.laws)
            laws = replace(laws, laws=moded)
        self._moded = laws
        equations = partial(_composed, self._mechanics, laws, powers)
        self._equations = cache(one_at_a_time(equations))

    @property
    def acceleration(self) -> ca.Function:
        """CasADi function (q, v, tau, p) -> q̈ of vectors of n."""
        return self._mechanics().acceleration

    @property
    def project(self) -> ca.Function | None:
        """Projection of states onto bilateral constraints, None without any.

        CasADi function ((q, v) before a step, after it, p) -> (q, v) after it, projected, and the
        residuals of positions and velocities before.
        """
        return self._mechanics().project if self.constrained else None

    @property
    def contact(self) -> ContactFunctions | None:
        """Functions of the contacts, None without any."""
        return self._mechanics().contact if self.points and not self.moving else None

    @built_once
    def gaps(self) -> ca.Function:
        """Heights of the contact points above their planes, see ``contact.gaps``."""
        return gaps(self.model, self.points)

    @property
    def method(self) -> str:
        """Name of the selected algorithm, for display."""
        return self.free.method if self.free else self._mechanics().method

    @property
    def rhs(self) -> ca.Function:
        """CasADi function (x, u, p) -> x' with x = (q, v, z)."""
        return self._equations()[0]

    @property
    def events(self) -> dict[str, ca.Function]:
        """CasADi functions evaluated at events, by name; empty where nothing sticks or touches.

        ``loads`` (x, u, p), the last of which are torques of stops and x', with bilateral
        constraints ``bilateral`` (x, u, p), with stops ``strike`` and ``pressures``, with
        ``switches`` (x, u, p) their switching functions and the magnitude of the terms of each,
        with contacts ``contact_inertia`` (x, u, p), ``contact_geometry`` and ``contact_close``,
        and where parts may hold together ``statics`` (x, u, p).
        """
        return self._equations()[1] if self.eventful else {}

    @one_at_a_time
    def slope_of_loads(self) -> ca.Function:
        """``rhs`` for code that contains ``loads``: it calls that, where there is one."""
        loads = self.events.get("loads")
        if loads is None:
            return self.rhs
        given = [ca.MX.sym(name, loads.size1_in(i)) for i, name in enumerate("xup")]
        return ca.Function("rhs", given, loads.call(given)[-1:])

    @one_at_a_time
    def scaled_jacobian(self) -> ca.Function | None:
        """The Jacobian of x' = (v, g) by x = (q, w), scaled to preserve a tree's sparsity.

        With H v̇ = 1 · load for free joints, H v̇ = v̇ for held joints and H ż = ż, H ∂v̇/∂x is
        the derivative of the residual torque of a given acceleration.

        Returns:
            CasADi function (x, u, p, x') -> H ∂g/∂q, H ∂g/∂w, H, sparse; or None for short arms,
            and for arms with loops or contacts, where the Jacobian itself is as good.
        """
        if self.model.n <= DENSE_AT_MOST or not self.held_by_joints:
            return None
        n, slope = self.model.n, ca.SX.sym("slope", self.nx)
        x, u, p = (ca.SX.sym(name, self.rhs.size1_in(i)) for i, name in enumerate("xup"))
        K, _, H = self.scaled_slopes(x, u, p, slope)
        found = [ca.sparsify(part) for part in (K[:, :n], K[:, n:], H)]
        return ca.Function("jacobian", [x, u, p, slope], found, {"cse": True})

    @property
    def _symbols(self) -> tuple[Symbols, Joints]:
        """Symbols of the equations."""
        return self._mechanics().symbols, self._mechanics().joints

    @property
    def held_by_joints(self) -> bool:
        """Whether the arm is held by its joints alone: no loops, no contacts."""
        touches = self.model.scene.contacts and not self.moving
        return not (self.model.scene.bilateral or touches)

    def scaled_slopes(
        self, x: ca.SX, u: ca.SX, p: ca.SX, slope: ca.SX
    ) -> tuple[ca.SX, ca.SX, ca.SX]:
        """H ∂g/∂x, H ∂g/∂u and H of an arm that only its joints hold, see ``scaled_jacobian``.

        With contacts, at constant contact forces, less the derivatives of their torques.

        Args:
            x: State, shape (nx,).
            u: Effective command, shape (n,).
            p: Tunable quantities and modes.
            slope: The derivative x' there.
        """
        n, (s, joints) = self.model.n, self._symbols
        tree, (q, v, z) = s.tree, split(x, n)
        by_q, by_v, M = inverse_derivatives(tree, s.q, s.v, s.tau, s.gravity)
        inertial = ca.Function("inertial", [s.q, s.v, s.tau, joints.p], [by_q, by_v, M])
        by_q, by_v, M = inertial(q, v, slope[n : 2 * n], p)
        free, left = self._free_and_load(x, u, p)
        inertial_by_x = ca.horzcat(by_q, by_v, ca.SX(n, z.shape[0]))
        rows = ca.sparsify(free @ (ca.jacobian(left, x) - inertial_by_x))
        rates = self.rhs(x, u, p)[2 * n :]
        K_x = ca.vertcat(rows, ca.jacobian(rates, x))
        K_u = ca.vertcat(ca.sparsify(free @ ca.jacobian(left, u)), ca.jacobian(rates, u))
        H = ca.diagcat(free @ M @ free + ca.SX.eye(n) - free, ca.SX.eye(z.shape[0]))
        return K_x, K_u, H

    def contact_slopes(self, x: ca.SX, u: ca.SX, p: ca.SX, slope: ca.SX) -> tuple[ca.SX, ...]:
        """Derivatives of the contacts' forces and accelerations, see ``ContactFunctions.slopes``.

        Args: as of ``scaled_slopes``.
        """
        n = self.model.n
        q, v, z = split(x, n)
        tau = u
        if self._moded:
            tau = _with_modes(self._moded, self._symbols[1], p, q, v, z, u)[0]
        force = self.events["loads"](x, u, p)[1]
        contact = self._mechanics().contact
        assert contact is not None
        found = contact.slopes()(q, v, tau, p, slope[n : 2 * n], force)
        return tuple(found)

    def residual(self, x: ca.SX, u: ca.SX, p: ca.SX, a: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Residual torque of accelerations ``a`` of free joints, and H of ``scaled_jacobian``.

        The residual is zero at the accelerations of the motion, and H is its derivative by them up
        to the sign; for arms held by their joints alone. Shapes (n,) and (n, n).
        """
        n, (s, joints) = self.model.n, self._symbols
        q, v, _ = split(x, n)
        tau = inverse(s.tree, s.q, s.v, s.tau, s.gravity)
        needs = [tau, mass_matrix(s.tree, s.q)]
        needed, M = ca.Function("needs", [s.q, s.v, s.tau, joints.p], needs)(q, v, a, p)
        free, left = self._free_and_load(x, u, p)
        return free @ (left - needed), free @ M @ free + ca.SX.eye(n) - free

    def _free_and_load(self, x: ca.SX, u: ca.SX, p: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Diagonal with ones for free joints, and the load on them besides inertia."""
        n, (s, joints) = self.model.n, self._symbols
        q, v, z = split(x, n)
        tau = _with_modes(self._moded, joints, p, q, v, z, u)[0] if self._moded else u
        load = s.tau - s.passive - joints.friction + joints.stop
        left = ca.Function("load", [s.q, s.v, s.tau, joints.p], [load])(q, v, tau, p)
        free = ca.Function("free", [joints.p], [ca.diag(joints.sliding)])(p)
        return free, left

    @property
    def strike(self) -> ca.Function:
        """CasADi function of an impact in a scene with events.

        ((q, v), p, velocity changes of held joints, impulses of contacts) -> velocities after it
        and the impulses on the held joints.
        """
        return self._mechanics().strike

    @cached_property
    def closure(self) -> Closure:
        """States that satisfy the bilateral constraints; for one thread only."""
        return Closure(self.model, self.model.stops)

    @cached_property
    def points(self) -> tuple[ContactPoint, ...]:
        """The contacts."""
        return tuple(contact_points(self.model))

    @property
    def nz(self) -> int:
        """Number of internal states."""
        return len(self.laws.names) if self.laws else 0

    @property
    def nx(self) -> int:
        """Length of the state."""
        return 2 * self.model.n + self.nz

    @property
    def scale(self) -> Array:
        """Scale of each entry of the state for error control, shape (nx,)."""
        z = self.laws.scale if self.laws else np.zeros(0)
        return np.concatenate([np.ones(2 * self.model.n), z])

    def initial(self, q: Array, v: Array) -> Array:
        """Initial internal states at q, v, shape (nz,)."""
        return self.laws.initial(q, v) if self.laws else np.zeros(0)

    def joint_torque(self, x: Array, u: Array) -> Array:
        """Torque of the drives on the joints in [N m] or [N]: the command, or that of a model.

        Args:
            x: State, shape (nx,) or (k, nx).
            u: Effective command, shape (n,) or (k, n).

        Returns:
            Torques of the shape of ``u``.
        """
        if self.torques is None or not u.size:
            return u
        torque: Array = np.array(self.torques(x.T, u.T)[0]).T
        return torque.reshape(u.shape)


def _composed(
    mechanics: Callable[[], Mechanics], laws: Ensemble | None, powers: Sequence[Power]
) -> tuple[ca.Function, dict[str, ca.Function]]:
    """``rhs`` and ``events`` of an arm with internal states, and powers as additional states.

    The last of them is the energy taken by contact friction and compliant stops.
    """
    arm = mechanics()
    powers = [*powers, arm.taken] if powers else ()
    a, n = arm.acceleration, arm.symbols.q.shape[0]
    rhs = _of_state(a, arm.joints, laws, n, powers, "rhs")
    of_state = (
        _of_state(function, arm.joints, laws, n, powers if function.name() == "loads" else None)
        for function in arm.loads
    )
    geometry = (arm.contact.geometry, arm.contact.close) if arm.contact else ()
    switches = (_switches(arm, laws),) if arm.joints.switches.numel() else ()
    events = (*of_state, *arm.of_joints, *switches, *geometry)
    return rhs, {function.name(): function for function in events}


def _with_modes(
    laws: Ensemble, joints: Joints, p: ca.SX, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX
) -> list[ca.SX]:
    """The parts of ``Flow`` under the modes in p."""
    flow = laws.equations(q, v, z, u)
    parts = [flow.torque, flow.slope, *(ca.SX(x) for x in (flow.stored, flow.supplied, flow.lost))]
    if not joints.switches.numel():
        return parts
    modes = ca.Function("modes", [joints.p], [joints.switches])(p)
    found: list[ca.SX] = ca.substitute(parts, [joints.switches], [modes])
    return found


def _switches(arm: Mechanics, laws: Ensemble | None) -> ca.Function:
    """Switching functions of cords and drives, in the order of their modes in p."""
    s = arm.symbols
    x, u, p = _symbols(arm.acceleration, 2 * arm.symbols.q.shape[0] + _states(laws), s.q.shape[0])
    q, v, z = split(x, s.q.shape[0])
    values, sizes = [ca.SX(0, 1)], [ca.SX(0, 1)]
    if s.cords:
        found = ca.Function("cords", [s.q, s.v, s.p], [s.cords.values, s.cords.sizes])
        for column, part in zip((values, sizes), found(q, v, p[: s.p.numel()]), strict=True):
            column.append(part)
    for drive, own in laws.parts(z) if laws else ():
        if isinstance(drive, SwitchedLaw):
            for column, part in zip((values, sizes), drive.switches(q, v, own, u), strict=True):
                column.append(part)
    return dense_function("switches", [x, u, p], ca.vertcat(*values), ca.vertcat(*sizes))


def split(x: ca.SX, n: int) -> tuple[ca.SX, ca.SX, ca.SX]:
    """q, v and z of a state."""
    return x[:n], x[n : 2 * n], x[2 * n :]


def _of_state(
    function: ca.Function, joints: Joints, laws: Ensemble | None, n: int,
    powers: Sequence[Power] | None = None, name: str = "",
) -> ca.Function:  # fmt: skip
    """A function of (x, u, p) from one of (q, v, tau, p).

    With ``powers`` its last result is q̈ and becomes x', with the powers as further states.
    """
    x, u, p = _symbols(function, 2 * n + _states(laws), n)
    q, v, z = split(x, n)
    tau, slope, *_ = _with_modes(laws, joints, p, q, v, z, u) if laws else (u, ca.SX(0, 1))
    found = function.call([q, v, tau, p])
    if powers is not None:
        more = [power(q, v, tau, p) for power in powers]
        found[-1] = ca.vertcat(v, found[-1], slope, *more)
    return dense_function(name or function.name(), [x, u, p], *found)


def _states(laws: Ensemble | None) -> int:
    return len(laws.names) if laws else 0


def _torques(laws: Ensemble) -> ca.Function:
    """Function (x, u) -> torques of the drives, and of all models, on the links."""
    x, u = ca.SX.sym("x", 2 * laws.n + len(laws.names)), ca.SX.sym("u", laws.n)
    q, v, z = split(x, laws.n)
    both = laws.drive(q, v, z, u), laws.equations(q, v, z, u).torque
    return dense_function("torques", [x, u], *both)


def _symbols(function: ca.Function, nx: int, n: int) -> tuple[ca.SX, ca.SX, ca.SX]:
    return ca.SX.sym("x", nx), ca.SX.sym("u", n), ca.SX.sym("p", function.size1_in(3))
