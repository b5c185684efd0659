# SPDX-License-Identifier: Apache-2.0
"""Forces or impulses of contacts with Coulomb friction: the complementarity problem, solved.

Wanted are forces r of contacts, three numbers each (normal, two tangents), and w = W r + c with

    0 <= r_n, 0 <= w_n, r_n w_n = 0,   |r_t| <= µ r_n,   r_t = -µ r_n w_t / |w_t| where w_t != 0.

The same problem stands for accelerations and for the speeds after an impact (Moreau, "Unilateral
contact and dry friction in finite freedom dynamics", CISM 302, 1988). The cone is Coulomb's, not a
pyramid: the direction of sliding is found as the root of a trigonometric polynomial (Bonnefon,
Daviet, "Quartic formulation of Coulomb 3D frictional contact", INRIA, 2011). Several contacts are
solved one after another until nothing changes (Jourdan, Alart, Jean, "A Gauss-Seidel like
algorithm to solve frictional contact problems", Comput. Methods Appl. Mech. Eng. 155, 1998), and
where that takes long together by Newton's method (``contact_newton.py``).

The same lines stand in C in ``native/cone.c``.
"""

from __future__ import annotations

import numpy as np

from arm_dynamics.model.arm import Array
from arm_sim.stepping.contact_newton import AHEAD, Answer, Does, newton

# Sweeps before Newton's method is tried, and tried again.
SWEEPS = (20, 200)
# Steps in which friction grows from nothing where that does not help.
CONTINUED = 20
SETTLED = 1e-15
SAMPLES = 32
ROOT_STEPS = 100
DAMPING = 1e-8


def single(W: Array, c: Array, mu: float, given: Array | None) -> Answer:
    """Solve the problem for one contact.

    Args:
        W: Motion per force, shape (3, 3).
        c: Motion without force, shape (3,).
        mu: Coefficient of friction.
        given: Direction of sliding if the contact slides already, shape (2,); else None.

    Returns:
        The answer; unsolvable if no force keeps the contact from closing further.
    """
    none = np.zeros(3)
    if c[0] >= 0.0:
        return Answer(Does.APART, none, AHEAD if given is None else given)
    if given is not None:
        grip = W[0, 0] - mu * (W[0, 1] * given[0] + W[0, 2] * given[1])
        if not grip > 0.0:
            return Answer(Does.UNSOLVABLE, none, given)
        return Answer(Does.SLIDES, _sliding_force(-c[0] / grip, mu, given), given)
    held = _held(W, c)
    size = float(np.hypot(held[1], held[2]))
    if size <= mu * held[0]:
        return Answer(Does.STICKS, held, AHEAD)
    return _starts_to_slide(W, c, mu)


def several(
    W: Array, c: Array, mu: Array, given: list[Array | None], allowed: Array
) -> list[Answer]:
    """Solve the problem for several contacts.

    Args:
        W: Motion per force, shape (3 nc, 3 nc).
        c: Motion without forces, shape (3 nc,).
        mu: Coefficients of friction, shape (nc,).
        given: See ``single``, for each.
        allowed: Whether a contact may carry at all, shape (nc,).

    Returns:
        An answer for each; all unsolvable if none is found.
    """
    r = np.zeros(3 * len(mu))
    for sweeps in SWEEPS:
        answers = _sweep(W, c, mu, given, allowed, r, sweeps)
        if answers is None:
            answers = newton(W, c, mu, given, allowed, r)
        if answers is not None:
            return answers
    r[:] = 0.0
    for part in range(CONTINUED + 1):
        less = mu * part / CONTINUED
        answers = _sweep(W, c, less, given, allowed, r, SWEEPS[0])
        if answers is None:
            answers = newton(W, c, less, given, allowed, r)
    return answers or [Answer(Does.UNSOLVABLE, np.zeros(3), AHEAD) for _ in mu]


def _sweep(
    W: Array,
    c: Array,
    mu: Array,
    given: list[Array | None],
    allowed: Array,
    r: Array,
    sweeps: int,
) -> list[Answer] | None:
    """Solve one contact after the other; None, with the last forces in r, without end."""
    answers = [Answer(Does.APART, np.zeros(3), AHEAD) for _ in mu]
    for _ in range(sweeps):
        change = 0.0
        for k in np.flatnonzero(allowed):
            own = slice(3 * k, 3 * k + 3)
            others = c[own] + W[own] @ r - W[own, own] @ r[own]
            answers[k] = single(W[own, own], others, mu[k], given[k])
            change = max(change, float(abs(answers[k].force - r[own]).max()))
            r[own] = answers[k].force
        if change <= SETTLED * abs(r).max():
            return answers
    return None


def _held(W: Array, c: Array) -> Array:
    """Force that keeps the point still: least solution of W r = -c, W perhaps singular."""
    damped = W + DAMPING * np.trace(W) * np.eye(3)
    r = np.linalg.solve(damped, -c)
    for _ in range(2):
        r = r + np.linalg.solve(damped, -c - W @ r)
    return np.asarray(r)


def _sliding_force(normal: float, mu: float, d: Array) -> Array:
    return np.array([normal, -mu * normal * d[0], -mu * normal * d[1]])


def _starts_to_slide(W: Array, c: Array, mu: float) -> Answer:
    """The direction d in which the point starts: w_t along d under the force that d means."""
    best, answer = -np.inf, Answer(Does.UNSOLVABLE, np.zeros(3), AHEAD)
    angle = [2.0 * np.pi * k / SAMPLES for k in range(SAMPLES + 1)]
    value = [_across(W, c, mu, a) for a in angle]
    for k in range(SAMPLES):
        if value[k] != 0.0 and not value[k] * value[k + 1] < 0.0:
            continue
        root = angle[k] if value[k] == 0.0 else _root(W, c, mu, angle[k], angle[k + 1], value[k])
        d = np.array([np.cos(root), np.sin(root)])
        grip = W[0, 0] - mu * (W[0, 1] * d[0] + W[0, 2] * d[1])
        if not grip > 0.0:
            continue
        force = _sliding_force(-c[0] / grip, mu, d)
        along = float(d @ (c[1:] + W[1:] @ force))
        if along * force[0] > best and along >= -1e-12 * float(abs(c).max()):
            best, answer = along * force[0], Answer(Does.SLIDES, force, d)
    return answer


def _across(W: Array, c: Array, mu: float, angle: float) -> float:
    """Component of w_t across the direction of sliding, times the grip."""
    d0, d1 = float(np.cos(angle)), float(np.sin(angle))
    grip = W[0, 0] - mu * (W[0, 1] * d0 + W[0, 2] * d1)
    w1 = grip * c[1] - c[0] * (W[1, 0] - mu * (W[1, 1] * d0 + W[1, 2] * d1))
    w2 = grip * c[2] - c[0] * (W[2, 0] - mu * (W[2, 1] * d0 + W[2, 2] * d1))
    return float(d0 * w2 - d1 * w1)


def _root(W: Array, c: Array, mu: float, low: float, high: float, f_low: float) -> float:
    for _ in range(ROOT_STEPS):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        f = _across(W, c, mu, middle)
        if f == 0.0:
            return middle
        if f * f_low > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
