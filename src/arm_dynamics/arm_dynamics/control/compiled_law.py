# SPDX-License-Identifier: Apache-2.0
"""Controllers as native code: for Python, and for loops that run in C.

A formula of expressions becomes code for an arm, in which gains are inputs: other gains need no
other code.
"""

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any
from weakref import WeakKeyDictionary

import casadi as ca
import numpy as np

from arm_dynamics.actuation.command_map import CommandMap
from arm_dynamics.arrays import Array, all_finite
from arm_dynamics.attributes import sealed
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.kernel import Call, Kernel
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.control.controller import ArmState, Measured, added_torques, checked, restart
from arm_dynamics.control.law import Law, law_of, name_of
from arm_dynamics.exceptions import ControllerFailed, KernelError
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.rigid_expressions import RigidExpressions
from arm_dynamics.terms.verify import compare, random_states
from arm_dynamics.trajectory.reference import Reference

Preparation = Callable[[], object]
_NAME = "control_law"
_FALLBACK = "%s; the controller continues without compiled code, which is slower"
_kernels: WeakKeyDictionary[ArmModel, dict[tuple[Any, ...], Kernel | None]] = WeakKeyDictionary()
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class CompiledLaw:
    """A controller as a compiled function that returns the same bits.

    Attributes:
        call: Takes q, v and the reference's q, v, a and tau in one array of shape (6n,), tuning,
            and memory; returns torques of shape (n,), and memory for the next call. It is that
            of the controller itself: only one of both may run at a time, and who runs it copies
            the memory from its results to its inputs if the torques are used.
        limit: Limits at which the controller cuts torques in [N m] or [N], shape (n,); None if it
            cuts none.
    """

    call: Call
    limit: Array | None = None


def compiled_law(control: object) -> CompiledLaw | None:
    """Return a controller as a compiled function; None if it is not available."""
    compiled = getattr(control, "compiled", None)
    return None if compiled is None else compiled()


@sealed
class Compiled:
    """A controller, compiled for the arm.

    It is built for a model with the first torque, unless ``build`` has done so. If it cannot be
    built, or differs from the controller, the latter is used, and that is logged.
    """

    def __init__(self, law: Law, model: ArmModel) -> None:
        """Take a controller and the model of its arm."""
        self.law, self.model = law, model
        self._still = np.zeros(model.n)

    def torque(self, state: ArmState, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,); see the controller's own."""
        if (call := self._call) is None or reference is None:
            return self.law.torque(state, reference)
        q, v = checked(state, self.model.n, reference)
        if (added := added_torques(reference, self.model.n)) is None:
            added = self._still
        (motion, _, memory), (tau, next_memory) = call.inputs, call.outputs
        np.concatenate((q, v, reference.q, reference.v, reference.a, added), out=motion)
        call.run()
        if all_finite(tau):
            memory[:] = next_memory
            return tau.copy()
        self.law.memory = _parts(np, memory, self.law.memory)
        tau_in_numbers = self.law.torque(state, reference)
        memory[:] = _flat(self.law.memory)
        return tau_in_numbers

    def compiled(self) -> CompiledLaw | None:
        """Return the controller as a compiled function; None without a compiler."""
        call = self._call
        return None if call is None or call.entry is None else CompiledLaw(call)

    def _kernel(self) -> Kernel | None:
        return build(self.law, self.model)

    @cached_property
    def _call(self) -> Call | None:
        if (kernel := self._kernel()) is None:
            return None
        call = kernel.call(_NAME)
        _, tuning, memory = call.inputs
        tuning[:], memory[:] = _flat(self.law.tuning), _flat(self.law.memory)
        return call


class CompiledWithMemory(Compiled):
    """A controller with memory, compiled for the arm."""

    def __init__(self, law: Law, model: ArmModel) -> None:
        """Take a controller that has not been used, and the model of its arm."""
        super().__init__(law, model)
        self._start = law.memory
        law.memory = self._initial_memory()

    def restart(self) -> None:
        """Reset the memory."""
        self.law.memory = self._initial_memory()
        restart(self.law)
        if self._call is not None:
            _, _, memory = self._call.inputs
            memory[:] = _flat(self.law.memory)

    def _initial_memory(self) -> tuple[Array, ...]:
        """The memory at the start, in arrays of its own: a formula may change them in place."""
        return tuple(part.copy() for part in self._start)


class CompiledUserLaw(CompiledWithMemory):
    """A user-defined controller, compiled for the arm.

    It may fail, and is used again after a restart. Its class shares code by a key of the user's,
    which may be incomplete, so each controller is compared with the code.
    """

    def _kernel(self) -> Kernel | None:
        kernel = super()._kernel()
        return kernel if kernel is not None and _agrees(kernel, self.law, self.model) else None


def with_code(control: Any, model: ArmModel, *, is_user_defined: bool = False) -> Any:
    """The controller, compiled if it can be.

    Args:
        control: The controller.
        model: The model of its arm.
        is_user_defined: Whether it is a user's, or a wrapper of one.
    """
    if (law := law_of(control)) is None:
        return control
    if is_user_defined:
        return CompiledUserLaw(law, model)
    return (CompiledWithMemory if law.memory else Compiled)(law, model)


def preparation(control: object) -> Preparation | None:
    """The lengthy preparation of a controller's first torque; None if it is done.

    Args:
        control: A controller of ``make_controller``.
    """
    if not isinstance(control, Compiled):
        return None
    law, model = control.law, control.model
    return None if law.key in _kernels.get(model, {}) else partial(build, law, model)


def build(law: Law, model: ArmModel) -> Kernel | None:
    """The kernel, built once for a model; None if it cannot be built, or is wrong."""
    kernels, key = _kernels.setdefault(model, {}), law.key
    if key is None:
        return None
    if key not in kernels:
        kernels[key] = _compiled(law, model) if compiler.may_build() else None
    return kernels[key]


@one_at_a_time
def _compiled(law: Law, model: ArmModel) -> Kernel | None:
    _log.info("building %s of %d joints", name_of(law), model.n)
    try:
        kernel = Kernel([expression(law, model)], "native")
    except (KernelError, OSError) as error:
        _log.warning(_FALLBACK, error)
        return None
    return kernel if _agrees(kernel, law, model) else None


def _agrees(kernel: Kernel, law: Law, model: ArmModel) -> bool:
    """Whether code and controller agree; what differs is logged."""
    memory_before = law.memory
    try:
        pairs = list(_pairs(kernel.call(_NAME), law, model))
        law.memory = memory_before
        if not pairs:
            raise KernelError(f"{name_of(law)} is singular wherever it was compared")
        by_code, expected = np.swapaxes(pairs, 0, 1)
        sizes = np.maximum(abs(expected), 1.0)
        compare(name_of(law), (by_code - expected, sizes), source="the controller's torque")
    except (ControllerFailed, KernelError) as error:
        hint = " (what changes its formula belongs in tuning or key)"
        _log.warning(_FALLBACK, f"{error}{hint if isinstance(error, KernelError) else ''}")
        law.memory = memory_before
        restart(law)  # one that failed in a posture of the comparison has not failed on the arm
        return False
    return True


def expression(law: Law, model: ArmModel) -> ca.Function:
    """A controller as the CasADi function of ``CompiledLaw.call``."""
    motion = ca.SX.sym("moving", 6 * model.n)
    tuning, memory = (
        ca.SX.sym(name, _flat(parts).size)
        for name, parts in (("tuning", law.tuning), ("memory", law.memory))
    )
    q, v, *desired = ca.vertsplit(motion, model.n)
    tau, after = law.formula(
        RigidExpressions(model), q, v, Reference(*desired),
        _parts(ca, tuning, law.tuning), _parts(ca, memory, law.memory),
    )  # fmt: skip
    results = [ca.densify(tau), ca.densify(ca.vertcat(ca.SX(0, 1), *after))]
    return ca.Function(_NAME, [motion, tuning, memory], results, {"cse": True})


@one_at_a_time
def command_function(law: Law, model: ArmModel) -> ca.Function:
    """A controller without memory as a CasADi function (x, r) -> command, shape (n,).

    x are positions and velocities; r those of the reference, its accelerations, and the numbers of
    ``law.tuning``.
    """
    n, formula = model.n, expression(law, model)
    x, r = ca.SX.sym("x", 2 * n), ca.SX.sym("r", 3 * n + formula.numel_in(1))
    tau = formula(ca.vertcat(x, r[: 3 * n], ca.SX(n, 1)), r[3 * n :], ca.SX(0, 1))[0]
    command = ca.densify(CommandMap(model)(x[:n], x[n:], tau))
    return ca.Function("law", [x, r], [command], {"cse": True})


def _pairs(call: Call, law: Law, model: ArmModel) -> Iterator[tuple[Array, Array]]:
    """Torques and memory by the code and by the controller, where the code has an answer."""
    motion, tuning, memory = call.inputs
    shapes, rng = [part.shape for part in law.memory], np.random.default_rng(0)
    tuning[:] = _flat(law.tuning)
    for q, v, *desired in np.swapaxes(random_states(model.n, 6), 0, 1):
        law.memory = tuple(rng.normal(size=shape) for shape in shapes)
        motion[:], memory[:] = np.concatenate((q, v, *desired)), _flat(law.memory)
        call.run()
        if all_finite(call.outputs[0]):
            tau = law.torque(Measured(q, v), Reference(*desired))
            yield np.hstack(call.outputs), np.hstack((tau, _flat(law.memory)))


def _flat(parts: Sequence[Array]) -> Array:
    """All numbers in one array, matrices by columns."""
    return np.concatenate([np.zeros(0), *(np.ravel(part, order="F") for part in parts)])


def _parts(library: Any, flat: Any, like: Sequence[Array]) -> tuple[Any, ...]:
    """The inverse of ``_flat``, for numbers of NumPy and expressions of CasADi."""
    ends = np.cumsum([0, *(part.size for part in like)])
    cut = [flat[i:j] for i, j in zip(ends, ends[1:], strict=False)]
    if library is np:
        return tuple(x.reshape(y.shape, order="F").copy() for x, y in zip(cut, like, strict=True))
    return tuple(ca.reshape(x, *(*y.shape, 1)[:2]) for x, y in zip(cut, like, strict=True))
