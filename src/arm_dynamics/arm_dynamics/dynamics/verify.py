# SPDX-License-Identifier: Apache-2.0
"""The check that generated code passes before it is used: against Pinocchio, at random states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import KernelError
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.loop_closure import Closure
from arm_dynamics.model.regularity import check_regular

CHECK_TOLERANCE = 1e-10
CHECK_STATES = 20
WITHOUT_FRICTION = 23
"""The terms of inverse dynamics but friction; ``Term`` stands in a module that knows this one."""
WELL_CONDITIONED = 1e4
"""Condition of constraints beyond which a position is not looked at, if there are better ones."""
ROUNDINGS = 100.0
"""Times the condition that rounding is enlarged at most, by as many operations as there are."""
MOST_SLACK = 1e3
"""Whatever the condition, 1e-7 is wrong and not rounding."""


def random_states(n: int, count: int = 3) -> Array:
    """Vectors to compare at, always the same ones, shape (count, CHECK_STATES, n)."""
    return np.random.default_rng(0).uniform(-np.pi, np.pi, (count, CHECK_STATES, n))


def compare(what: str, *parts: tuple[Array, Array]) -> float:
    """Refuse generated code whose results are off.

    Args:
        what: What was generated, for the message.
        parts: Differences of results from those of Pinocchio, and the size of what such a result
            is added up of, which does not vanish where the sum happens to; one entry for each
            state, so each of shape (k, …).

    Returns:
        The largest difference at a state over the largest size there, of all states and parts.

    Raises:
        KernelError: If it exceeds ``CHECK_TOLERANCE``, or is not a number.
    """
    error = float(np.max([_relative(*part) for part in parts]))
    if not error <= CHECK_TOLERANCE:
        raise KernelError(
            f"generated {what} differs from Pinocchio by {error:.2e} (relative); "
            f"{CHECK_TOLERANCE:.0e} is allowed"
        )
    return error


def _relative(difference: Array, size: Array) -> float:
    count = len(difference)
    worst = abs(difference).reshape(count, -1).max(axis=1, initial=0.0)
    scale = abs(size).reshape(count, -1).max(axis=1, initial=0.0)
    return float(np.max(worst / np.maximum(scale, np.finfo(float).tiny)))


def torque_size(M: Array, a: Array, *torques: Array) -> Array:
    """Size of what adds up to the torques of a motion, shape (k, n).

    Accelerations are compared as the torques that they take: unlike the difference of
    accelerations, that of torques does not grow with M⁻¹.
    """
    heavy: Array = (abs(M) @ abs(a)[..., None])[..., 0]
    return heavy + sum(map(abs, torques))


class Expected(Protocol):
    """What accelerations are checked against: ``Dynamics``."""

    @property
    def model(self) -> ArmModel: ...  # noqa: D102

    def inverse(self, q: Array, v: Array, a: Array, terms: int = ...) -> Array: ...  # noqa: D102

    def friction(self, v: Array, *, q: Array, load: Array) -> Array: ...  # noqa: D102

    def forward(self, q: Array, v: Array, tau: Array) -> Array: ...  # noqa: D102

    def mass_matrix(self, q: Array) -> Array: ...  # noqa: D102


Acceleration = Callable[[Array, Array, Array], Array]


def check_forward(dynamics: Expected, acceleration: Acceleration) -> float:
    """Check forward dynamics: the torque of the accelerations must be the one that was put in.

    Args:
        dynamics: The reference.
        acceleration: Function of q, v, tau, each of shape (n,).

    Returns:
        Largest relative error.

    Raises:
        KernelError: If it is wrong.
        ModelError: If the mass matrix is singular to rounding.
    """
    q, v, tau = random_states(dynamics.model.n)
    M = _mass_matrices(dynamics, q)
    a = _accelerations(acceleration, q, v, tau)
    bias = dynamics.inverse(q, v, np.zeros_like(q))
    size = torque_size(M, a, bias, tau)
    return compare("forward dynamics", (dynamics.inverse(q, v, a) - tau, size))


def check_constrained(dynamics: Expected, acceleration: Acceleration) -> float:
    """Check constrained forward dynamics: A a + γ = 0, and the torque that a lacks is Aᵀλ.

    It is looked at where the constraints are closed, the only states that occur: elsewhere a long
    linkage may be as good as singular. What rounding may leave of the first grows with the
    condition of the constraints in the metric of M (Björck, Numerical Methods for Least Squares
    Problems, 1996, section 2.4), and so does what is allowed.

    Args, returns and errors as those of ``check_forward``; the error is relative to what is
    allowed for rounding, see ``slack``.
    """
    closure = Closure(dynamics.model, dynamics.model.stops)
    names = closure.initially_active
    kept = closure.kept(names, dynamics.model.constraint_rows)
    q, v, tau, condition = closed_states(closure, dynamics.model.q0, kept)
    M = _mass_matrices(dynamics, q)
    a = _accelerations(acceleration, q, v, tau)
    rows = [closure.rows.stacked(*state, names) for state in zip(q, v, strict=True)]
    A = np.array([row.jacobian[kept] for row in rows])
    drift = np.array([row.drift[kept] for row in rows])
    # A gear's loss follows the drive's torque, not what the constraints leave of it.
    friction = dynamics.friction(v, q=q, load=tau)
    lacking, unmoved = (
        tau - friction - dynamics.inverse(q, v, way, terms=WITHOUT_FRICTION)
        for way in (a, np.zeros_like(q))
    )
    free = np.linalg.solve(M, unmoved[..., None])
    terms = (abs(A) @ (abs(a)[..., None] + abs(free)))[..., 0] + abs(drift)
    basis = np.linalg.qr(np.swapaxes(A, 1, 2))[0]
    reaction = (basis @ (np.swapaxes(basis, 1, 2) @ lacking[..., None]))[..., 0]
    more = slack(condition)[:, None]
    return compare(
        "constrained dynamics",
        ((A @ a[..., None])[..., 0] + drift, more * np.maximum(terms, 1e-9)),
        (lacking - reaction, more * torque_size(M, a, tau, lacking)),
    )


def closed_states(
    closure: Closure, start: Array, kept: Sequence[bool]
) -> tuple[Array, Array, Array, Array]:
    """States to compare at that obey the constraints which hold at the start, always the same.

    Args:
        closure: Of the arm.
        start: A position to wander from, shape (n,).
        kept: Which rows of those constraints to obey, the others following from them.

    Returns:
        Positions, velocities and torques, shape (k, n), and the condition of the rows in the
        metric of M, shape (k,). Positions that are singular next to others are left out.
    """
    names = closure.initially_active
    places = closure.wander(start, names) if names else list(random_states(len(start), 1)[0])
    rows = [closure.rows.stacked(q, 0.0 * q, names).jacobian[kept] for q in places]
    found = [closure.factors(q, A, len(A)) for q, A in zip(places, rows, strict=True)]
    condition = np.array([_condition(factors.s, sum(kept)) for factors in found])
    count = -(-CHECK_STATES // len(places))
    states = [
        (places[i], v - found[i].nearest(rows[i] @ v), tau, condition[i])
        for i in np.flatnonzero(condition <= max(WELL_CONDITIONED, condition.min()))
        for v, tau in np.random.default_rng(i).uniform(-np.pi, np.pi, (count, 2, len(start)))
    ]
    q, v, tau, conditions = (np.array(part) for part in zip(*states, strict=True))
    return q, v, tau, conditions


def slack(condition: Array) -> Array:
    """How many times ``CHECK_TOLERANCE`` is allowed for rounding, by the condition; at least 1."""
    rounding = ROUNDINGS * np.finfo(float).eps * condition
    return np.clip(rounding / CHECK_TOLERANCE, 1.0, MOST_SLACK)


def _condition(s: Array, rows: int) -> float:
    """Of rows with singular values s, those that count as zero left out; 1 without rows."""
    if not rows:
        return 1.0
    return float(s[0] / s[-1]) if len(s) == rows else np.inf


def _mass_matrices(dynamics: Expected, q: Array) -> Array:
    """M at each state, regular there and at the initial position."""
    M = dynamics.mass_matrix(np.vstack([q, dynamics.model.q0]))
    check_regular(M, dynamics.model.joint_names)
    return M[:-1]


def _accelerations(acceleration: Acceleration, q: Array, v: Array, tau: Array) -> Array:
    a = np.array([np.array(acceleration(*state)) for state in zip(q, v, tau, strict=True)])
    if not np.isfinite(a).all():
        compare("forward dynamics", (a, np.ones_like(a)))
    return a
