# SPDX-License-Identifier: Apache-2.0
"""State-space form x' = f(x, u, p) of an arm, with states x = (q, v, z)."""

from collections.abc import Sequence

import casadi as ca

from arm_dynamics.actuation.internal_state import Ensemble
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_sim.plant.energy_flows import Power
from arm_sim.plant.mechanics import Mechanics
from arm_sim.plant.switches import SwitchedLaw
from arm_sim.plant.symbols import dense_function


class StateSpace:
    """Functions of (x, u, p) of an arm with the models of its drives and friction.

    Args:
        mechanics: The arm.
        laws: The models; their states are z.
        powers: Powers that additional states integrate, the last ones of z.
    """

    def __init__(self, mechanics: Mechanics, laws: Ensemble, powers: Sequence[Power]) -> None:
        self._mechanics, self._powers = mechanics, powers
        self._laws, self._n = laws_with_modes(laws, mechanics), laws.n
        self._nx = 2 * laws.n + len(laws.names)

    @built_once
    def rhs(self) -> ca.Function:
        """``rhs`` (x, u, p) -> x'."""
        return self._with_rates(self._mechanics.acceleration, "rhs")

    @built_once
    def events(self) -> dict[str, ca.Function]:
        """Functions for events by name, see ``Plant.events``."""
        arm, contact = self._mechanics, self._mechanics.contact
        functions = [
            # The last result of ``loads`` is q̈.
            *(
                self._with_rates(f, "loads") if f.name() == "loads" else self._of_state(f)
                for f in arm.event_functions
            ),
            *arm.stop_functions,
            *([self._switches()] if arm.joints.switches.numel() else []),
            *([contact.geometry, contact.close] if contact else []),
        ]
        return {function.name(): function for function in functions}

    def _arguments(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        size_of_p = self._mechanics.joints.p.numel()
        return ca.SX.sym("x", self._nx), ca.SX.sym("u", self._n), ca.SX.sym("p", size_of_p)

    def _of_state(self, function: ca.Function) -> ca.Function:
        """A function of (x, u, p) from one of (q, v, tau, p)."""
        arguments, results, *_ = self._evaluate(function)
        return dense_function(function.name(), arguments, *results)

    def _with_rates(self, function: ca.Function, name: str) -> ca.Function:
        """A function of (x, u, p) likewise, with x' in place of the last result, q̈."""
        arguments, results, v, rates = self._evaluate(function)
        results[-1] = ca.vertcat(v, results[-1], rates)
        return dense_function(name, arguments, *results)

    def _evaluate(self, function: ca.Function) -> tuple[list[ca.SX], list[ca.SX], ca.SX, ca.SX]:
        """x, u and p; the results of a function of (q, v, tau, p); v, and the derivative of z."""
        x, u, p = self._arguments()
        q, v, z = split(x, self._n)
        tau, rates = flow_with_modes(self._laws, self._mechanics, q, v, z, u, p)
        flows = [power(q, v, tau, p) for power in self._powers]
        return [x, u, p], function.call([q, v, tau, p]), v, ca.vertcat(rates, *flows)

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


def laws_with_modes(laws: Ensemble, mechanics: Mechanics) -> Ensemble:
    """The laws with modes in place of the comparisons of drives."""
    drives = mechanics.symbols.drives
    return drives.replace_in(laws) if drives else laws


def flow_with_modes(
    laws: Ensemble, mechanics: Mechanics, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX, p: ca.SX
) -> list[ca.SX]:
    """Torque on the joints, and derivatives of z, under the modes in p.

    ``laws``: those of ``laws_with_modes``.
    """
    joints, flow = mechanics.joints, laws.equations(q, v, z, u)
    parts = [flow.torque, flow.slope]
    if not joints.switches.numel():
        return parts
    modes = ca.Function("modes", [joints.p], [joints.switches])(p)
    return list(ca.substitute(parts, [joints.switches], [modes]))
