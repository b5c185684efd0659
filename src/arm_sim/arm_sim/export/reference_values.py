# SPDX-License-Identifier: Apache-2.0
"""Numbers that the functions of a library must return, by ``Dynamics``, which asks Pinocchio."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from arm_dynamics import ArmModel, Dynamics, SceneError
from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.dynamics import call_entry
from arm_dynamics.exceptions import ConstraintError
from arm_dynamics.model.loops.loop_closure import Closure
from arm_dynamics.terms.verify import compare
from arm_sim.exceptions import NotDifferentiable, SimulationDiverged
from arm_sim.export.terms import DERIVATIVES, Term
from arm_sim.simulation.simulator import Simulator

# q, v, and a or tau
Point = tuple[Array, Array, Array]

# Number of random states at which terms are compared
TEST_POINTS = 3
_COMMANDS, _TICKS_PER_COMMAND = 5, 20
_TORQUE_SHARE, _TORQUE_CAP = 0.1, 50.0  # of the limits of commands, and [N m] that count of them
_SPREAD, _LOOP_SPREAD = 1.0, 0.1  # of positions around the initial ones, and in loops


def test_points(model: ArmModel, count: int = TEST_POINTS) -> list[Point]:
    """Random q, v, and a or tau at which a model's loops are closed; the same at every call."""
    drawn = np.random.default_rng(0).uniform(-1.0, 1.0, (count, 3, model.n))
    return [_closed(model, *rows) for rows in drawn]


def _closed(model: ArmModel, offset: Array, v: Array, a: Array) -> Point:
    """A point at an offset from the initial position that satisfies the bilateral constraints."""
    if not model.scene.bilateral:
        return model.q0 + _SPREAD * offset, v, a
    closure = Closure(model, model.stops)
    names = closure.initially_active
    try:
        q, v = closure.closed(model.q0 + _LOOP_SPREAD * offset, v, names)
    except ConstraintError:  # a mechanism that hardly moves
        q, v = closure.closed(model.q0, v, names)
    return q, v, a


class ReferenceResults:
    """Right results of terms.

    Args:
        model: The arm.
    """

    def __init__(self, model: ArmModel) -> None:
        self._dynamics = Dynamics(model)

    def of(self, term: Term, q: Array, v: Array, a: Array) -> tuple[Array, ...]:
        """Results of a term at a point, a for accelerations or torques, row by row.

        Derivatives, which ``Dynamics`` does not know, are those of the term's own expression.
        """
        if term.name in DERIVATIVES:
            return evaluated(term, q, v, a)
        if term.entry is None:  # computed torque, all else zero
            return (self._dynamics.inverse(q, v, 0.0 * a),)
        state = {"q": q, "v": v, "a": a, "tau": a}
        return (np.ravel(call_entry(self._dynamics, term.entry, state, *term.which)),)

    def verify(self, terms: Sequence[Term], points: Sequence[Point]) -> None:
        """Compare the terms, except for derivatives, with these results.

        Raises:
            KernelError: If one differs by more than rounding.
        """
        for term in (term for term in terms if term.name not in DERIVATIVES):
            pairs = [(evaluated(term, *p)[0], self.of(term, *p)[0]) for p in points]
            results, references = (np.array(rows) for rows in zip(*pairs, strict=True))
            scale = np.maximum(abs(references), 1.0)
            compare(f"function {term.name}", (results - references, scale))


@dataclass(frozen=True)
class ReferenceMotion:
    """A motion that ticks must give.

    Attributes:
        commands: Commands, one after another, shape (k, n).
        duration: Ticks for which each command is held.
        q: Positions at the end, shape (n,).
        v: Velocities at the end, shape (n,).
        derivatives: Derivatives A and B there, under the last command; None if there are none.
    """

    commands: Array
    duration: int
    q: Array
    v: Array
    derivatives: tuple[Array, Array] | None


def test_motion(simulator: Simulator, *, differentiable: bool) -> ReferenceMotion:
    """Move an arm that is at its initial state, under small random commands, and put it back."""
    limit = np.minimum(simulator.model.command_limit, _TORQUE_CAP)
    shares = np.random.default_rng(0).uniform(-1.0, 1.0, (_COMMANDS, simulator.n))
    commands = _TORQUE_SHARE * limit * shares
    try:
        rows = np.repeat(commands, _TICKS_PER_COMMAND, axis=0)
        end = simulator.run(len(rows) * simulator.dt, rows)
        derivatives = _derivatives(simulator, commands[-1]) if differentiable else None
    except SimulationDiverged as error:
        raise SceneError(f"the tick cannot be tested: {error}") from error
    finally:
        simulator.reset()
    return ReferenceMotion(commands, _TICKS_PER_COMMAND, end.q[-1], end.v[-1], derivatives)


def _derivatives(simulator: Simulator, command: Array) -> tuple[Array, Array] | None:
    try:
        return simulator.linearize(simulator.state, command)
    except NotDifferentiable:
        return None


def evaluated(term: Term, q: Array, v: Array, a: Array) -> tuple[Array, ...]:
    """Results of a term's expression at a point, row by row; other arguments are zero."""
    values = {"q": q, "v": v, "a": a, "tau": a}
    results = term.function.call([values.get(name, 0.0) for name in term.arguments])
    return tuple(np.array(result).ravel(order="F") for result in results)
