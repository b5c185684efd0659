# SPDX-License-Identifier: Apache-2.0
"""Verification of accelerations that come from elsewhere, free or under constraints."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.dynamics.gauss import times, transposed
from arm_dynamics.model.loops.independent_rows import is_independent
from arm_dynamics.model.loops.loop_closure import Closure
from arm_dynamics.model.regularity import check_regular
from arm_dynamics.terms.arm import NumericArm
from arm_dynamics.terms.comparison import torque_size
from arm_dynamics.terms.table import FORWARD, Term
from arm_dynamics.terms.verify import CHECK_STATES, CHECK_TOLERANCE, compare, random_states, verify

# Condition number of constraints above which a position is skipped if others are better
WELL_CONDITIONED = 1e4
# Largest amplification of rounding errors, in multiples of the condition number
ROUNDING_FACTOR = 100.0
# Fraction of the largest accelerations across constraints that is never taken for a whole one
ROUNDING_SHARE = 1e-9
# Largest allowance for rounding: an error of 1e-7 never passes, whatever the condition number
LARGEST_SLACK = 1e3

Acceleration = Callable[[Array, Array, Array], Array]


def check_forward(dynamics: Dynamics, acceleration: Acceleration) -> float:
    """Verify forward dynamics: inverse dynamics of the accelerations must return the torque.

    Args:
        dynamics: The reference.
        acceleration: Function of q, v, tau, each of shape (n,).

    Returns:
        Largest relative error.

    Raises:
        KernelError: If it is wrong.
        ModelError: If the mass matrix is singular to rounding.
    """
    names = ("q", "v", "tau")

    def values(arguments: Mapping[str, Array]) -> Array:
        return _accelerations(acceleration, *(arguments[name] for name in names))

    _mass_matrices(dynamics, random_states(dynamics.n)[0])
    numbers = NumericArm(dynamics.model, dynamics.steady_friction)
    return verify(numbers, FORWARD, (), values, names)


def sliding_directions(v: Array) -> Array:
    """Directions in which joints slide, 1 or -1, shape of ``v``.

    A joint that constraints leave no speed is compared as if it began to slide, not as one that
    sticks, which needs additional forces.
    """
    return np.where(v < 0.0, -1.0, 1.0)


def check_constrained(dynamics: Dynamics, acceleration: Acceleration) -> float:
    """Verify constrained forward dynamics: A a + γ = 0, and the missing torque is Aᵀλ.

    It is evaluated where the constraints are closed, the only states that occur: elsewhere a long
    linkage may be nearly singular. The residual due to rounding grows with the condition number of
    the constraints in the metric of M (Björck, Numerical Methods for Least Squares Problems, 1996,
    section 2.4), and so does the tolerance.

    Args, returns and errors as those of ``check_forward``; the error is relative to the allowance
    for rounding, see ``slack``.
    """
    closure = Closure(dynamics.model, dynamics.model.stops)
    names = closure.initially_active
    independent = is_independent(closure.rows, names, dynamics.model.constraint_rows)
    q, v, tau, condition = closed_states(closure, dynamics.model.q0, independent)
    M = _mass_matrices(dynamics, q)
    a = _accelerations(acceleration, q, v, tau)
    rows = [closure.rows.stacked(*state, names) for state in zip(q, v, strict=True)]
    A = np.array([row.jacobian[independent] for row in rows])
    drift = np.array([row.drift[independent] for row in rows])
    # A gear's loss depends on the drive's torque, not on what the constraints leave of it.
    friction = dynamics.friction(v, direction=sliding_directions(v), q=q, load=tau)
    deficit, deficit_at_rest = (
        tau - friction - dynamics.inverse(q, v, acceleration, terms=Term.ALL ^ Term.FRICTION)
        for acceleration in (a, np.zeros_like(q))
    )
    free = np.linalg.solve(M, deficit_at_rest[..., None])[..., 0]
    summands = times(abs(A), abs(a) + abs(free)) + abs(drift)
    basis = np.linalg.qr(transposed(A))[0]
    reaction = times(basis, times(transposed(basis), deficit))
    allowance, floor = slack(condition)[:, None], ROUNDING_SHARE * summands.max(initial=0.0)
    return compare(
        "constrained dynamics",
        (times(A, a) + drift, allowance * np.maximum(summands, floor)),
        (deficit - reaction, allowance * torque_size(M, a, tau, deficit)),
    )


def closed_states(
    closure: Closure, start: Array, independent: Sequence[bool]
) -> tuple[Array, Array, Array, Array]:
    """Deterministic states to compare at that satisfy the initially active constraints.

    Args:
        closure: Closure of the arm.
        start: Position from which to sample, shape (n,).
        independent: Independent rows of those constraints, which imply the others.

    Returns:
        Positions, velocities and torques, shape (k, n), and the condition number of the rows in
        the metric of M, shape (k,). Relatively singular positions are left out.
    """
    n, names = len(start), closure.initially_active
    places = closure.sample_positions(start, names) if names else list(random_states(n, 1)[0])
    rows = [closure.rows.stacked(q, 0.0 * q, names).jacobian[independent] for q in places]
    factors = [closure.factors(q, A, len(A)) for q, A in zip(places, rows, strict=True)]
    condition = np.ones(len(places))
    if count := sum(independent):  # infinite where fewer rows are independent
        condition[:] = [f.s[0] / f.s[-1] if len(f.s) == count else np.inf for f in factors]
    repeats = -(-CHECK_STATES // len(places))
    states = [
        (places[i], v - factors[i].nearest(rows[i] @ v), tau, condition[i])
        for i in np.flatnonzero(condition <= max(WELL_CONDITIONED, condition.min()))
        for v, tau in np.random.default_rng(i).uniform(-np.pi, np.pi, (repeats, 2, n))
    ]
    q, v, tau, conditions = (np.array(part) for part in zip(*states, strict=True))
    return q, v, tau, conditions


def slack(condition: Array) -> Array:
    """Multiple of ``CHECK_TOLERANCE`` allowed for rounding, by condition number; at least 1."""
    rounding = ROUNDING_FACTOR * np.finfo(float).eps * condition
    return np.clip(rounding / CHECK_TOLERANCE, 1.0, LARGEST_SLACK)


def _mass_matrices(dynamics: Dynamics, q: Array) -> Array:
    """M at each state, checked to be regular there and at the initial position."""
    M = dynamics.mass_matrix(np.vstack([q, dynamics.model.q0]))
    check_regular(M, dynamics.model.joint_names)
    return M[:-1]


def _accelerations(acceleration: Acceleration, q: Array, v: Array, tau: Array) -> Array:
    a = np.array([np.array(acceleration(*state)) for state in zip(q, v, tau, strict=True)])
    if not np.isfinite(a).all():
        compare("forward dynamics", (a, np.ones_like(a)))
    return a
