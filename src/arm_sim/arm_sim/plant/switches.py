# SPDX-License-Identifier: Apache-2.0
"""Drives whose case distinctions are modes: an equation is smooth while they last.

A drive at its current limit, a transmission in its backlash, a slack cord: the equations choose
between cases by comparing two expressions. Here each comparison becomes a number in p, 1 where it
holds and 0 where it does not, and its switching function, which the engine watches like any other
guard, see ``case_modes``. The friction of a gear that loses power depends on the sign of the
drive's torque, which is a mode where it may change within a tick.
"""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.actuation.internal_state import Ensemble, Flow, StatefulLaw
from arm_dynamics.arrays import Array
from arm_sim.case_modes import case_modes


def _magnitude(value: ca.SX) -> ca.SX:
    """Sum of the sizes of the terms of a number, whose rounding is no change of its sign."""
    parts = [value.dep(k) for k in range(value.n_dep())]
    if value.is_op(ca.OP_ADD) or value.is_op(ca.OP_SUB):
        return _magnitude(parts[0]) + _magnitude(parts[1])
    if value.is_op(ca.OP_MUL):
        return _magnitude(parts[0]) * _magnitude(parts[1])
    return ca.fabs(value)


class SwitchedLaw:
    """A law whose case distinctions are modes; see ``StatefulLaw``.

    Args:
        law: A law that replaces commands.
        n: Degrees of freedom.
        gears: Joints whose gear loses power.

    Attributes:
        modes: Symbols of the modes, in the expressions of ``equations``.
        joints: Index of the joint of each mode.
        forward: Modes of the signs of torques that depend on the state, by joint.
    """

    def __init__(self, law: StatefulLaw, n: int, gears: Sequence[int] = ()) -> None:
        self.title, self.states = law.title, law.states
        self.replaces_command: NDArray[np.bool_] = law.replaces_command
        self._law = law
        lengths = {"q": n, "v": n, "z": len(law.states), "u": n}
        q, v, z, u = (ca.SX.sym(name, length) for name, length in lengths.items())
        flow = law.equations(q, v, z, u)
        parts = [flow.torque, flow.slope, *map(ca.SX, (flow.stored, flow.supplied, flow.lost))]
        x, torque = ca.vertcat(q, v, z), ca.densify(flow.torque)
        cases = case_modes([ca.densify(part) for part in parts], x)
        turning = [i for i in gears if ca.depends_on(torque[i], x)]
        self.forward = {i: ca.SX.sym(f"forward{i}") for i in turning}
        self.modes = ca.vertcat(cases.modes, *self.forward.values())
        self._flow = ca.Function("flow", [q, v, z, u, self.modes], cases.results, {"cse": True})
        values = ca.vertcat(cases.values, *(torque[i] for i in turning))
        sizes = ca.vertcat(cases.sizes, *(_magnitude(torque[i]) for i in turning))
        self._values = ca.Function("switches", [q, v, z, u], [values, sizes])
        owners = [*range(n), *range(n), *(state.joint for state in law.states), *range(n)]
        pattern = ca.jacobian(values, ca.vertcat(x, u)).sparsity()
        owner = {row: owners[column] for row, column in zip(*pattern.get_triplet(), strict=True)}
        self.joints = tuple(owner[k] for k in range(self.modes.numel()))

    def initial(self, q: Array, v: Array) -> Array:
        """Initial states, see ``StatefulLaw``."""
        return self._law.initial(q, v)

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """Equations in terms of ``modes``, see ``StatefulLaw``."""
        return Flow(*(ca.sparsify(part) for part in self._flow(q, v, z, u, self.modes)))

    def switches(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Switching functions and their magnitudes."""
        values, sizes = self._values(q, v, z, u)
        return values, sizes


class SwitchedDrives:
    """The drives of an arm, their case distinctions as modes.

    Args:
        laws: All laws of the scene.
        n: Degrees of freedom.
        gears: Joints whose gear loses power.

    Attributes:
        modes: Symbols of all modes.
        joints: Index of the joint of each mode.
        forward: See ``SwitchedLaw``.
    """

    def __init__(self, laws: Sequence[StatefulLaw], n: int, gears: Sequence[int]) -> None:
        switched = (law for law in laws if law.replaces_command.any())
        self._drives = {law.title: SwitchedLaw(law, n, gears) for law in switched}
        drives = self._drives.values()
        self.modes = ca.vertcat(ca.SX(0, 1), *(drive.modes for drive in drives))
        self.joints = tuple(joint for drive in drives for joint in drive.joints)
        self.forward = {i: sign for drive in drives for i, sign in drive.forward.items()}

    def replace_in(self, laws: Ensemble) -> Ensemble:
        """Laws with these drives in place of those that compare."""
        return replace(laws, laws=tuple(self._drives.get(law.title, law) for law in laws.laws))
