# SPDX-License-Identifier: Apache-2.0
"""Generated forward dynamics held against Pinocchio, before anybody uses it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from arm_dynamics.codegen.kernel import CHECK_STATES, require_agreement
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import KernelError
from arm_dynamics.model.arm import Array
from arm_dynamics.model.loop_closure import Closure

_MASS = ": does every joint move some mass?"


def check_forward(
    dynamics: Dynamics, acceleration: Callable[[Array, Array, Array], Array]
) -> float:
    """Compare a forward-dynamics kernel with Pinocchio on random states.

    The torque that Pinocchio needs for the kernel's acceleration is held against the torque that
    was put in; unlike the difference of accelerations, that of torques does not blow up where M
    is ill-conditioned.

    Args:
        dynamics: The reference.
        acceleration: Function of q, v, tau, each of shape (n,).

    Returns:
        Largest error, relative to the size of the terms that make it up.

    Raises:
        KernelError: If it exceeds 1e-10.
    """
    rng = np.random.default_rng(0)
    worst = 0.0
    for _ in range(CHECK_STATES):
        q, v, tau = rng.uniform(-np.pi, np.pi, (3, dynamics.n))
        a = np.array(acceleration(q, v, tau))
        if not np.isfinite(a).all():
            dynamics.forward(q, v, tau)  # says which joint cannot be moved
        needed = dynamics.inverse(q, v, np.nan_to_num(a))
        bias = dynamics.inverse(q, v, np.zeros(dynamics.n))
        size = abs(dynamics.mass_matrix(q)) @ abs(a) + abs(bias) + abs(tau)
        error = np.max(abs(needed - tau)) / size.max()
        worst = max(worst, float(error)) if np.isfinite(a).all() else np.inf
    require_agreement("forward dynamics", worst, _MASS)
    return worst


def check_constrained(
    dynamics: Dynamics, acceleration: Callable[[Array, Array, Array], Array]
) -> None:
    """Hold a constrained forward-dynamics kernel against Pinocchio on random states.

    The acceleration must obey A a + γ = 0, and what torque it lacks must be a reaction Aᵀλ.

    Args:
        dynamics: The reference.
        acceleration: Function of q, v, tau, each of shape (n,).

    Raises:
        KernelError: If either is missed by more than 1e-10 of the terms that make it up.
    """
    closure, rng, worst = Closure(dynamics.model), np.random.default_rng(0), 0.0
    kept = closure.kept(closure.initially_active)
    for _ in range(CHECK_STATES):
        q, v, tau = rng.uniform(-np.pi, np.pi, (3, dynamics.n))
        row = closure.rows.stacked(q, v, closure.initially_active)
        A, drift = row.jacobian[kept], row.drift[kept]
        a = np.array(acceleration(q, v, tau))
        if not np.isfinite(a).all():
            raise KernelError("generated forward dynamics is not finite: a joint moves no mass?")
        free = np.linalg.solve(dynamics.mass_matrix(q), tau - dynamics.inverse(q, v, 0 * a))
        terms = abs(A) @ (abs(a) + abs(free)) + abs(drift)
        open_ = abs(A @ a + drift) / max(terms.max(initial=0.0), 1e-9)
        lacking = tau - dynamics.inverse(q, v, a)
        basis = np.linalg.qr(A.T)[0]
        size = abs(dynamics.mass_matrix(q)) @ abs(a) + abs(tau) + abs(lacking)
        odd = abs(lacking - basis @ (basis.T @ lacking)) / size.max()
        worst = max(worst, open_.max(initial=0.0), odd.max())
    require_agreement("constrained dynamics", worst, _MASS)
