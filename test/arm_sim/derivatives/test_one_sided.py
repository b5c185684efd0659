# SPDX-License-Identifier: Apache-2.0
"""Ticks without a derivative: refused by name, and their one-sided derivatives on request."""

from typing import Any

import numpy as np
import pytest
from samples import covering

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array
from arm_sim import NotDifferentiable, Simulator
from arm_sim.state import State
from models.rotor import rotor
from models.touching import contact, rails
from tolerances import assert_close

J, H = 0.1, 1e-3
DIFFERENCE = 1e-6
"""Derivatives against one-sided differences of the state after a tick."""


def wheel(effort: float = 1e9, drive: Any = None, **friction: Any) -> dict[str, Any]:
    """A wheel of ``J`` without weight."""
    scene = rotor(J, effort, **friction)
    scene["joints"]["axle"] |= drive or {}
    return {**scene, "gravity": [0, 0, 0]}


def geared(**actuator: Any) -> dict[str, Any]:
    return wheel(drive={"actuator": {"rotor_inertia": 1e-5, "gear_ratio": 30.0, **actuator}})


BETWEEN = "held at rest by a load between its sliding and its static level"
# Scene, position, velocity, internal states, torque; why it is refused; the sides on which there
# are derivatives.
CASES: dict[str, tuple[Any, list[float], list[float], Any, list[float], str, tuple[int, ...]]] = {
    "held between its levels": (
        wheel(coulomb=1.0, static=2.0), [0.0], [0.0], None, [1.5], BETWEEN, (-1,),
    ),
    "held to the limit": (
        wheel(coulomb=1.0), [0.0], [0.0], None, [1.0], "joint 'axle' is on the boundary", (1, -1),
    ),
    "without load in a moving lossy gear": (
        geared(efficiency=0.7), [0.0], [0.3], None, [0.0], "'axle' moves without load", (1, -1),
    ),
    "the current of a torque at its limit": (
        geared(torque_constant=0.05, current_limit=1.0, efficiency=0.9), [0.0], [0.3], None, [1.5],
        "'axle' is exactly at its limit, 1.5", (1, -1),
    ),
    "on the torque-speed curve": (
        geared(torque_constant=0.05, voltage_limit=2.0, resistance=1.0), [0.0], [0.5], None,
        [1.875], "a limit, backlash or load of the drive of joint 'axle'", (1, -1),
    ),
    "at rest in friction by direction": (
        wheel(viscous={"positive": 0.2, "negative": 0.5}), [0.0], [0.0], None, [0.3],
        "'axle' is at rest in friction that differs by direction", (1, -1),
    ),
    "at rest on bent bristles": (
        wheel(coulomb=1.0, viscous=1.0, lugre={"sigma0": 100.0, "sigma1": 1.0}), [0.0], [0.0],
        [4e-3], [0.3], "'axle' is at rest in bent bristles", (1, -1),
    ),
}  # fmt: skip


def place(sim: Simulator, name: str) -> tuple[State, np.ndarray]:
    _, q, v, z, tau, *_ = CASES[name]
    return sim.reset(q, v, z), np.array(tau)


def difference(sim: Simulator, start: State, tau: np.ndarray, side: int) -> np.ndarray:
    """One-sided differences by every entry of state and torque."""
    x, n, h = np.concatenate([start.q, start.v, start.z]), sim.n, side * DIFFERENCE

    def after(dx: Any, du: Any) -> np.ndarray:
        sim.reset(*np.split(x + dx, (n, 2 * n)))
        end = sim.step(tau + du)
        return np.concatenate([end.q, end.v, end.z])

    rest, columns = after(0.0, 0.0), []
    for k in range(len(x) + n):
        push = h * np.eye(len(x) + n)[k]
        columns.append((after(push[: len(x)], push[len(x) :]) - rest) / h)
    return np.column_stack(columns)


SMOOTH_BESIDE = [name for name in CASES if "bristles" not in name]
# Beside it a joint turns back within the tick: derivatives under error control do not settle.
TURNS_BACK = "at rest in friction by direction"
AT_A_LIMIT = "the current of a torque at its limit"


@pytest.mark.parametrize(
    ("name", "options"),
    [("at rest on bent bristles", {"integrator": "rk4"}),
     (TURNS_BACK, {"integrator": "rk4"}),
     *covering([name for name in SMOOTH_BESIDE if name != TURNS_BACK],
               [{"integrator": "rk4"}, {"tolerance": 1e-12}])],
    ids=str,
)  # fmt: skip
def test_refused_by_name_and_one_sided_on_request(name: str, options: dict[str, Any]) -> None:
    scene, *_, why, sides = CASES[name]
    sim = Simulator(scene, dt=H, **options)
    start, tau = place(sim, name)
    with pytest.raises(NotDifferentiable, match=why):
        sim.linearize(start, tau)
    for side in (1, -1):
        if side not in sides:
            with pytest.raises(NotDifferentiable, match="by the velocity of joint 'axle'"):
                sim.linearize(start, tau, side=side)
            continue
        A, B = sim.linearize(start, tau, side=side)
        wanted = difference(sim, start, tau, side)
        assert abs(np.hstack([A, B]) - wanted).max() < 100.0 * DIFFERENCE


@pytest.mark.parametrize("name", ["held between its levels", AT_A_LIMIT, TURNS_BACK])
def test_products_are_those_of_the_same_matrices(name: str, rng: np.random.Generator) -> None:
    """To rounding, of every function, and all of them refuse the same ticks."""
    scene, *_, sides = CASES[name]
    sim = Simulator(scene, dt=H)
    start, tau = place(sim, name)
    dx, du, w = (rng.normal(size=k) for k in (len(sim.arm.x), sim.n, len(sim.arm.x)))
    with pytest.raises(NotDifferentiable):
        sim.jvp(start, tau, dx, du)
    with pytest.raises(NotDifferentiable):
        sim.vjp(start, tau, w)
    for side in sides:
        A, B = sim.linearize(start, tau, side=side)
        assert_close(sim.jvp(start, tau, dx, du, side=side), A @ dx + B @ du, 1e-15)
        by_x, by_u = sim.vjp(start, tau, w, side=side)
        assert_close(by_x, A.T @ w, 1e-15)
        assert_close(by_u, B.T @ w, 1e-15)


@pytest.mark.parametrize("name", ["held between its levels", AT_A_LIMIT])
def test_many_arms_and_rollouts_refuse_the_one_that_has_none(name: str) -> None:
    """Beside an arm that turns, the second one; bristles of a rollout are not bent at first."""
    scene, q, v, _, tau, why, sides = CASES[name]
    sim = Simulator(scene, dt=H)
    q0, v0 = np.array([[0.3], q]), np.array([[1.0], v])
    taus, g = np.array([[0.9 * tau[0] + 0.05], tau]), np.ones((2, 2, 2))
    with pytest.raises(NotDifferentiable, match=f"arm 1: .*{why}"):
        sim.linearize_many(q0, v0, taus)
    with pytest.raises(NotDifferentiable, match=f"arm 1, time step 0: .*{why}"):
        sim.rollout_gradient(q0, v0, taus, 1, g)
    with pytest.raises(NotDifferentiable, match=f"arm 1: .*{why}"):
        sim.rollout_jvp(q0, v0, taus, 1, v0, v0, taus)
    for side in sides:
        A, B = sim.linearize_many(q0, v0, taus, side=side)
        one = sim.linearize(sim.reset(q, v), tau, side=side)
        assert_close(A[1], one[0], 1e-15)
        assert_close(B[1], one[1], 1e-15)
        gradient = sim.rollout_gradient(q0, v0, taus, 1, g, side=side)
        assert_close(gradient.tau[1], np.ones(2) @ one[1][:2], 1e-15)
        change = sim.rollout_jvp(q0, v0, taus, 1, 0 * q0, 0 * v0, np.ones((2, 1)), side=side)
        assert_close(change[1, 1], one[1][:2, 0], 1e-15)


@pytest.mark.parametrize(
    ("voltage", "options"), [(9.0, {}), (1.0, {"integrator": "rk4"}), (-6.0, {})], ids=str
)
def test_a_current_at_its_limit_is_led_back_there_or_leaves(
    voltage: float, options: dict[str, Any]
) -> None:
    """From below the limit, the only side there is; the voltage holds it there, or reverses it."""
    motor = {
        "command": "voltage", "resistance": 1.0, "inductance": 1e-3, "torque_constant": 0.05,
        "current_limit": 2.0, "gear_ratio": 10.0,
    }  # fmt: skip
    sim = Simulator(wheel(drive={"actuator": motor}), dt=H, **options)
    sim.run(0.01, [9.0])
    at = sim.state
    assert_close(at.z, [2.0], 1e-12)

    def end(drop: float) -> Array:
        sim.reset(at.q, at.v, at.z - drop)
        sim.step([voltage])
        return sim.arm.x.copy()

    column = -(4.0 * end(1e-4) - 3.0 * end(0.0) - end(2e-4)) / 2e-4
    sim.reset(at.q, at.v, at.z)
    A, B = sim.linearize(sim.state, [voltage])
    assert_close(A[:, 2], column, 1e-7)
    if voltage == 9.0:
        assert not A[:, 2].any() and not B.any()  # saturated for the whole tick
    else:
        higher, lower = (sim.linearize(at, [voltage + d])[0][:, 2] for d in (1e-9, -1e-9))
        assert_close(A[:, 2], 0.5 * (higher + lower), 1e-7)
        assert B[1, 0] > 0.0
    for side in (-1, 1):
        assert_close(sim.linearize(at, [voltage], side=side)[0], A, 0.0)


def test_a_joint_that_has_come_to_rest_is_held_in_all_motions_nearby() -> None:
    """It stops under a load between its levels: a rollout has a gradient, by differences too."""
    sim = Simulator(wheel(coulomb=1.0, static=2.0), dt=H)
    q0, v0, tau = np.zeros((1, 1)), np.array([[0.0173]]), np.full((1, 8, 1), -1.5)
    tau[0, 4:] = 1.5
    assert sim.rollout(q0, v0, tau, 8)[0, 4:, 1].tolist() == [0.0] * 5
    g = np.zeros((1, 9, 2))
    g[0, -1, 0] = 1.0
    gradient = sim.rollout_gradient(q0, v0, tau, 8, g)
    ends = [sim.rollout(q0, v0 + s * 1e-6, tau, 8)[0, -1, 0] for s in (-1, 1)]
    assert_close(gradient.v0[0, 0], (ends[1] - ends[0]) / 2e-6, 1e-6)
    assert gradient.tau[0, 4:].tolist() == [[0.0]] * 4


LOOP = {
    "joints": {"*": {"friction": {"coulomb": 1.0, "static": 2.0}}}, "gravity": [0, 0, 0],
    "constraints": [{"type": "coupling", "joints": ["x", "z"], "ratio": 1.0}],
}  # fmt: skip
FOOT = {
    "constraints": [contact("body", friction=0.2, static_friction=0.4)],
    "gravity": [0, 0, -10.0],
}


@pytest.mark.parametrize(
    ("holds", "why"), [(LOOP, BETWEEN), (FOOT, "contact 'contact_0' is held by a load between")]
)
def test_loops_and_contacts_are_held_as_a_whole(holds: dict[str, Any], why: str) -> None:
    """Two masses on a cord, of which one is pulled, both stay; so does a body on its foot."""
    sim = Simulator(rails("xz") | holds, dt=H, integrator="rk4")
    rest = sim.reset([0.0, 0.0], [0.0, 0.0])
    assert not sim.linearize(rest, [1.9, 0.0])[0][2:].any()
    with pytest.raises(NotDifferentiable, match=why):
        sim.linearize(rest, [2.1, 0.0])


def test_where_there_is_a_derivative_sides_agree_to_the_bit() -> None:
    """At rest on bristles that are not bent."""
    sim = Simulator(CASES["at rest on bent bristles"][0], dt=H, integrator="rk4")
    start = sim.reset([0.1], [0.0])
    whole = sim.linearize(start, [0.0])
    for side in (1, -1):
        for one, both in zip(sim.linearize(start, [0.0], side=side), whole, strict=True):
            np.testing.assert_array_equal(one, both)


@pytest.mark.parametrize("side", [0, True])
def test_other_sides_are_refused(side: Any) -> None:
    sim = Simulator(wheel(), dt=H)
    with pytest.raises(InvalidInput, match="side = .*allowed: 1, -1 or None"):
        sim.linearize(sim.state, [0.0], side=side)


@pytest.mark.parametrize("options", [{"integrator": "rk4"}, {"tolerance": 1e-12}], ids=str)
def test_along_a_motion_no_tick_is_refused(options: dict[str, Any]) -> None:
    """What has no derivative is given one between those of both sides."""
    sim = Simulator(CASES[AT_A_LIMIT][0], dt=H, **options)
    start, tau = place(sim, AT_A_LIMIT)
    linearizer = sim.arm.compiled.derivatives.linearizer()
    along = linearizer.jacobians_along(sim.arm.x[None], tau[None], 1)[0]
    sides = [np.hstack(sim.linearize(start, tau, side=side)) for side in (1, -1)]
    assert (np.min(sides, axis=0) - 1e-12 <= along).all()
    assert (along <= np.max(sides, axis=0) + 1e-12).all()
