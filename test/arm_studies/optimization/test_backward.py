# SPDX-License-Identifier: Apache-2.0
"""The backward pass against the whole quadratic problem, and against all sets of active limits."""

from itertools import product

import numpy as np

from arm_studies.optimization.backward import Policy, backward
from arm_studies.optimization.cost import Expansion
from tolerances import ALGEBRA, assert_close

NODES, NX, N = 6, 4, 3
FREE = np.full((NODES, N), np.inf)


def positive(rng: np.random.Generator, count: int, size: int) -> np.ndarray:
    root = rng.normal(size=(count, size, size))
    return root @ root.transpose(0, 2, 1) + 0.1 * np.eye(size)


def problem(rng: np.random.Generator) -> tuple[np.ndarray, Expansion]:
    cost = Expansion(
        rng.normal(size=(NODES + 1, NX)), positive(rng, NODES + 1, NX),
        rng.normal(size=(NODES, N)), positive(rng, NODES, N),
    )  # fmt: skip
    return 0.6 * rng.normal(size=(NODES, NX, NX + N)), cost


def followed(slopes: np.ndarray, policy: Policy, dx: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    xs, us = [dx], []
    for S, k, K in zip(slopes, policy.k, policy.K, strict=True):
        us.append(k + K @ xs[-1])
        xs.append(S @ np.r_[xs[-1], us[-1]])
    return np.array(xs), np.array(us)


def model(cost: Expansion, xs: np.ndarray, us: np.ndarray) -> float:
    """The quadratic model of the change of a cost."""
    return float(
        (cost.x * xs).sum() + (cost.u * us).sum()
        + 0.5 * np.einsum("ki,kij,kj", xs, cost.xx, xs)
        + 0.5 * np.einsum("ki,kij,kj", us, cost.uu, us)
    )  # fmt: skip


def test_what_is_promised_is_what_the_model_gives(rng: np.random.Generator) -> None:
    slopes, cost = problem(rng)
    policy = backward(slopes, cost, np.full((NODES, N), -0.1), np.full((NODES, N), 0.2), 0.3)
    assert policy is not None
    change = model(cost, *followed(slopes, policy, np.zeros(NX)))
    assert_close(np.array(policy.promised), np.array(change), ALGEBRA)
    assert policy.promised < 0.0


def test_with_limits_it_is_the_best_of_all_sets_of_active_ones(rng: np.random.Generator) -> None:
    for _ in range(20):
        slopes, cost = problem(rng)
        one = Expansion(cost.x[:2], cost.xx[:2], cost.u[:1], cost.uu[:1])
        low, high = -rng.uniform(0.01, 0.5, N), rng.uniform(0.01, 0.5, N)
        policy = backward(slopes[:1], one, low[None], high[None], 0.0)
        assert policy is not None
        B = slopes[0][:, NX:]
        H, g = one.uu[0] + B.T @ one.xx[1] @ B, one.u[0] + B.T @ one.x[1]
        assert_close(policy.k[0], least(H, g, low, high), ALGEBRA)
        limited = (policy.k[0] <= low) | (policy.k[0] >= high)
        assert not policy.K[0][limited].any() and policy.K[0][~limited].all()


def least(H: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The minimum of ½ kᵀ H k + gᵀ k within limits, by trying every set of active ones."""
    found, value = np.zeros(N), np.inf
    for sides in product((0, 1, 2), repeat=N):
        at = np.array(sides)
        k, free = np.where(at == 1, low, np.where(at == 2, high, 0.0)), at == 0
        if free.any():
            k[free] = np.linalg.solve(H[np.ix_(free, free)], -(g + H @ k)[free])
        inside = np.all((k >= low - 1e-12) & (k <= high + 1e-12))
        if inside and 0.5 * k @ H @ k + g @ k < value:
            found, value = k, 0.5 * k @ H @ k + g @ k
    return found


def test_a_curvature_that_is_not_positive_is_told(rng: np.random.Generator) -> None:
    slopes, cost = problem(rng)
    cost.uu[3] = -100.0 * np.eye(N)
    assert backward(slopes, cost, -FREE, FREE, 0.0) is None
