# SPDX-License-Identifier: Apache-2.0
"""Terms as compiled code: of many points, and of one that Python calls without conversions.

All code is verified against Pinocchio before it is used.
"""

import logging
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.kernel import Kernel
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.codegen.python_call import PythonCall, python_call
from arm_dynamics.codegen.rows import Rows
from arm_dynamics.exceptions import ArmError
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.terms.arm import NumericArm, SymbolicArm
from arm_dynamics.terms.table import FIXED, FORWARD, SIZES, Entry
from arm_dynamics.terms.verify import verify

_log = logging.getLogger(__name__)

# An entry, and its arguments that are not numbers
type Request = tuple[Entry, tuple[Any, ...]]


def function(
    arm: SymbolicArm, n: int, name: str, requests: Sequence[Request], fixed: Iterable[str] = FIXED
) -> ca.Function:
    """Entries as one function with dense results, their parts apart.

    Matrices are transposed, since CasADi stores them by columns, and C and NumPy by rows.
    ``fixed`` names arguments that are no arguments of the function, see ``FIXED``.
    """
    needed = {x for entry, _ in requests for x in entry.arguments}
    symbols = {x: ca.SX.sym(x, size or n) for x, size in SIZES.items()}
    values = symbols | {x: FIXED[x] * ca.SX.ones(symbols[x].shape) for x in fixed}
    results = list[ca.SX]()
    for entry, selection in requests:
        result = entry.formula(arm, *(values[x] for x in entry.arguments), *selection)
        if entry.fields:
            results += ca.vertsplit(result)
        else:
            results.append(result.T if len(entry.shape) == 2 else result)
    arguments = [x for x in SIZES if x in needed and x not in fixed]
    return ca.Function(
        name, [symbols[x] for x in arguments], [ca.densify(x) for x in results],
        arguments, [f"o{i}" for i in range(len(results))], {"cse": True},
    )  # fmt: skip


@one_at_a_time
def rows(
    model: ArmModel,
    friction: SteadyFriction,
    requests: Sequence[Request],
    fixed: Iterable[str] = (),
) -> Rows | None:
    """Compile and verify terms of an arm for batches; ``fixed`` as for ``function``.

    None if there is no code of an entry, or it cannot be compiled, or does not agree with
    Pinocchio to 1e-10 of the size of the summands.
    """
    if not compiler.may_build() or not all(entry.compiles(model) for entry, _ in requests):
        return None
    title = ", ".join(entry.title(*selection) for entry, selection in requests)
    _log.info("building code for batches: %s of %d joints", title, model.n)
    expressions, numbers = SymbolicArm(model, friction), NumericArm(model, friction)
    first = 0
    try:
        point = function(expressions, model.n, "point", requests, fixed)
        compiled, names = Rows(point), point.name_in()
        for entry, selection in requests:
            parts = slice(first, first + max(1, len(entry.fields)))

            def values(arguments: Mapping[str, Array], parts: slice = parts) -> Array:
                return np.hstack(compiled(*(arguments[x] for x in names))[parts])

            verify(numbers, entry, selection, values, names)
            first = parts.stop
    except (ArmError, OSError) as error:
        _log.warning("%s; computed by Pinocchio, which is slower", error)
        return None
    return compiled


@one_at_a_time
def calls(
    model: ArmModel, friction: SteadyFriction, requests: Sequence[Request]
) -> dict[Request, PythonCall]:
    """Compile and verify terms of an arm for single states.

    The acceleration of a joint with dry friction at rest, which may stick, is no number.
    """
    expressions, numbers = SymbolicArm(model, friction), NumericArm(model, friction)
    sticks = friction.joints.level > 0.0
    functions = list[ca.Function]()
    for i, request in enumerate(requests):
        entry = request[0]
        point = function(expressions, model.n, f"{entry.name}_{i}", [request])
        functions.append(_nan_at_rest(point, entry, sticks))
    kernel = Kernel(functions, "native")
    answers = {}
    for (entry, selection), point in zip(requests, functions, strict=True):
        shape = point.size_out(0)[::-1] if len(entry.shape) == 2 else (point.numel_out(0),)
        answers[entry, selection] = call = python_call(kernel, point.name(), shape)
        names = point.name_in()
        verify(numbers, entry, selection, _at_each_state(call, shape, names), names)
    return answers


def _nan_at_rest(point: ca.Function, entry: Entry, sticks: NDArray[np.bool_]) -> ca.Function:
    """One result, not finite where it depends on which joints stick."""
    arguments = point.sx_in()
    result = ca.vertcat(*point.call(arguments, True, False))
    if entry is FORWARD:
        v = arguments[1]
        for joint in np.flatnonzero(sticks).tolist():
            result[joint] += ca.if_else(v[joint] == 0, math.nan, 0)
    names = point.name_in(), ["result"]
    return ca.Function(point.name(), arguments, [ca.densify(result)], *names, {"cse": True})


def _at_each_state(
    call: PythonCall, shape: tuple[int, ...], names: list[str]
) -> Callable[..., Array]:
    """A call for many states; NaN where it has no answer."""

    def values(arguments: Mapping[str, Array]) -> Array:
        results = [call(*state) for state in zip(*(arguments[x] for x in names), strict=True)]
        return np.array([np.full(shape, np.nan) if y is None else y for y in results])

    return values
