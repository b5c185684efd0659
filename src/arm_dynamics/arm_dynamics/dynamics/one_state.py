# SPDX-License-Identifier: Apache-2.0
"""Answers at one state by compiled code, which is called without conversions.

The expressions are those of ``equations``, and every function is verified against Pinocchio before
it is used. What requires decisions (joints that stick, constraints, friction that depends on the
load) is left to it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import casadi as ca
import numpy as np

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.kernel import Kernel
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.codegen.python_call import PythonCall, python_call
from arm_dynamics.dynamics import compiled_terms as terms
from arm_dynamics.dynamics import with_friction
from arm_dynamics.dynamics.compiled_terms import BatchTerm
from arm_dynamics.dynamics.verify import Expected, check_forward, compare, random_states
from arm_dynamics.equations.forward_dynamics import DENSE_AT_MOST
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.pinocchio_terms import RigidTerms


def unanswered(*_: object) -> None:
    """No answer: Pinocchio computes it."""


@dataclass(frozen=True)
class OneState:
    """Compiled answers for vectors of shape (n,); each may return None, see ``PythonCall``.

    Attributes:
        inverse: q, v, a -> torques of all terms.
        forward: q, v, tau -> accelerations.
        mass_matrix: q -> M.
        coriolis_matrix: q, v -> C.
        gravity: q -> G.
        friction: v -> F.
        energies: q, v -> kinetic and potential energy.
        frames: The functions of ``terms.OF_FRAMES``, by their name and that of the frame.
    """

    inverse: PythonCall = unanswered
    forward: PythonCall = unanswered
    mass_matrix: PythonCall = unanswered
    coriolis_matrix: PythonCall = unanswered
    gravity: PythonCall = unanswered
    friction: PythonCall = unanswered
    energies: PythonCall = unanswered
    frames: Mapping[tuple[str, str], PythonCall] = field(
        default_factory=lambda: MappingProxyType({})
    )

    def of_the_arm_alone(self) -> OneState:
        """Without the answers that external torques and active constraints change."""
        return replace(self, inverse=unanswered, forward=unanswered)

    def of_frame(self, what: str, frame: str) -> PythonCall:
        """The function of a frame, ``unanswered`` if it is not compiled."""
        known = self.frames and isinstance(frame, str)
        return self.frames.get((what, frame), unanswered) if known else unanswered


@dataclass(frozen=True)
class _Answer:
    """A function of one state, and the verification of its values at many."""

    function: ca.Function
    shape: tuple[int, ...]
    check: Callable[[Callable[..., Array]], object]


@one_at_a_time
def one_state(
    expected: Expected, friction: SteadyFriction, frames: Collection[str] = ()
) -> OneState:
    """Compile and verify the answers of an arm.

    Args:
        expected: The reference.
        friction: The arm's friction.
        frames: Frames of which poses and Jacobians are wanted.

    Raises:
        InvalidInput: If a frame is unknown.
        KernelError: If there is no compiler, or code differs from Pinocchio.
        ModelError: If a joint moves no mass.
    """
    named = dict(_of_joints(expected, friction))
    for frame in frames:
        RigidTerms(expected.model).motion(frame)  # refuses unknown names
    of_frames = {
        (what, frame): _term(term(frame), expected.model)
        for frame in frames
        for what, term in terms.OF_FRAMES.items()
    }
    answers = {**named, **{f"{what}_{i}": a for i, ((what, _), a) in enumerate(of_frames.items())}}
    functions = [_renamed(name, answer.function) for name, answer in answers.items()]
    kernel = Kernel(functions, "native")
    calls = {name: _checked(kernel, name, answer) for name, answer in answers.items()}
    of_joints = {name: calls[name] for name in named}
    places = zip(of_frames, list(calls)[len(named) :], strict=True)
    return OneState(**of_joints, frames={place: calls[name] for place, name in places})


def _renamed(name: str, function: ca.Function) -> ca.Function:
    symbols = function.sx_in()
    return ca.Function(name, symbols, function.call(symbols, True, False), {"cse": True})


def _checked(kernel: Kernel, name: str, answer: _Answer) -> PythonCall:
    call = python_call(kernel, name, answer.shape)

    def values(*given: Array) -> Array:
        """At many states; NaN where there is no answer."""
        rows = (call(*row) for row in zip(*given, strict=True))
        return np.array([np.full(answer.shape, np.nan) if y is None else y for y in rows])

    with np.errstate(all="ignore"):  # numbers that are not finite are rejected
        answer.check(values)
    return call


def _of_joints(expected: Expected, friction: SteadyFriction) -> Iterable[tuple[str, _Answer]]:
    model = expected.model
    if not friction.by_load:
        yield "inverse", _inverse(expected, friction)
        if not friction.by_position:
            yield "friction", _friction(expected, friction)
    if not model.scene.bilateral:
        yield "forward", _forward(expected, friction)
    yield "mass_matrix", _term(terms.MASS_MATRIX, model)
    if model.n <= DENSE_AT_MOST:  # an expression of the size of n³
        yield "coriolis_matrix", _term(terms.CORIOLIS_MATRIX, model)
    yield "gravity", _term(terms.GRAVITY, model)
    yield "energies", _term(terms.ENERGIES, model)


def _term(term: BatchTerm, model: ArmModel) -> _Answer:
    function = term.expression(model)
    shape = function.size_out(0)[::-1] if term.is_matrix else (function.numel_out(0),)

    def check(values: Callable[..., Array]) -> object:
        return compare(
            term.title, *term.compared(RigidTerms(model), values, *random_states(model.n))
        )

    return _Answer(function, shape, check)


def _inverse(expected: Expected, friction: SteadyFriction) -> _Answer:
    model = expected.model
    q, v, a = (ca.SX.sym(name, model.n) for name in "qva")
    gravity = ca.DM(model.scene.gravity)
    _, tau = with_friction.inverse(model, friction)(q, v, a, ca.DM.ones(5), gravity)

    def check(values: Callable[..., Array]) -> object:
        q, v, a = random_states(model.n)
        still = np.zeros_like(q)
        parts = expected.inverse(q, v, still), expected.inverse(q, v, a)
        size = abs(parts[0]) + abs(parts[1] - parts[0])
        return compare("inverse dynamics", (values(q, v, a) - parts[1], size))

    return _Answer(with_friction.point([q, v, a], tau), (model.n,), check)


def _forward(expected: Expected, friction: SteadyFriction) -> _Answer:
    """Not finite where a joint with dry friction is at rest, and may stick."""
    model, function = expected.model, with_friction.forward(expected.model, friction)
    q, v, tau = function.sx_in()
    a = function(q, v, tau)
    for joint in np.flatnonzero(friction.joints.level > 0.0).tolist():
        a[0] += ca.if_else(v[joint] == 0, math.nan, 0)

    def check(values: Callable[..., Array]) -> object:
        return check_forward(expected, lambda *state: values(*(x[None] for x in state))[0])

    return _Answer(with_friction.point([q, v, tau], a), (model.n,), check)


def _friction(expected: Expected, friction: SteadyFriction) -> _Answer:
    v = ca.SX.sym("v", expected.model.n)
    still = ca.SX(expected.model.n, 1)

    def check(values: Callable[..., Array]) -> object:
        v = random_states(expected.model.n, 1)[0]
        known = friction(v, np.sign(v), 0.0 * v, 0.0 * v)
        return compare("friction", (values(v) - known, known))

    torque = friction(v, ca.sign(v), still, still)
    return _Answer(with_friction.point([v], torque), (expected.model.n,), check)
