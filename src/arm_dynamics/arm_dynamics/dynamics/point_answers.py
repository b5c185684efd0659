# SPDX-License-Identifier: Apache-2.0
"""Complete service responses as compiled functions of the vectors of one point.

They are built from the same expressions as ``Dynamics`` and verified against it. Cases with
decisions (joints at rest with dry friction, constraints, load-dependent friction) are left to
``Dynamics``.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.dynamics import compiled_terms as terms
from arm_dynamics.dynamics.compiled_backend import at_points, compiled_rows
from arm_dynamics.dynamics.dynamics import Dynamics, Term
from arm_dynamics.dynamics.verify import check_forward, compare, random_states
from arm_dynamics.dynamics.with_friction import forward, inverse, point
from arm_dynamics.equations.forward_dynamics import DENSE_AT_MOST
from arm_dynamics.exceptions import ArmError
from arm_dynamics.model.pinocchio_terms import RigidTerms

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class PointAnswer:
    """One type of request, its compiled response and the verification of it.

    Attributes:
        title: Its name, for display.
        expression: Builds the response for an arm as a function of one point's vectors.
        check: Compares the compiled function with the arm's ``Dynamics``; raises ``KernelError``.
        known: Whether the responses for an arm can be computed without decisions.
    """

    title: str
    expression: Callable[[Dynamics], ca.Function]
    check: Callable[[Dynamics, Callable[..., list[Array]]], object]
    known: Callable[[Dynamics], bool]


@one_at_a_time
def compiled_answer(question: PointAnswer, dynamics: Dynamics) -> Any | None:
    """Compile the response to one type of request for an arm.

    Args:
        question: Type of request, one of ``INVERSE``, ``FORWARD`` and ``ALL_TERMS``.
        dynamics: Dynamics of the arm, used during this call only.

    Returns:
        The C function ``answer_rows`` of ``rows.c``; None if it cannot be compiled, if the
        response requires decisions, or if it does not agree with ``dynamics`` to 1e-10 of the size
        of the summands.
    """
    if not (compiler.may_build() and question.known(dynamics)):
        return None
    try:
        function = question.expression(dynamics)
        entry = compiled_rows(function)
        with np.errstate(all="ignore"):  # numbers that are not finite are rejected
            question.check(dynamics, at_points(function, entry))
    except (ArmError, OSError) as error:
        _log.warning("%s: %s; computed by Pinocchio, which is slower", question.title, error)
        return None
    return entry


def chosen_terms(chosen: int) -> Array:
    """The factor of each term, by the bits of ``Term``."""
    return np.array([float(bool(chosen & term)) for term in Term])


def _check_inverse(dynamics: Dynamics, answer: Callable[..., list[Array]]) -> None:
    q, v, a = random_states(dynamics.n)
    gravity = np.array(dynamics.model.scene.gravity)
    alone = [dynamics.inverse(q, v, a, term) for term in Term]
    size = np.sum(np.abs(alone), axis=0)
    for chosen in (*Term, Term.ALL ^ Term.FRICTION, Term.ALL):
        found = answer(q, v, a, chosen_terms(chosen), gravity)[bool(chosen & Term.FRICTION)]
        compare("inverse dynamics", (found - dynamics.inverse(q, v, a, chosen), size))


def _check_forward(dynamics: Dynamics, answer: Callable[..., list[Array]]) -> None:
    check_forward(dynamics, lambda q, v, tau: answer(q[None], v[None], tau[None])[0][0])


def _all_terms(dynamics: Dynamics) -> ca.Function:
    """From q and v: M, C, G, F, S, kinetic and potential energy."""
    model, (q, v) = dynamics.model, (ca.SX.sym(name, dynamics.n) for name in "qv")
    still = ca.SX(dynamics.n, 1)
    kinetic, potential = ca.vertsplit(terms.ENERGIES.expression(model)(q, v))
    return point(
        [q, v],
        *[
            terms.MASS_MATRIX.expression(model)(q),
            terms.CORIOLIS_MATRIX.expression(model)(q, v),
            terms.GRAVITY.expression(model)(q),
            dynamics.steady_friction(v, ca.sign(v), q, still),
            terms.SPRING.expression(model)(q, v),
            kinetic,
            potential,
        ],
    )


def _check_all_terms(dynamics: Dynamics, answer: Callable[..., list[Array]]) -> None:
    points, n = RigidTerms(dynamics.model), dynamics.n
    q, v, x = random_states(n)

    def part(i: int, square: bool = False) -> Callable[..., Array]:
        def one(*state: Array) -> Array:
            found = answer(*state, *([np.zeros_like(q)] if len(state) == 1 else []))[i]
            return found.reshape(-1, n, n) if square else found

        return one

    def energies(q: Array, v: Array) -> Array:
        return np.hstack(answer(q, v)[5:])

    for term, found in (
        (terms.MASS_MATRIX, part(0, square=True)), (terms.CORIOLIS_MATRIX, part(1, square=True)),
        (terms.GRAVITY, part(2)), (terms.SPRING, part(4)), (terms.ENERGIES, energies),
    ):  # fmt: skip
        compare(term.title, *term.compared(points, found, q, v, x))
    friction = dynamics.friction(v, q=q)
    compare("friction", (part(3)(q, v) - friction, friction))


def _plain(dynamics: Dynamics) -> bool:
    """Whether friction, if there is any, is independent of the drive's torque."""
    return not dynamics.steady_friction.by_load


INVERSE = PointAnswer(
    "inverse dynamics",
    lambda dynamics: inverse(dynamics.model, dynamics.steady_friction),
    _check_inverse,
    _plain,
)
FORWARD = PointAnswer(
    "forward dynamics",
    lambda dynamics: forward(dynamics.model, dynamics.steady_friction),
    _check_forward,
    lambda dynamics: not dynamics.model.scene.bilateral,
)
ALL_TERMS = PointAnswer(
    "dynamics terms",
    _all_terms,
    _check_all_terms,
    lambda dynamics: dynamics.n <= DENSE_AT_MOST,  # C is an expression of the size of n³
)
