# SPDX-License-Identifier: Apache-2.0
"""Case distinctions of drives and cords as modes: an equation is smooth while they last.

A drive at its current limit, a transmission in its backlash, a slack cord: the equations choose
between cases by comparing two expressions. Here each comparison becomes a number in p, 1 where it
holds and 0 where it does not, and its switching function, which the engine watches like any other
guard. The equations themselves are written once, with their comparisons: these are found in the
expression graph. The friction of a gear that loses power depends on the sign of the drive's
torque, which is a mode where it may change within a tick.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.actuation.internal_state import Ensemble, Flow, StatefulLaw
from arm_dynamics.arrays import Array

# Operations that choose, with the sign of a - b, or zero, where they choose ``a`` or hold; a < b,
# which excludes zero, where it does not hold.
_COMPARED = {ca.OP_LT: 1.0, ca.OP_LE: -1.0, ca.OP_FMIN: -1.0, ca.OP_FMAX: 1.0}


@dataclass(frozen=True)
class Switches:
    """Case distinctions of some expressions.

    Attributes:
        results: The expressions, with modes in place of comparisons.
        modes: Symbols of the modes, shape (k,): 1 where a switching function is not negative.
        values: Switching functions, differences of what is compared, shape (k,); not by modes.
        sizes: Magnitude of the terms of each, whose rounding is no switch, shape (k,).
    """

    results: list[ca.SX]
    modes: ca.SX
    values: ca.SX
    sizes: ca.SX


def case_modes(results: Sequence[ca.SX], state: ca.SX) -> Switches:
    """Replace the comparisons in expressions that depend on ``state`` by modes.

    Args:
        results: Expressions.
        state: Symbols of the state that may change during a tick.
    """
    of_state = {symbol.element_hash() for symbol in ca.vertsplit(state)}
    symbols = ca.symvar(ca.veccat(*results))
    constant = ca.vertcat(*(s for s in symbols if s.element_hash() not in of_state))
    function = ca.Function("f", [state, constant], list(results), {"cse": True})
    plain, moded = _Graph(function, state, constant), _Graph(function, state, constant)
    modes, values, sizes = list[ca.SX](), list[ca.SX](), list[ca.SX]()
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        plain.run(k)
        moded.run(k)
        if operation not in _COMPARED or not plain.varies:
            continue
        a, b = plain.operands
        if ca.is_equal(b, -a, 1):  # an absolute value, which has powers: it must stay positive
            continue
        holds = ca.SX.sym(f"holds{len(modes)}")
        modes.append(holds)
        values.append(_COMPARED[operation] * (a - b))
        sizes.append(ca.fabs(a) + ca.fabs(b))
        if operation in (ca.OP_FMIN, ca.OP_FMAX):
            a, b = moded.operands
            moded.put(k, holds * a + (1.0 - holds) * b)
        else:
            moded.put(k, 1.0 - holds if operation == ca.OP_LT else holds)
    columns = (ca.vertcat(ca.SX(0, 1), *parts) for parts in (modes, values, sizes))
    return Switches(moded.outputs, *columns)


class _Graph:
    """Evaluation of a function's instructions, one after the other, as expressions.

    Attributes:
        operands: Those of the operation that was evaluated last.
        varies: Whether it depends on the state.
        outputs: Expressions of the results.
    """

    def __init__(self, function: ca.Function, *arguments: ca.SX) -> None:
        self._function, self._arguments = function, arguments
        self._work = [ca.SX(0.0)] * function.sz_w()
        self._varies = np.zeros(function.sz_w(), dtype=bool)
        self.operands, self.varies = list[ca.SX](), False
        self.outputs = [ca.SX(*function.size_out(i)) for i in range(function.n_out())]

    def run(self, k: int) -> None:
        """Evaluate the next instruction, number k."""
        f = self._function
        operation, outputs = f.instruction_id(k), f.instruction_output(k)
        inputs = f.instruction_input(k)
        if operation == ca.OP_CONST:
            self._set(outputs[0], ca.SX(f.instruction_constant(k)), varies=False)
        elif operation == ca.OP_INPUT:
            argument, element = inputs
            self._set(outputs[0], self._arguments[argument].nz[element], varies=argument == 0)
        elif operation == ca.OP_OUTPUT:
            result, element = outputs
            row, column = f.sparsity_out(result).get_triplet()
            self.outputs[result][row[element], column[element]] = self._work[inputs[0]]
        else:
            self.operands = [self._work[i] for i in inputs]
            self.varies = any(self._varies[i] for i in inputs)
            apply = ca.SX.binary if len(inputs) == 2 else ca.SX.unary
            self._set(outputs[0], apply(operation, *self.operands), self.varies)

    def put(self, k: int, value: ca.SX) -> None:
        """Replace the result of an instruction."""
        self._work[self._function.instruction_output(k)[0]] = value

    def _set(self, place: int, value: ca.SX, varies: bool) -> None:
        self._work[place], self._varies[place] = value, varies


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
        joints: Index of the joint of each.
        forward: Those of the signs of torques that depend on the state, by joint.
    """

    def __init__(self, law: StatefulLaw, n: int, gears: Sequence[int] = ()) -> None:
        self.title, self.states = law.title, law.states
        self.replaces_command: NDArray[np.bool_] = law.replaces_command
        self._law = law
        sizes = {"q": n, "v": n, "z": len(law.states), "u": n}
        q, v, z, u = (ca.SX.sym(name, size) for name, size in sizes.items())
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
        """See ``StatefulLaw``."""
        return self._law.initial(q, v)

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """See ``StatefulLaw``; in terms of ``modes``."""
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
        joints: Index of the joint of each.
        forward: See ``SwitchedLaw``.
    """

    def __init__(self, laws: Sequence[StatefulLaw], n: int, gears: Sequence[int]) -> None:
        own = (law for law in laws if law.replaces_command.any())
        self._drives = {law.title: SwitchedLaw(law, n, gears) for law in own}
        drives = self._drives.values()
        self.modes = ca.vertcat(ca.SX(0, 1), *(drive.modes for drive in drives))
        self.joints = tuple(joint for drive in drives for joint in drive.joints)
        self.forward = {i: sign for drive in drives for i, sign in drive.forward.items()}

    def within(self, laws: Ensemble) -> Ensemble:
        """Laws with these drives in place of those that compare."""
        return replace(laws, laws=tuple(self._drives.get(law.title, law) for law in laws.laws))
