# SPDX-License-Identifier: Apache-2.0
"""Derivatives of a step and of the command that acts, as functions of columns of tangents.

The coefficients of a derivative are computed once for a step; columns are then propagated through
it. The whole derivative of a tick is computed by rows, with the transposed function: there are nx
of them, and nx + n columns.
"""

from collections.abc import Sequence
from functools import partial

import casadi as ca

from arm_dynamics.codegen.one_at_a_time import built_once
from arm_sim.coefficients import Coefficients
from arm_sim.integrators.selection import Choice
from arm_sim.integrators.tangents import build_tangent
from arm_sim.plant.actuation import actuation
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import Slopes, scaled_jacobian
from arm_sim.plant.symbols import dense_function


class StepTangent:
    """The derivative of a step under some equations, in functions of columns.

    Args:
        plant: The equations.
        choice: Method and tick.
        p_indices: Indices in p of the quantities to differentiate by.
        prefix: First part of the names of the functions.
        dense: As for ``build_tangent``.

    Attributes:
        advance: CasADi function (x, u, p, h) -> x at the end, and coefficients c.
        propagate: CasADi function (c, dx, dw, dh) -> dx at the end, w being u and the quantities;
            of columns, any number.
    """

    def __init__(
        self, plant: Plant, choice: Choice, p_indices: Sequence[int], prefix: str = "",
        dense: bool = False,
    ) -> None:  # fmt: skip
        project, scaled = plant.mechanics.project, partial(scaled_jacobian, plant)
        self._n, self._prefix = plant.model.n, prefix
        self.advance, self.propagate = build_tangent(
            choice.method, plant.rhs, Slopes(plant, p_indices), self._n, project, scaled,
            p_indices, dense,
        )  # fmt: skip
        if prefix:  # functions that are compiled beside others need names of their own
            arguments = self.advance.mx_in()
            results = self.advance.call(arguments)
            self.advance = ca.Function(f"{prefix}advance", arguments, results)

    @built_once
    def jvp(self) -> ca.Function:
        """CasADi function (c, dx, dw) -> dx at the end: ``propagate`` for a constant length."""
        c, dx, dw = (ca.SX.sym(name, self.propagate.size1_in(i)) for i, name in enumerate("cxw"))
        dx_end = self.propagate(c, dx, dw, 0)
        return ca.Function(f"{self._prefix}jvp", [c, dx, dw], [dx_end], {"cse": True})

    def vjp(self, command_jvp: ca.Function) -> tuple[ca.Function, ca.Function]:
        """Transpose of a tick, that is of ``command_jvp`` and then ``jvp``.

        ``command_jvp``, of ``command_tangent``, gives the change of the command that acts, shape
        (n,), from its coefficients and changes of the state, (nx,), and of the command, (n,).

        Returns:
            Functions (coefficients of both, row λ of a derivative by the state after the tick) ->
            its product with the derivatives by the state before, the command and the quantities.
            The first takes λ of positions, shape (n,), the other that of velocities and internal
            states, (nx - n,): in an explicit method, the last stage does not change positions.
        """
        n, (c, _, dw) = self._n, self.jvp.sx_in()
        c_command, dx, dr = command_jvp.sx_in()
        row, dp = ca.SX.sym("row", dx.shape[0]), ca.SX.sym("dp", dw.shape[0] - n)
        dx_end = self.jvp(c, dx, ca.vertcat(command_jvp(c_command, dx, dr), dp))
        coefficients = ca.vertcat(c_command, c)

        def row_product(name: str, part: ca.SX, row: ca.SX) -> ca.Function:
            product = ca.densify(ca.jtimes(part, ca.vertcat(dx, dr, dp), row, True))
            arguments = [coefficients, row]
            return ca.Function(f"{self._prefix}{name}", arguments, [product], {"cse": True})

        by_q, by_rest = (
            row_product("vjp_q", dx_end[:n], row[:n]),
            row_product("vjp_rest", dx_end[n:], row[n:]),
        )
        return by_q, by_rest


def command_tangent(plant: Plant) -> tuple[ca.Function, ca.Function]:
    """(x, r) -> command that acts and coefficients c, and (c, dx, dr) -> its change."""
    act, c = actuation(plant), Coefficients()
    x, r = ca.SX.sym("x", act.size1_in(0)), ca.SX.sym("r", act.size1_in(1))
    dx, dr = ca.SX.sym("dx", x.shape[0]), ca.SX.sym("dr", r.shape[0])
    u = act(x, r)
    changes = c.substitute(ca.jacobian(u, x)) @ dx + c.substitute(ca.jacobian(u, r)) @ dr
    acting = ca.Function("acting", [x, r], [u, c.values], {"cse": True})
    return acting, dense_function("command_jvp", [c.symbols, dx, dr], changes)
