# SPDX-License-Identifier: Apache-2.0
"""Newton's method for the forces of several contacts with Coulomb friction.

Coulomb's law as equations without inequalities: with t = r_n - ρ w_n and z = r_t - ρ w_t,

    r_n = max(0, t),   r_t = z, or if |z| > µ t the vector of length µ t along z

(Alart, Curnier, "A mixed formulation for frictional contact problems prone to Newton like solution
methods", Comput. Methods Appl. Mech. Eng. 92, 1991), solved by Newton's method with halved steps.
The same lines stand in C in ``native/cone.c``.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from arm_dynamics.model.arm import Array

STEPS = 60
HALVED = 12
# Relative size of what Newton's equations may leave, and of what keeps them regular.
SOLVED, REGULAR = 1e-13, 1e-12
AHEAD = np.array([1.0, 0.0])


class Does(IntEnum):
    """What a contact does."""

    APART = 0
    SLIDES = 1
    STICKS = 2
    UNSOLVABLE = 3


@dataclass
class Answer:
    """Solution for one contact.

    Attributes:
        does: What it does.
        force: Normal and tangential force, shape (3,).
        direction: Of sliding, a unit vector, shape (2,).
    """

    does: Does
    force: Array
    direction: Array


def newton(
    W: Array, c: Array, mu: Array, given: list[Array | None], allowed: Array, r: Array
) -> list[Answer] | None:
    """Improve forces r, in place, until they obey; None if that does not happen.

    Args:
        W: Motion per force, shape (m, m) with m = 3 nc.
        c: Motion without forces, shape (m,).
        mu: Coefficients of friction, shape (nc,).
        given: Direction of each contact that slides already, shape (2,), or None.
        allowed: Whether a contact may carry at all, shape (nc,).
        r: First guess, shape (m,).

    Returns:
        An answer for each contact.
    """
    trial = r.copy()
    F, J = _equations(W, c, mu, given, allowed, trial)
    for _ in range(STEPS):
        if abs(F).max() <= SOLVED * (abs(trial).max() + 1e-300):
            r[:] = trial
            return _answers(W, c, mu, given, allowed, trial)
        try:
            step = np.linalg.solve(J, -F)
        except np.linalg.LinAlgError:
            return None
        size, length = float(F @ F), 1.0
        for _ in range(HALVED):
            after = trial + length * step
            F, J = _equations(W, c, mu, given, allowed, after)
            if F @ F < (1.0 - 1e-4 * length) * size:
                break
            length *= 0.5
        trial = after
    return None


def _equations(
    W: Array, c: Array, mu: Array, given: list[Array | None], allowed: Array, r: Array
) -> tuple[Array, Array]:
    """What is left of the equations, in forces, and their derivative."""
    m = len(c)
    w, F, J = W @ r + c, r.copy(), np.eye(m)
    regular = W + REGULAR * np.trace(W) * np.eye(m)
    for k in np.flatnonzero(allowed):
        n, t = 3 * k, slice(3 * k + 1, 3 * k + 3)
        rho = 3.0 / float(np.trace(W[n : n + 3, n : n + 3]))
        pressed = r[n] - rho * w[n]
        if pressed <= 0.0:
            continue
        F[n], J[n] = rho * w[n], rho * regular[n]
        d = given[k]
        if d is not None:
            F[t] = r[t] + mu[k] * r[n] * d
            J[t, n] = mu[k] * d
            continue
        z = r[t] - rho * w[t]
        size = float(np.hypot(z[0], z[1]))
        if size <= mu[k] * pressed:
            F[t], J[t] = rho * w[t], rho * regular[t]
            continue
        along = z / size
        F[t] = r[t] - mu[k] * pressed * along
        turned = mu[k] * pressed / size * (np.eye(2) - np.outer(along, along))
        pressing = -rho * regular[n]
        pressing[n] += 1.0
        moving = -rho * regular[t]
        moving[:, t] += np.eye(2)
        J[t] -= mu[k] * np.outer(along, pressing) + turned @ moving
    return F, J


def _answers(
    W: Array, c: Array, mu: Array, given: list[Array | None], allowed: Array, r: Array
) -> list[Answer]:
    w, answers = W @ r + c, []
    for k, d in enumerate(given):
        own = slice(3 * k, 3 * k + 3)
        rho = 3.0 / float(np.trace(W[own, own])) if allowed[k] else 0.0
        pressed, z = r[3 * k] - rho * w[3 * k], (r[own] - rho * w[own])[1:]
        size = float(np.hypot(z[0], z[1]))
        if not allowed[k] or pressed <= 0.0:
            answers.append(Answer(Does.APART, np.zeros(3), AHEAD if d is None else d))
        elif d is not None:
            answers.append(Answer(Does.SLIDES, r[own].copy(), d))
        elif size <= mu[k] * pressed:
            answers.append(Answer(Does.STICKS, r[own].copy(), AHEAD))
        else:
            answers.append(Answer(Does.SLIDES, r[own].copy(), -z / size))
    return answers
