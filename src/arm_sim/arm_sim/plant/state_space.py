# SPDX-License-Identifier: Apache-2.0
"""State-space form x' = f(x, u, p) of an arm, with states x = (q, v, z).

Energies that flow into and out of the arm may be additional states.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.actuation.internal_state import Ensemble, Flow
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_dynamics.equations import spring
from arm_dynamics.model.tree_builder import tree_of
from arm_sim.plant.mechanics import Mechanics
from arm_sim.plant.parameters import Parameters
from arm_sim.plant.switches import SwitchedLaw
from arm_sim.plant.symbols import dense_function

FLOWS = (
    "work supplied [J]", "heat lost [J]", "heat of friction [J]", "external work [J]",
    "lost in contacts [J]",
)  # fmt: skip
"""Energies that a repeated tick integrates."""

Power = Callable[[ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]
"""Function (q, v, tau, p) -> power in [W]."""


@dataclass(frozen=True)
class EnergyFlows(Ensemble):
    """The models of a scene with energy flows as additional states, which come last.

    They are the work supplied to the models and the heat dissipated in them, and those of
    ``dissipated_and_external_power`` and ``Mechanics.power_lost``: heat of the joints' friction
    and of dampers, external work, and losses in friction of contacts and in compliant stops.
    Impacts are not included.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """The internal states, and the energies."""
        return (*super().names, *FLOWS)

    @property
    def scale(self) -> Array:
        """Scale of each entry of the state, shape (2n + nz + 5,)."""
        return np.concatenate([super().scale, np.ones(len(FLOWS))])

    def initial(self, q: Array, v: Array) -> Array:
        """The internal states, and energies of zero."""
        return np.concatenate([super().initial(q, v), np.zeros(len(FLOWS))])

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """Equations of the models, and their powers as rates of the first two energies."""
        flow = super().equations(q, v, z, u)
        return Flow(flow.torque, ca.vertcat(flow.slope, flow.supplied, flow.lost))


class StateSpace:
    """Functions of (x, u, p) of an arm with the models of its drives and friction.

    Args:
        mechanics: The arm.
        laws: The models; their states are z.
        powers: Powers that additional states integrate, the last ones of z.
    """

    def __init__(self, mechanics: Mechanics, laws: Ensemble, powers: Sequence[Power]) -> None:
        self._mechanics, self._powers = mechanics, powers
        self._laws, self._n = under_modes(laws, mechanics), laws.n
        self._nx = 2 * laws.n + len(laws.names)

    @built_once
    def rhs(self) -> ca.Function:
        """``rhs`` (x, u, p) -> x'."""
        return self._of_state(self._mechanics.acceleration, "rhs", appends_rates=True)

    @built_once
    def events(self) -> dict[str, ca.Function]:
        """See ``Plant.events``."""
        arm, contact = self._mechanics, self._mechanics.contact
        functions = [
            *(self._of_state(f, f.name(), appends_rates=f.name() == "loads") for f in arm.loads),
            *arm.of_joints,
            *([self._switches()] if arm.joints.switches.numel() else []),
            *([contact.geometry, contact.close] if contact else []),
        ]
        return {function.name(): function for function in functions}

    def _arguments(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        size_of_p = self._mechanics.joints.p.numel()
        return ca.SX.sym("x", self._nx), ca.SX.sym("u", self._n), ca.SX.sym("p", size_of_p)

    def _of_state(self, function: ca.Function, name: str, *, appends_rates: bool) -> ca.Function:
        """A function of (x, u, p) from one of (q, v, tau, p), with x' in place of a final q̈."""
        x, u, p = self._arguments()
        q, v, z = split(x, self._n)
        tau, rates = flow_under_modes(self._laws, self._mechanics, q, v, z, u, p)
        results = function.call([q, v, tau, p])
        if appends_rates:
            flows = [power(q, v, tau, p) for power in self._powers]
            results[-1] = ca.vertcat(v, results[-1], rates, *flows)
        return dense_function(name, [x, u, p], *results)

    def _switches(self) -> ca.Function:
        """Switching functions of cords and drives, in the order of their modes in p."""
        x, u, p = self._arguments()
        s, (q, v, z) = self._mechanics.symbols, split(x, self._n)
        pairs = list[Sequence[ca.SX]]()
        if s.cords:
            cords = ca.Function("cords", [s.q, s.v, s.p], [s.cords.values, s.cords.sizes])
            pairs.append(cords(q, v, p[: s.p.numel()]))
        for drive, own in self._laws.parts(z):
            if isinstance(drive, SwitchedLaw):
                pairs.append(drive.switches(q, v, own, u))
        columns = (ca.vertcat(ca.SX(0, 1), *parts) for parts in zip(*pairs, strict=True))
        return dense_function("switches", [x, u, p], *columns)


def split(x: ca.SX, n: int) -> tuple[ca.SX, ca.SX, ca.SX]:
    """q, v and z of a state."""
    return x[:n], x[n : 2 * n], x[2 * n :]


def under_modes(laws: Ensemble, mechanics: Mechanics) -> Ensemble:
    """The laws with modes in place of the comparisons of drives."""
    drives = mechanics.symbols.drives
    return drives.within(laws) if drives else laws


def flow_under_modes(
    laws: Ensemble, mechanics: Mechanics, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX, p: ca.SX
) -> list[ca.SX]:
    """Torque on the joints, and derivatives of z, under the modes in p.

    ``laws``: those of ``under_modes``.
    """
    joints, flow = mechanics.joints, laws.equations(q, v, z, u)
    parts = [flow.torque, flow.slope]
    if not joints.switches.numel():
        return parts
    modes = ca.Function("modes", [joints.p], [joints.switches])(p)
    return list(ca.substitute(parts, [joints.switches], [modes]))


def dissipated_and_external_power(model: ArmModel, parameters: Parameters) -> tuple[Power, Power]:
    """Power lost in friction and dampers without states, and that of external torques."""
    tree = tree_of(model)
    viscous, dry, pushed = map(parameters.place, ("friction", "coulomb", "external"))

    def friction_heat(q: ca.SX, v: ca.SX, tau: ca.SX, p: ca.SX) -> ca.SX:
        law = model.friction if dry is None else model.friction.scaled(p[dry])
        torque = law.smooth(v, q, None if viscous is None else p[viscous])
        if law.has_dry:
            torque = torque + law.dry(v, ca.sign(v), q, tau)
        return ca.dot(torque, v) + spring.heat(model.springs, tree, q, v)

    def outside_work(q: ca.SX, v: ca.SX, tau: ca.SX, p: ca.SX) -> ca.SX:
        return ca.SX(1, 1) if pushed is None else ca.dot(p[pushed], v)

    return friction_heat, outside_work
