# SPDX-License-Identifier: Apache-2.0
"""Accelerations of joints at rest: as the simulator begins, and by trying all sets."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from samples import sampled
from scipy.optimize import linprog

import models
from arm_dynamics import Dynamics, load_scene
from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.dynamics.indeterminate_sets import indeterminate_sets
from arm_dynamics.dynamics.stiction import States, Stiction
from arm_sim import Simulator
from models.touching import rails
from tolerances import ALGEBRA, CLOSED_FORM, assert_close

FRICTION: dict[str, dict[str, Any]] = {
    "static above sliding": {"friction": {"coulomb": 2.0, "static": 3.0, "viscous": 0.1}},
    "by direction": {"friction": {"coulomb": {"positive": 2.0, "negative": 1.0}}},
    "by position and load": {
        "friction": {
            "coulomb": 2.0,
            "position": {"at": [-2.0, 0.0, 2.0], "factor": [0.5, 1.0, 1.5]},
            "load": {"at": [0.0, 20.0], "factor": [1.0, 2.0]},
        }
    },
    "gear": {
        "friction": {"coulomb": 0.5},
        "actuator": {"efficiency": 0.8, "rotor_inertia": 1e-4, "gear_ratio": 50.0},
    },
}


def scene(name: str, joint: dict[str, Any]) -> Any:
    given = models.scene(name).model_dump(exclude_unset=True)
    return load_scene(given | {"joints": {"*": {**joint, "limits": {"stop": False}}}})


def states(dyn: Dynamics, count: int, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Random states; some joints are at rest, torques are near what the arm's weight asks for."""
    q, v, push = rng.normal(size=(3, count, dyn.n))
    v[rng.random(v.shape) < 0.6] = 0.0
    return q, v, dyn.gravity(q) + 3.0 * push


@pytest.mark.parametrize("friction", FRICTION)
@pytest.mark.parametrize("name", sampled(["skew_axes", "two_link", "panda"], 1))
def test_forward_is_how_a_tick_begins(name: str, friction: str, rng: np.random.Generator) -> None:
    dt = 1e-6
    sim = Simulator(scene(name, FRICTION[friction]), integrator="rk4", dt=dt)
    dyn = sim.dynamics
    limit = dyn.model.command_limit
    stuck = loose = 0
    for q, v, tau in zip(*states(dyn, 10, rng), strict=True):
        tau = np.clip(tau, -limit, limit)
        a = dyn.forward(q, v, tau)
        sim.reset(q, v)
        sim.step(tau)
        assert_close((sim.state.v - v) / dt, a, 1e-4)
        at_rest = v == 0.0
        np.testing.assert_array_equal(a[at_rest] == 0.0, sim.state.v[at_rest] == 0.0)
        stuck += np.sum(a[at_rest] == 0.0)
        loose += np.sum(a[at_rest] != 0.0)
    assert min(stuck, loose) > 1


def brute_force(M: np.ndarray, load: np.ndarray, level: np.ndarray) -> np.ndarray:
    """The one choice of sticking and sliding, either way, that obeys, for joints all at rest."""
    found = []
    for ways in product((-1.0, 0.0, 1.0), repeat=len(load)):
        way = np.array(ways)
        slides = way != 0.0
        a = np.zeros(len(load))
        free = load - way * level
        a[slides] = np.linalg.solve(M[np.ix_(slides, slides)], free[slides])
        held = abs((load - M @ a)[~slides]) <= level[~slides]
        if held.all() and (a * way >= 0.0)[slides].all():
            found.append(a)
    assert len(found) == 1
    return np.asarray(found[0])


def test_joints_at_rest_are_one_complementarity_problem(rng: np.random.Generator) -> None:
    """Coulomb's law at three joints at rest, against all sets tried one by one."""
    dyn = Dynamics(scene("skew_axes", {"friction": {"coulomb": 1.0}}))
    level, still = np.ones(dyn.n), np.zeros(dyn.n)
    moved = 0
    for q, push in rng.normal(size=(20, 2, dyn.n)):
        tau = dyn.gravity(q) + 1.5 * push
        wanted = brute_force(dyn.mass_matrix(q), 1.5 * push, level)
        assert_close(dyn.forward(q, still, tau), wanted, ALGEBRA)
        moved += wanted.any()
    assert 2 < moved < 20


def test_joints_that_would_change_their_modes_in_a_circle_are_settled() -> None:
    """By the largest violation, this choice of sticking joints comes back to itself for ever."""
    M = np.array([[4, -4, -4, -2], [-4, 8, -2, 4], [-4, -2, 14, 0], [-2, 4, 0, 7]], dtype=float)
    tau, still, none = np.array([[-5.0, 6.0, 1.0, -4.0]]), np.zeros((1, 4)), np.zeros((1, 0))
    model = Dynamics(scene("skew_axes", {"friction": {"coulomb": 1.0}})).model
    points = States(still, still, tau, M[None], still, none[:, :, None] * still, none, 0)
    (a,), _ = Stiction(SteadyFriction.of(model)).motion(points)
    assert_close(a, brute_force(M, tau[0], np.ones(4)), ALGEBRA)


def test_one_joint_at_its_level_by_hand() -> None:
    """2 kg on a rail: stays up to F_s exactly, then starts under F_c."""
    rail = rails("x", mass=2.0, friction={"coulomb": 3.0, "static": 4.0})
    dyn = Dynamics(load_scene(rail))
    for push, wanted in ((0.0, 0.0), (4.0, 0.0), (-4.0, 0.0), (5.0, 1.0), (-5.0, -1.0)):
        assert_close(dyn.forward([0.0], [0.0], [push]), [wanted], CLOSED_FORM)
    assert_close(dyn.forward([0.0], [1e-9], [4.0]), [0.5], CLOSED_FORM)


def crank_rocker(speed: float) -> tuple[Simulator, np.ndarray, np.ndarray]:
    """A crank-rocker whose crank and coupler are in line: the rocker turns back."""
    given = models.scene("four_bar").model_dump(exclude_unset=True)
    friction = {"friction": {"coulomb": 1.0}, "limits": {"stop": False}}
    sim = Simulator(load_scene(given | {"joints": {"*": friction}}), integrator="rk4", dt=1e-7)
    crank = np.arccos(0.22 / 0.28)  # 0.4 m in line, the rocker 0.25 m, pivots 0.35 m apart
    rocker = np.arctan2(0.4 * np.sin(crank), 0.4 * np.cos(crank) - 0.35)
    angle = {"crank_pivot": crank, "knee": 0.0, "rocker_pivot": rocker}
    q = np.array([angle[name] for name in sim.joint_names])
    rates = {"crank_pivot": speed, "knee": -speed * 0.4 / 0.3, "rocker_pivot": 0.0}
    return sim, q, np.array([rates[name] for name in sim.joint_names])


@pytest.mark.parametrize("speed", [10.0, -10.0])
def test_a_moving_loop_takes_a_joint_along_that_passes_through_rest(speed: float) -> None:
    """Friction acts on each joint against its motion; that of the rocker against the way it is
    about to go.
    """
    sim, q, v = crank_rocker(speed)
    sim.reset(q, v)
    assert_close(sim.state.v, v, CLOSED_FORM)
    a, _ = sim.dynamics.constrained_forward(q, v, np.zeros(sim.n))
    sim.step(np.zeros(sim.n))
    assert_close((sim.state.v - v) / 1e-7, a, 1e-4)
    assert abs(a).min() > 10.0


def test_batches_of_loops_answer_as_single_points_do() -> None:
    """At rest, held or beginning to move either way, and passing through rest either way."""
    sim, q, v = crank_rocker(10.0)
    pushes = [0.0, 12.0, 0.0, -12.0, 0.0, 1.0]
    batch = (
        np.tile(q, (6, 1)), np.outer([0, 0, 1, 0, -1, 0], v),
        np.outer(pushes, np.eye(sim.n)[0]) + sim.dynamics.gravity(q),
    )  # fmt: skip
    a, multipliers = sim.dynamics.constrained_forward(*batch)
    for k, point in enumerate(zip(*batch, strict=True)):
        alone, forces = sim.dynamics.constrained_forward(*point)
        assert_close(a[k], alone, ALGEBRA)
        assert_close(multipliers[k], forces, ALGEBRA)
    moves = [bool(row.any()) for row in a]
    assert moves == [False, True, True, True, True, False]


@pytest.mark.parametrize(("push", "a"), [(3.999, 0.0), (-3.999, 0.0), (4.4, 0.6), (-4.4, -0.6)])
def test_coupled_joints_hold_up_to_the_sum_of_their_static_levels(push: float, a: float) -> None:
    """2 kg on two rails of equal ways, pushed along one; 2 N hold and 1 N slides on each."""
    gear = {"type": "coupling", "joints": ["z", "x"], "ratio": 1.0}
    rail = rails("xz", mass=2.0, friction={"coulomb": 1.0, "static": 2.0})
    dyn = Dynamics(rail | {"constraints": [gear], "gravity": [0, 0, 0]})
    found, _ = dyn.constrained_forward([0.0, 0.0], [0.0, 0.0], [push, 0.0])
    assert_close(found, [a, a], ALGEBRA)


def test_joints_of_a_loop_hold_together_up_to_the_limit_of_a_linear_program(
    rng: np.random.Generator,
) -> None:
    """Rows at random; the largest load that some multipliers keep within all static levels."""
    seen = 0
    for _ in range(20):
        A, level, tau = rng.normal(size=(2, 5)), rng.uniform(0.5, 2.0, 5), rng.normal(size=5)
        columns = np.hstack([tau[:, None], -A.T, A.T])
        found = linprog([-1.0, *np.zeros(4)], np.vstack([columns, -columns]), np.tile(level, 2))
        for factor, holds in ((1.0 - 1e-8, True), (1.0 + 1e-8, False)):
            load, held = found.x[0] * factor * tau, np.ones(5, dtype=bool)
            for each in indeterminate_sets(A, held, load, np.tile(level, (2, 1))):
                assert each.holds == holds and len(each.joints) == 5
                shared = load - A.T @ each.multipliers
                assert not holds or (abs(shared) <= level * (1.0 + 1e-8)).all()
                assert holds or each.direction @ load > 0.0
                seen += 1
    assert seen > 20


def test_sets_that_do_not_share_anything_are_apart() -> None:
    A = np.array([[1.0, -1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 2.0, 0.0]])
    load, level = np.array([1.5, 0.0, 4.0, 0.0, 0.0]), np.ones((2, 5))
    one, other = indeterminate_sets(A, np.ones(5, dtype=bool), load, level)
    assert one.joints.tolist() == [0, 1] and one.holds
    assert other.joints.tolist() == [2, 3] and not other.holds
