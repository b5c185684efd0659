# SPDX-License-Identifier: Apache-2.0
"""The scene's equation of motion as one function x' = f(x, u, p).

It contains only the terms that the scene has.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.actuation.internal_state import Ensemble
from arm_dynamics.actuation.joint_laws import laws_of
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.one_at_a_time import built_once, one_at_a_time
from arm_dynamics.equations import contact
from arm_dynamics.equations.contact import ContactPoint
from arm_dynamics.model.loops.loop_closure import Closure
from arm_dynamics.model.tree_builder import contact_points, tree_of
from arm_sim.plant.energy_flows import EnergyFlows, dissipated_power, external_power
from arm_sim.plant.mechanics import Mechanics
from arm_sim.plant.options import SCENE, Options
from arm_sim.plant.parameters import Parameters
from arm_sim.plant.state_space import StateSpace, split
from arm_sim.plant.switches import SwitchedDrives
from arm_sim.plant.symbols import Layout, Symbols, dense_function, has_cords, mode_counts


class Plant:
    """Equation of motion of one scene.

    With dry friction, stops, cords, or drives with limits or backlash, the equation depends on
    modes, which follow the tunable quantities in p: first a direction for each joint, -1 or 1 for
    sliding, 0 for sticking or being held by a rigid stop; then the joints in contact with
    compliant stops; then the case distinctions of cords and drives; last the modes of the
    contacts.

    Equations are built on first use: if their compiled code is cached, they are not needed. They
    are built by one thread at a time, since CasADi is not safe for more.

    Attributes:
        model: The robot.
        options: What the equations contain.
        parameters: Tunable quantities.
        laws: Drives and friction with internal states z; may be none.
        constrained: Whether there are bilateral constraints.
        has_sliding_modes: Whether there is dry friction or contact, so that the equations with the
            option ``sliding`` are simpler.
        eventful: Whether joints may stick or meet stops, points touch, or drives and cords switch.
    """

    @one_at_a_time
    def __init__(
        self,
        model: ArmModel,
        options: Options = SCENE,
        variants: dict[Options, Plant] | None = None,
    ) -> None:
        """Prepare the equations.

        Args:
            model: The robot.
            options: What the equations contain.
            variants: Plants of the same scene, by their options.
        """
        self.model, self.options = model, options
        self._variants = {} if variants is None else variants
        self.parameters = Parameters(model)
        laws = laws_of(model) if options.drives else ()
        self.laws = EnergyFlows(laws, model.n) if options.energies else Ensemble(laws, model.n)
        # Variants that differ in other options than stops share symbols and drives with the plant
        # of the scene, so that entries of p mean the same in all of them.
        of_scene = Options(stops=options.stops)
        self._scene_plant = shared = self if options == of_scene else self._variant_of(of_scene)
        self._drives: SwitchedDrives | None = None  # away from stops drives do not switch
        if options.stops:
            arguments = laws, model.n, model.friction.gears
            self._drives = SwitchedDrives(*arguments) if shared is self else shared._drives
        self.constrained = bool(model.scene.bilateral)
        self.has_sliding_modes = model.has_dry_friction or bool(model.scene.contacts)
        events = (
            any(mode_counts(model, options.stops)) or model.scene.contacts or self._has_switches
        )
        self.eventful = bool(events) and not options.regularization
        self._variants[options] = self  # last: one that fails is none

    @one_at_a_time
    def variant(self, **options: Any) -> Plant:
        """The same scene with some ``Options`` changed; there is one for all users."""
        return self._variant_of(replace(self.options, **options))

    def _variant_of(self, options: Options) -> Plant:
        """The variant under these options, which is built unless there is one."""
        return self._variants.get(options) or Plant(self.model, options, self._variants)

    @cached_property
    def free(self) -> Plant | None:
        """The same arm away from its stops and without modes of cords and drives.

        None if there are always modes, or if the arm is so itself: these equations are simpler,
        with the tunable quantities alone in p.
        """
        can_leave = (self.options.stops and self.model.stops) or self._has_switches
        return self.variant(stops=False) if can_leave and not self.has_sliding_modes else None

    @built_once
    def mechanics(self) -> Mechanics:
        """The arm without drives and states, shared by variants that differ only in these."""
        if (shared := self.variant(drives=True, energies=False)) is not self:
            return shared.mechanics
        return Mechanics(self.model, self._symbols, self.options)

    @property
    def rhs(self) -> ca.Function:
        """CasADi function (x, u, p) -> x' with x = (q, v, z)."""
        return self._state_space.rhs

    @property
    def events(self) -> dict[str, ca.Function]:
        """CasADi functions evaluated at events, by name; empty where nothing sticks or touches.

        ``loads`` (x, u, p), the last of which are torques of stops and x', with bilateral
        constraints ``bilateral`` (x, u, p), with stops ``impact_map`` and ``pressures``, with
        ``Symbols.switches`` (x, u, p) their switching functions and the magnitude of the terms of
        each, with contacts ``contact_mobility`` (x, u, p), ``contact_geometry`` and
        ``contact_close``, and where parts may hold together ``statics`` (x, u, p).
        """
        return self._state_space.events if self.eventful else {}

    @built_once
    def torques(self) -> ca.Function | None:
        """CasADi function (x, u) -> torques of the drives, and of all laws together, on the links.

        None where the command acts directly.
        """
        if not self.laws:
            return None
        n, laws = self.model.n, self.laws
        x, u = ca.SX.sym("x", self.nx), ca.SX.sym("u", n)
        q, v, z = split(x, n)
        torque = laws.equations(q, v, z, u).torque
        return dense_function("torques", [x, u], laws.drive(q, v, z, u), torque)

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
        return np.array(self.torques(x.T, u.T)[0]).T.reshape(u.shape)

    @built_once
    def layout(self) -> Layout:
        """Numbers of the entries of p."""
        modes = mode_counts(self.model, self.options.stops)
        switches = self._symbols.switches.numel() if self._has_switches else 0
        return Layout(len(self.parameters.nominal), *modes, switches)

    @cached_property
    def points(self) -> tuple[ContactPoint, ...]:
        """The contacts."""
        return tuple(contact_points(self.model))

    @built_once
    def gaps(self) -> ca.Function:
        """CasADi function q -> heights of the contact points above their planes in [m]."""
        q = ca.SX.sym("q", self.model.n)
        place = contact.geometry(tree_of(self.model), list(self.points), q).place
        return ca.Function("gaps", [q], [place[::3]])

    @cached_property
    def closure(self) -> Closure:
        """States that satisfy the bilateral constraints; for one thread only."""
        return Closure(self.model, self.model.stops)

    @cached_property
    def nz(self) -> int:
        """Number of internal states."""
        return len(self.laws.names)

    @cached_property
    def nx(self) -> int:
        """Length of the state."""
        return 2 * self.model.n + self.nz

    @built_once
    def _state_space(self) -> StateSpace:
        heat, work = dissipated_power(self.model, self.parameters), external_power(self.parameters)
        flows = (heat, work, self.mechanics.power_lost) if self.options.energies else ()
        return StateSpace(self.mechanics, self.laws, flows)

    @built_once
    def _symbols(self) -> Symbols:
        if self._scene_plant is not self:
            return self._scene_plant._symbols
        return Symbols(self.model, self.parameters, self._drives)

    @property
    def _has_switches(self) -> bool:
        """Whether there are modes of cords and drives."""
        drives = self._drives
        return drives is not None and (has_cords(self.model) or drives.modes.numel() > 0)


@one_at_a_time
def slope_of_loads(plant: Plant) -> ca.Function:
    """``Plant.rhs`` for code that contains ``loads``: it calls that, where there is one."""
    if (loads := plant.events.get("loads")) is None:
        return plant.rhs
    arguments = [ca.MX.sym(name, loads.size1_in(i)) for i, name in enumerate("xup")]
    return ca.Function("rhs", arguments, loads.call(arguments)[-1:])
