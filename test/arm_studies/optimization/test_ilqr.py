# SPDX-License-Identifier: Apache-2.0
"""iLQR against gradients of rollouts, closed forms, and the simulator step by step."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from arm_dynamics import InvalidInput, load_scene
from arm_sim import SimulationDiverged, Simulator
from arm_studies.optimization import ILQR, Phase, QuadraticCost, Trajectory
from arm_studies.optimization.backward import Policy, backward
from arm_studies.optimization.cost import Expansion
from arm_studies.optimization.forward import Baseline, Forward
from tolerances import ALGEBRA, assert_close

NODES, DT = 40, 0.01
SLOPE = 1e-7
"""What is left of a gradient at a minimum, relative to the gradient of the guess."""


def arm(name: str = "two_link", dt: float = DT, **joint: Any) -> Simulator:
    scene = load_scene(name).model_dump(exclude_unset=True)
    scene["joints"] = scene.get("joints", {}) | {"*": {"limits": {"stop": False}} | joint}
    return Simulator(scene, integrator="rk4", dt=dt)


def to_goal(sim: Simulator, goal: np.ndarray, nodes: int = NODES) -> QuadraticCost:
    nx, n = sim.arm.plant.nx, sim.n
    weight = np.full((nodes + 1, nx), 1e-3)
    weight[-1, : 2 * n] = 100.0
    x = np.zeros((nodes + 1, nx))
    x[:, : 2 * n] = goal
    return QuadraticCost(x, weight, np.zeros((nodes, n)), np.full((nodes, n), 1e-3))


def gradient(sim: Simulator, cost: QuadraticCost, at: Trajectory) -> np.ndarray:
    """The cost's gradient by all commands, by adjoints of the whole motion."""
    n = sim.n
    g = (cost.x_weight * (at.x - cost.x))[None, :, : 2 * n]
    start = at.x[0]
    found = sim.rollout_gradient(start[None, :n], start[None, n : 2 * n], at.u[None], len(at.u), g)
    return np.asarray(found.tau[0] + cost.u_weight * (at.u - cost.u))


def goal_of(sim: Simulator) -> np.ndarray:
    return np.r_[sim.arm.x[: sim.n] + 0.5, np.zeros(sim.n)]


def test_at_the_end_the_gradient_of_the_motion_is_zero() -> None:
    sim = arm()
    cost = to_goal(sim, goal_of(sim))
    optimizer = ILQR([Phase(sim, NODES)], cost, tolerance=1e-13)
    guess = optimizer.start(sim.arm.x, np.zeros((NODES, sim.n)))
    best = optimizer.solve(sim.arm.x, guess.u)
    assert best.verdict == "converged" and list(best.costs) == sorted(best.costs, reverse=True)
    left = abs(gradient(sim, cost, best)).max() / abs(gradient(sim, cost, guess)).max()
    assert left < SLOPE


def test_at_limits_the_gradient_points_out_and_elsewhere_it_is_zero() -> None:
    sim = arm()
    cost = to_goal(sim, goal_of(sim))
    free = ILQR([Phase(sim, NODES)], cost).solve(sim.arm.x, np.zeros((NODES, sim.n)))
    most = 0.6 * abs(free.u).max(axis=0)
    optimizer = ILQR([Phase(sim, NODES)], cost, low=-most, high=most, tolerance=1e-13)
    best = optimizer.solve(sim.arm.x, np.zeros((NODES, sim.n)))
    slope, scale = gradient(sim, cost, best), abs(gradient(sim, cost, free)).max() + 1.0
    above, below = best.u >= most, best.u <= -most
    assert (above | below).any() and (abs(best.u) <= most).all()
    assert best.cost > free.cost
    assert (slope[above] <= 0.0).all() and (slope[below] >= 0.0).all()
    assert abs(slope[~above & ~below]).max() < 1e-6 * scale


def test_all_arms_have_the_parameters_of_the_simulator() -> None:
    scene = load_scene("two_link").model_dump(exclude_unset=True) | {"tunable": ["gravity"]}
    sim = Simulator(scene, integrator="rk4", dt=DT)
    sim.set_parameter("gravity", [0.0, 0.0, -3.0])
    u = np.zeros((NODES, sim.n))
    still = Policy(u, np.zeros((NODES, sim.n, 2 * sim.n)), 0.0)
    x, used = np.tile(sim.arm.x, (20, NODES + 1, 1)), np.empty((20, NODES, sim.n))
    baseline = Baseline(np.tile(sim.arm.x, (NODES, 1)), u, still, u - 1.0, u + 1.0)
    Forward(sim).follow(baseline, np.ones(20), x, used)
    assert np.array_equal(x[-1, :, : sim.n], sim.run(NODES * DT).q)


def test_a_quadratic_problem_takes_one_improvement() -> None:
    # A mass on a rail: linear equations, which RK4 integrates exactly.
    scene = load_scene("cart_pendulum").model_dump(exclude_unset=True)
    scene["robot"]["lock"] = ["hinge"]  # and phases from a generator, a cost of lists
    sim = Simulator(scene, integrator="rk4", dt=DT)
    cost = to_goal(sim, np.array([0.3, 0.0]))
    cost = replace(cost, u=cost.u + 0.2)
    numbers: Any = (cost.x, cost.x_weight, cost.u, cost.u_weight)
    listed = QuadraticCost(*(array.tolist() for array in numbers))
    optimizer = ILQR((Phase(sim, nodes) for nodes in (15, NODES - 15)), listed)
    guess = replace(optimizer.start(sim.arm.x, np.zeros((NODES, 1))), damping=0.0)
    best = optimizer.improve(guess)
    left = abs(gradient(sim, cost, best)).max() / abs(gradient(sim, cost, guess)).max()
    assert left < 1e-9


def test_states_of_laws_are_part_of_what_is_optimized() -> None:
    scene = load_scene("motor_pendulum").model_dump(exclude_unset=True)
    swing = scene["joints"]["swing"]
    swing["friction"], swing["limits"] = {"viscous": 0.05}, {"stop": False}
    swing["actuator"]["efficiency"] = 1.0
    sim = Simulator(scene, integrator="rk4", dt=1e-3)
    assert sim.arm.plant.nz == 1  # the current
    cost = to_goal(sim, np.array([sim.arm.x[0] + 2e-3, 0.0]))
    cost = replace(cost, x_weight=cost.x_weight * [1.0, 1.0, 0.0])
    optimizer = ILQR([Phase(sim, NODES)], cost, tolerance=1e-13)
    guess = optimizer.start(sim.arm.x, np.zeros((NODES, 1)))
    best = optimizer.solve(sim.arm.x, guess.u)
    left = abs(gradient(sim, cost, best)).max() / abs(gradient(sim, cost, guess)).max()
    assert left < SLOPE and abs(best.x[1:, 2]).min() > 0.0


def test_feedback_brings_an_arm_back() -> None:
    sim = arm()
    optimizer = ILQR([Phase(sim, NODES)], to_goal(sim, goal_of(sim)))
    best = optimizer.solve(sim.arm.x, np.zeros((NODES, sim.n)))
    beside = best.x[0] + 0.05
    led, left_alone = optimizer.moved(best, beside), optimizer.start(beside, best.u)
    off, without = (abs(t.x[-1] - best.x[-1]).max() for t in (led, left_alone))
    assert off < 0.2 * without
    wanted = best.u + np.einsum("kij,kj->ki", best.feedback, led.x[:-1] - best.x[:-1])
    assert_close(led.u, wanted, 1e-12)


def test_what_an_arm_carries_may_change_between_phases() -> None:
    scene = load_scene("two_link").model_dump(exclude_unset=True)
    tip = Simulator("two_link").model.frame_names[-1]
    part = {"payloads": [{"frame": tip, "mass": 1.0}]}
    empty, loaded = (Simulator(s, integrator="rk4", dt=DT) for s in (scene, scene | part))
    phases = [Phase(empty, 15), Phase(loaded, NODES - 15)]
    optimizer = ILQR(phases, to_goal(empty, goal_of(empty)))
    best = optimizer.solve(empty.arm.x, np.zeros((NODES, 2)))
    empty.run(15 * DT, best.u[:15])
    np.testing.assert_array_equal(empty.arm.x, best.x[15])
    loaded.reset(empty.arm.x[:2], empty.arm.x[2:])
    loaded.run((NODES - 15) * DT, best.u[15:])
    np.testing.assert_array_equal(loaded.arm.x, best.x[-1])
    assert best.verdict == "converged"


def test_a_guess_that_rests_at_a_stop_is_improved() -> None:
    scene = load_scene("two_link").model_dump(exclude_unset=True)
    q = Simulator(scene).arm.x[:2]
    stops = {"lower": q[0], "upper": q[0] + 1.0}
    scene["joints"] = {Simulator(scene).joint_names[0]: {"limits": stops}}
    sim = Simulator(scene, integrator="rk4", dt=DT)
    cost, guess = to_goal(sim, goal_of(sim)), np.tile([-5.0, 0.0], (NODES, 1))
    best = ILQR([Phase(sim, NODES)], cost).solve(sim.arm.x, guess, iterations=10)
    assert best.cost < 0.2 * best.costs[0] and best.x[:, 0].min() == q[0]


def dry_arm() -> tuple[Simulator, np.ndarray]:
    """An arm with dry friction, and commands under which it stays at rest."""
    sim = arm(friction={"viscous": 0.1, "coulomb": 0.4, "static": 0.6})
    return sim, np.tile(sim.dynamics.gravity(sim.arm.x[: sim.n]), (NODES, 1))


def test_with_dry_friction_no_motion_nearby_is_better_at_the_end(rng: np.random.Generator) -> None:
    sim, still = dry_arm()
    cost, phases = to_goal(sim, goal_of(sim)), [Phase(sim, NODES)]
    rough = ILQR(phases, cost, smoothing=0.1).solve(sim.arm.x, still)
    optimizer = ILQR(phases, cost, tolerance=1e-13)
    best = optimizer.solve(sim.arm.x, rough.u)
    assert best.cost <= rough.cost < 0.3 * rough.costs[0]
    for way in rng.normal(size=(20, *best.u.shape)):
        near = [optimizer.start(sim.arm.x, best.u + h * way).cost for h in (-1e-4, 1e-4)]
        assert min(near) > best.cost * (1.0 - 1e-9)


def test_a_joint_that_friction_holds_needs_smooth_derivatives() -> None:
    sim, still = dry_arm()
    cost, phases = to_goal(sim, goal_of(sim)), [Phase(sim, NODES)]
    held = ILQR(phases, cost).solve(sim.arm.x, still)
    moved = ILQR(phases, cost, smoothing=0.1).solve(sim.arm.x, still)
    assert (held.x == held.x[0]).all() and held.verdict == "stuck"
    assert moved.cost < 0.3 * held.cost


def test_what_is_refused() -> None:
    sim = arm()
    cost = to_goal(sim, goal_of(sim))
    phases, optimizer = [Phase(sim, 5)], ILQR([Phase(sim, NODES)], cost)

    limits = "low is above high, or beyond the scene's limits"
    refused: dict[str, Callable[[], object]] = {
        "at least one": lambda: ILQR([], cost),
        "same joints": lambda: ILQR([*phases, Phase(arm("pendulum"), 5)], cost),
        "smoothing is 0.0; a positive number": lambda: ILQR(phases, cost, smoothing=0.0),
        "the arm has contacts":
            lambda: ILQR([Phase(Simulator("panda_table"), 5)], cost, smoothing=0.1),
        limits: lambda: ILQR(phases, cost, low=[1.0, -1.0], high=[-1.0, 1.0]),
        f"({limits})": lambda: ILQR(phases, cost, low=1e9),
        r"u has shape \(3, 2\)": lambda: optimizer.start(sim.arm.x, np.zeros((3, 2))),
        "the cost has x and u of shapes .* needs ":
            lambda: ILQR([Phase(sim, 1)], cost).solve(sim.arm.x, np.zeros((1, 2))),
        "x_weight contains -100; allowed": lambda: replace(cost, x_weight=-cost.x_weight),
        "u_weight contains nan; allowed": lambda: replace(cost, u_weight=np.nan * cost.u_weight),
        "equal ones of": lambda: replace(cost, x_weight=cost.x_weight[:, 1:]),
        "one more is expected": lambda: QuadraticCost(cost.u, cost.u, cost.u, cost.u_weight),
    }  # fmt: skip
    for said, call in refused.items():
        with pytest.raises(InvalidInput, match=said):
            call()
    with pytest.raises(SimulationDiverged):
        optimizer.start(np.array([0.0, 0.0, 1e140, 1e140]), np.zeros((NODES, 2)))


# --- the backward pass -------------------------------------------------------------------------

STAGES, NX, N = 6, 4, 3
FREE = np.full((STAGES, N), np.inf)


def positive(rng: np.random.Generator, count: int, size: int) -> np.ndarray:
    root = rng.normal(size=(count, size, size))
    return root @ root.transpose(0, 2, 1) + 0.1 * np.eye(size)


def quadratic(rng: np.random.Generator) -> tuple[np.ndarray, Expansion]:
    cost = Expansion(
        rng.normal(size=(STAGES + 1, NX)), positive(rng, STAGES + 1, NX),
        rng.normal(size=(STAGES, N)), positive(rng, STAGES, N),
    )  # fmt: skip
    return 0.6 * rng.normal(size=(STAGES, NX, NX + N)), cost


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


def test_the_predicted_change_is_what_the_model_gives(rng: np.random.Generator) -> None:
    slopes, cost = quadratic(rng)
    policy = backward(slopes, cost, np.full((STAGES, N), -0.1), np.full((STAGES, N), 0.2), 0.3)
    assert policy is not None
    change = model(cost, *followed(slopes, policy, np.zeros(NX)))
    assert_close(np.array(policy.change), np.array(change), ALGEBRA)
    assert policy.change < 0.0


def test_with_limits_it_is_the_best_of_all_sets_of_active_ones(rng: np.random.Generator) -> None:
    for _ in range(20):
        slopes, cost = quadratic(rng)
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
    slopes, cost = quadratic(rng)
    cost.uu[3] = -100.0 * np.eye(N)
    assert backward(slopes, cost, -FREE, FREE, 0.0) is None
