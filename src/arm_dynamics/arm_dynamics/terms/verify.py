# SPDX-License-Identifier: Apache-2.0
"""Verification of generated code before it is used: against Pinocchio, at random states."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations.spring import tension
from arm_dynamics.exceptions import KernelError
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.terms.arm import NumericArm
from arm_dynamics.terms.table import FIXED, SIZES, Entry

# Largest difference that is rounding, relative to the summands; and number of states compared
CHECK_TOLERANCE = 1e-10
CHECK_STATES = 20


def random_states(n: int, count: int = 3) -> Array:
    """Deterministic random vectors to compare at, shape (count, CHECK_STATES, n)."""
    return np.random.default_rng(0).uniform(-np.pi, np.pi, (count, CHECK_STATES, n))


def compare(name: str, *parts: tuple[Array, Array], source: str = "Pinocchio") -> float:
    """Reject generated code whose results are wrong.

    Args:
        name: Name of the generated code, for the message.
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
            f"generated {name} differs from {source} by {error:.2e} (relative); "
            f"allowed: {CHECK_TOLERANCE:.0e}"
        )
    return error


def _relative(difference: Array, size: Array) -> float:
    """The largest ratio, over states, of the largest difference to the largest size."""
    states = len(difference)
    worst = abs(difference).reshape(states, -1).max(axis=1, initial=0.0)
    scale = abs(size).reshape(states, -1).max(axis=1, initial=0.0)
    return float(np.max(worst / np.maximum(scale, np.finfo(float).tiny)))


def _spring_torque(rigid: RigidTerms, q: Array, v: Array) -> tuple[Array, Array]:
    """S by Pinocchio's kinematics and the laws of springs, and the size of its summands.

    Other numbers of springs come from the same expression as code, and could not confirm it.
    """
    robot, springs = rigid.robot, rigid.springs
    E, stretch = robot.followers, robot.followers @ q + robot.offsets - springs.rest
    torques = [E.T @ (springs.pull(stretch) + springs.damping * (E @ v))]
    for spring in springs.points:
        ends = zip(spring.frames, spring.points, strict=True)
        (a, J_a), (b, J_b) = (rigid.motion(name).of_point(q, point, 0.0) for name, point in ends)
        u, slope = a - b, (a - b) @ (J_a - J_b)[:3]
        torques.append(sum(tension(spring, u @ u, slope @ v)) * slope)
    return sum(torques), sum(map(abs, torques))


def verify(
    numbers: NumericArm,
    entry: Entry,
    selection: tuple[Any, ...],
    values: Callable[[Mapping[str, Array]], Array],
    names: Sequence[str],
) -> float:
    """Compare code of a term with Pinocchio, at deterministic random states.

    Args:
        numbers: The arm, with numbers.
        entry: The term.
        selection: Its arguments that are not numbers.
        values: The code, from the arguments by name, for all states, to the results.
        names: Names of the arguments of the code; others have the values of ``FIXED``.

    Returns:
        The largest error, see ``compare``.

    Raises:
        KernelError: If it differs.
    """
    n = numbers.rigid.robot.n
    arguments = _random_arguments(n, names)
    if numbers.has_springs:
        _check_springs(numbers, arguments["q"], arguments["v"])
    with np.errstate(all="ignore"):  # numbers that are not finite are rejected
        results = values(arguments).reshape(CHECK_STATES, *entry.dimensions(n))
        states = zip(*(arguments[x] for x in entry.arguments), strict=True)
        errors = [
            entry.compared(numbers, result, entry.formula, *state, *selection)
            for result, state in zip(results, states, strict=True)
        ]
    difference, scale = (np.array(part) for part in zip(*errors, strict=True))
    parts = [(difference, scale)]
    if entry.fields or entry.name == "constraint_rows":  # each column by its own size
        parts = [(difference[..., i], scale[..., i]) for i in range(difference.shape[-1])]
    return compare(entry.title(*selection), *parts)


def _random_arguments(n: int, names: Sequence[str]) -> dict[str, Array]:
    """All arguments of formulas at the random states, of those in ``FIXED`` only the named."""
    q, v, x = random_states(n)
    arguments, rng = {"q": q, "v": v, "a": x, "tau": x}, np.random.default_rng(0)
    for name, usual in FIXED.items():
        shape = CHECK_STATES, SIZES[name] or n
        arguments[name] = np.full(shape, usual)
        if name in names:
            arguments[name] = rng.integers(0, 2, shape).astype(float)
    return arguments


def _check_springs(numbers: NumericArm, q: Array, v: Array) -> None:
    torques = np.array([numbers.rigid.spring(*state) for state in zip(q, v, strict=True)])
    by_pinocchio = [_spring_torque(numbers.rigid, *state) for state in zip(q, v, strict=True)]
    expected, sizes = (np.array(part) for part in zip(*by_pinocchio, strict=True))
    compare("springs", (torques - expected, sizes))
