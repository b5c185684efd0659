# SPDX-License-Identifier: Apache-2.0
"""Events in the middle of long ticks, against the same motion computed piece by piece by SciPy."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import models
from arm_sim import Simulator
from models.touching import beside, contact, rails
from tolerances import CLOSED_FORM, assert_close

G = 9.81
PENDULUM = {"robot": {"urdf": str(models.SCENES / "pendulum.urdf")}}
Slope = Callable[[float, np.ndarray], Any]


def integral(slope: Slope, x: Any, start: float, end: float) -> np.ndarray:
    solved = solve_ivp(slope, (start, end), x, "DOP853", rtol=1e-12, atol=1e-14)
    return np.asarray(solved.y[:, -1])


def crossing(slope: Slope, x: Any, end: float, event: Callable[..., float]) -> tuple[float, Any]:
    """Instant at which ``event`` crosses zero, and the state there."""
    event.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(slope, (0, end), x, "DOP853", rtol=1e-12, atol=1e-14, events=event)
    return float(found.t_events[0][0]), found.y_events[0][0]


def test_a_spinning_arm_flings_its_elbow_loose() -> None:
    """A dry elbow holds until the centrifugal load exceeds its level, in the middle of a tick."""
    level, push = 0.6, 2.0
    scene = {
        "robot": {"urdf": str(models.SCENES / "two_link.urdf")},
        "gravity": [0, 0, 0],
        "joints": {"elbow": {"friction": {"coulomb": level}}},
    }
    sim = Simulator(scene, integrator="rk4", dt=5e-3)
    dyn, q0 = sim.dynamics, np.array([0.0, 0.7])
    sim.reset(q=q0, v=[0, 0])

    def locked(_: float, x: np.ndarray) -> list[float]:
        q, v = np.array([x[0], 0.7]), np.array([x[1], 0.0])
        return [x[1], (push - dyn.inverse(q, v, [0, 0])[0]) / dyn.mass_matrix(q)[0, 0]]

    def overload(t: float, x: np.ndarray) -> float:
        a = [locked(t, x)[1], 0.0]
        return abs(float(dyn.inverse([x[0], 0.7], [x[1], 0.0], a, terms=7)[1])) - level

    loose, at = crossing(locked, [0.0, 0.0], 3.0, overload)
    run = sim.run(loose + 0.1, [push, 0.0])
    held = run.time < loose
    assert held.sum() > 20
    assert (run.q[held, 1] == 0.7).all() and (run.v[held, 1] == 0.0).all()
    way = -np.sign(float(dyn.inverse([at[0], 0.7], [at[1], 0.0], [0.0, 0.0], terms=7)[1]))

    def free(_: float, x: np.ndarray) -> np.ndarray:
        tau = np.array([push, 0.0])
        bias = dyn.inverse(x[:2], x[2:], [0, 0], terms=7)
        return np.r_[x[2:], np.linalg.solve(dyn.mass_matrix(x[:2]), tau - bias - [0, way * level])]

    wanted = integral(free, [at[0], 0.7, at[1], 0.0], loose, run.time[-1])
    assert abs(wanted[1] - 0.7) > 1e-4
    assert_close(np.r_[run.q[-1], run.v[-1]], wanted, 1e-8)


@pytest.mark.parametrize("options", [
    {"integrator": "rk4", "dt": 0.02}, {"tolerance": 1e-10, "dt": 0.05},
], ids=str)  # fmt: skip
def test_a_bob_that_dips_within_a_tick_bounces_where_it_touches(options: dict[str, Any]) -> None:
    """Elastic, so that it swings back as it came: q(t) = free(2 t1 - t)."""
    for depth in (1e-6, 1e-9):
        floor = contact("bob", point=[0, 0, -1], restitution=1.0,
                        plane={"point": [0, 0, -1 + depth]})  # fmt: skip
        scene = {**PENDULUM, "initial": {"position": {"swing": -0.0101}}, "constraints": [floor]}
        sim = Simulator(scene, **options)
        sim.reset(q=[-0.0101], v=[1.0])
        state = sim.step([0.0])

        def slope(_: float, x: np.ndarray) -> list[float]:
            return [x[1], -G * np.sin(x[0])]

        def touch(_: float, x: np.ndarray, depth: float = depth) -> float:
            return float(x[0] + np.arccos(1 - depth))

        hits, _ = crossing(slope, [-0.0101, 1.0], 0.02, touch)
        wanted = integral(slope, [-0.0101, 1.0], 0.0, 2 * hits - sim.dt)
        assert_close([state.q[0], -state.v[0]], wanted, 1e-6)


SLIDES = {
    # Speed at the start [m/s], and push [N]; friction is 7.848 N.
    "from a creep": ([1e-6, 0.0], [0.0, 9.0]),
    "turned near the cone, and stopped": ([0.05, 0.0], [0.0, 7.0]),
    "fast": ([0.5, 0.2], [3.0, 9.0]),
    "reversed almost on its line": ([-0.01, 1e-5], [9.0, 1e-4]),
}
SLIDERS: list[tuple[dict[str, Any], float]] = [  # and what place and speed may be off by
    ({"integrator": "rk4", "dt": 1e-2}, 1e-7), ({"tolerance": 1e-12, "dt": 5e-3}, 1e-10),
]  # fmt: skip


@pytest.mark.parametrize(("v", "push"), SLIDES.values(), ids=SLIDES)
def test_sliding_that_turns(v: list[float], push: list[float]) -> None:
    """Friction µ g against the velocity while a push turns it: m v' = F - µ m g v/|v|."""
    mu, m = 0.4, 2.0

    def slope(_: float, x: np.ndarray) -> np.ndarray:
        return np.r_[x[2:], np.array(push) / m - mu * G * x[2:] / max(np.hypot(*x[2:]), 1e-12)]

    solved = solve_ivp(slope, (0, 0.1), [0, 0, *v], "Radau", rtol=1e-12, atol=1e-15).y[:, -1]
    for how, allowed in SLIDERS:
        sim = Simulator({**rails("xyz", m), "constraints": [contact("body", friction=mu)]}, **how)
        sim.reset(v=[*v, 0.0])
        run = sim.run(0.1, [*push, 0.0])
        assert np.abs(run.q[:, 2]).max() < 1e-15
        assert np.abs(run.q[-1, :2] - solved[:2]).max() < allowed
        if np.hypot(*solved[2:]) > 1e-6:
            assert np.abs(run.v[-1, :2] - solved[2:]).max() < allowed
        else:
            rests = (run.v == 0.0).all(axis=1)
            assert rests[-1] and (run.q[rests] == run.q[-1]).all()
        assert sim.state.time_stepped == 0


def test_friction_opposes_the_new_direction_of_a_creeping_block_that_is_struck() -> None:
    """Another block of 1 kg passes its speed on to it, early in a tick in which it creeps."""
    mu, dt, hit, push = 0.4, 1e-2, 1e-4, 9.0
    foot = contact("body", friction=mu)
    face = contact("other", plane={"frame": "body", "normal": [-1, 0, 0]}, restitution=1.0)
    scene = rails("xyz", branches=[beside(1.0)]) | {"constraints": [foot, face]}
    sim = Simulator(scene, integrator="rk4", dt=dt)
    sim.reset(q=[0, 0, 0, -hit, 0], v=[0, 1e-5, 0, 1.0, 0])
    struck = sim.step([0, push, 0, 0, 0]).v

    def slope(_: float, v: np.ndarray) -> np.ndarray:
        return np.array([0.0, push]) - mu * G * v / np.hypot(*v)

    wanted = integral(slope, [1.0, 1e-5 + (push - mu * G) * hit], hit, dt)
    assert_close(struck[:2], wanted, 1e-6)
    assert struck[3] == 0.0


def test_contacts_without_end_are_stepped_through_without_rebound() -> None:
    """Thousands of bounces in one tick are not followed; this is reported, and the body rests."""
    sim = Simulator({**rails("z"), "constraints": [contact("body", restitution=0.9999)]}, dt=1.0)
    sim.reset(q=[1e-6])
    state = sim.step([0.0])
    assert (state.q[0], state.v[0], state.time_stepped) == (0.0, 0.0, 1)


def test_rollouts_from_inside_a_plane_have_no_motion() -> None:
    """A nanometre is rounding; more has no answer, and the other arms do not notice."""
    sim = Simulator({**rails("z"), "constraints": [contact("body")]})
    motion = sim.rollout([[0.0], [-5e-10], [-1e-6], [0.1]], np.zeros((4, 1)), [0.0], 10)
    assert np.isfinite(motion[[0, 1, 3]]).all()
    assert np.isnan(motion[2, 1:]).all() and motion[2, 0, 0] == -1e-6
    assert_close(motion[3, -1], [0.1 - 0.5 * G * 1e-4, -G * 1e-2], CLOSED_FORM)
    np.testing.assert_array_equal(motion[0], np.zeros((11, 2)))
