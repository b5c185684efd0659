# SPDX-License-Identifier: Apache-2.0
"""Verification of generated code before it is used: against Pinocchio, at random states."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations.spring import tension
from arm_dynamics.exceptions import KernelError
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.terms.arm import Numbers
from arm_dynamics.terms.table import FIXED, SIZES, Entry

CHECK_TOLERANCE = 1e-10
CHECK_STATES = 20


def random_states(n: int, count: int = 3) -> Array:
    """Deterministic random vectors to compare at, shape (count, CHECK_STATES, n)."""
    return np.random.default_rng(0).uniform(-np.pi, np.pi, (count, CHECK_STATES, n))


def compare(what: str, *parts: tuple[Array, Array], source: str = "Pinocchio") -> float:
    """Reject generated code whose results are wrong.

    Args:
        what: Name of the generated code, for the message.
        parts: Differences from the source's results, and the size of the summands of such a
            result, which does not vanish where the sum happens to; one entry for each state, each
            of shape (k, …).
        source: Whose results are right, for the message.

    Returns:
        The largest ratio, over states and parts, of the largest difference to the largest size.

    Raises:
        KernelError: If it exceeds ``CHECK_TOLERANCE``, or is NaN.
    """
    error = float(np.max([_relative(*part) for part in parts]))
    if not error <= CHECK_TOLERANCE:
        raise KernelError(
            f"generated {what} differs from {source} by {error:.2e} (relative); "
            f"allowed: {CHECK_TOLERANCE:.0e}"
        )
    return error


def _relative(difference: Array, size: Array) -> float:
    count = len(difference)
    worst = abs(difference).reshape(count, -1).max(axis=1, initial=0.0)
    scale = abs(size).reshape(count, -1).max(axis=1, initial=0.0)
    return float(np.max(worst / np.maximum(scale, np.finfo(float).tiny)))


def _spring_torque(rigid: RigidTerms, q: Array, v: Array) -> tuple[Array, Array]:
    """S by Pinocchio's kinematics and the laws of springs, and the size of its summands.

    Elsewhere numbers of springs come from the same expression as code.
    """
    robot, springs = rigid.robot, rigid.springs
    E, bent = robot.followers, robot.followers @ q + robot.offsets - springs.rest
    parts = [E.T @ (springs.pull(bent) + springs.damping * (E @ v))]
    for spring in springs.points:
        ends = zip(spring.frames, spring.points, strict=True)
        (a, J_a), (b, J_b) = (rigid.motion(name).of_point(q, point, 0.0) for name, point in ends)
        u, slope = a - b, (a - b) @ (J_a - J_b)[:3]
        parts.append(sum(tension(spring, u @ u, slope @ v)) * slope)
    return sum(parts), sum(map(abs, parts))


def verify(
    numbers: Numbers,
    asked: tuple[Entry, tuple[Any, ...]],
    values: Callable[[Mapping[str, Array]], Array],
    given: Sequence[str],
) -> float:
    """Compare code of a term with Pinocchio, at deterministic random states.

    Args:
        numbers: The arm, with numbers.
        asked: The entry.
        values: From the arguments by name, for all states, to the results.
        given: Names of the arguments; others have the values of ``FIXED``.

    Returns:
        The largest error, see ``compare``.

    Raises:
        KernelError: If it differs.
    """
    (entry, which), n, rng = asked, numbers.rigid.robot.n, np.random.default_rng(0)
    q, v, x = random_states(n)
    states = {"q": q, "v": v, "a": x, "tau": x}
    for name, usual in FIXED.items():
        shape = CHECK_STATES, SIZES[name] or n
        states[name] = np.full(shape, usual)
        if name in given:
            states[name] = rng.integers(0, 2, shape).astype(float)
    if numbers.sprung:
        found = [_spring_torque(numbers.rigid, *state) for state in zip(q, v, strict=True)]
        expected, sizes = (np.array(part) for part in zip(*found, strict=True))
        springs = np.array([numbers.rigid.spring(*state) for state in zip(q, v, strict=True)])
        compare("springs", (springs - expected, sizes))
    with np.errstate(all="ignore"):  # numbers that are not finite are rejected
        made = values(states).reshape(CHECK_STATES, *entry.dimensions(n))
        rows = zip(*(states[x] for x in entry.of), strict=True)
        found = [
            entry.compared(numbers, y, entry.formula, *row, *which)
            for y, row in zip(made, rows, strict=True)
        ]
    difference, scale = (np.array(part) for part in zip(*found, strict=True))
    parts = [(difference, scale)]
    if entry.fields or entry.name == "constraint_rows":  # each column by its own size
        parts = [(difference[..., i], scale[..., i]) for i in range(difference.shape[-1])]
    return compare(entry.title(*which), *parts)
