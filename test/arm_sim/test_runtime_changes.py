# SPDX-License-Identifier: Apache-2.0
"""Payload, friction and forces that change while the simulation runs."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmError, ArmModel, Dynamics, InvalidInput, SceneError, Term, load_scene
from arm_dynamics.task_space import TaskSpace
from arm_sim import Simulator
from arm_sim.external_wrench import ExternalWrenches
from arm_sim.simulation.runtime_changes import external_change, friction_change, payload_change
from tolerances import ALGEBRA, BACKENDS, PINOCCHIO, assert_close

CORD = {"frames": ["forearm", "upper_arm"], "points": [[0.15, 0, 0.02], [0.2, 0, 0.1]],
        "stiffness": 120.0, "rest_length": 0.25, "damping": 1.5}  # fmt: skip
LOAD = {"frame": "tip", "mass": 0.5, "com": [0.0, 0.0, 0.05],
        "inertia": [1e-3, 0.0, 0.0, 1e-3, 0.0, 1e-3]}  # fmt: skip


def tunable(*names: str, **more: Any) -> Any:
    base = models.scene("two_link").model_dump(exclude_unset=True)
    return load_scene({**base, "tunable": names, "springs": [CORD], **more})


@pytest.fixture(scope="module")
def other() -> Simulator:
    """The arm with 2 kg and 0.7 N m s/rad that was built so."""
    built = {"payloads": [{**LOAD, "mass": 2.0}], "joints": {"*": {"friction": {"viscous": 0.7}}}}
    return Simulator(tunable(**built), integrator="rk4")


CHANGES: dict[str, Any] = {
    "load": lambda s: payload_change(s, 0, 2.0, LOAD["com"], LOAD["inertia"]),
    "drag": lambda s: friction_change(s, [0.7, 0.7]),
    "push": external_change,
}


@pytest.mark.parametrize("order", ["drag push load", "push load drag"])
def test_changes_add_up_in_any_order(order: str, other: Simulator) -> None:
    """What one change sets the others keep: motions, dynamics, rollouts, derivatives, energies."""
    sim = Simulator(tunable("payload", "friction", payloads=[LOAD]), integrator="rk4")
    start = np.array([0.3, -0.4]), np.array([1.0, -0.5]), np.array([0.5, 0.2])
    sim.rollout(*(x[None] for x in start), 5)
    for name in order.split():
        CHANGES[name](sim)()
    other.reset(*start[:2])
    sim.reset(*start[:2])
    rolled = [s.rollout(*(x[None] for x in start), 20) for s in (sim, other)]
    assert_close(rolled[0], rolled[1], BACKENDS)
    slopes = [s.linearize(s.state, start[2]) for s in (sim, other)]
    assert_close(slopes[0][0], slopes[1][0], BACKENDS)
    q, v = start[:2]
    assert_close(sim.dynamics.gravity(q), other.dynamics.gravity(q), ALGEBRA)
    assert_close(sim.dynamics.friction(v), other.dynamics.friction(v), ALGEBRA)
    assert_close(sim.dynamics.mass_matrix(q), other.dynamics.mass_matrix(q), ALGEBRA)
    runs = [s.run(0.05, start[2]) for s in (sim, other)]
    assert_close(runs[0].q, runs[1].q, BACKENDS)
    assert_close(runs[0].energy, runs[1].energy, ALGEBRA)
    assert_close(runs[0].lost, runs[1].lost, ALGEBRA)
    assert np.abs(runs[0].balance).max() < 1e-6


def test_a_push_stays_through_other_changes() -> None:
    """Prepared before the push came, put in force after it."""
    sim = Simulator(tunable("payload", "friction", payloads=[LOAD]), integrator="rk4")
    waiting = friction_change(sim, [0.7, 0.7])
    external_change(sim)()
    sim.set_parameter("external", [3.0, -1.0])
    waiting()
    np.testing.assert_array_equal(
        sim.arm.plant.parameters.of("external", sim.arm.parameters), [3, -1]
    )
    np.testing.assert_array_equal(
        sim.arm.plant.parameters.of("friction", sim.arm.parameters), [0.7, 0.7]
    )
    before = sim.arm.compiled
    external_change(sim)()
    assert sim.arm.compiled is before


@pytest.mark.parametrize(
    ("make", "error", "said"),
    [
        (lambda s: payload_change(s, 1, 1.0, [0] * 3, [0] * 6), InvalidInput, "has 1, counted"),
        (lambda s: payload_change(s, 0, -1.0, [0] * 3, [0] * 6), SceneError, "mass"),
        (lambda s: friction_change(s, [-1.0] * 2), InvalidInput, "at least 0 is expected"),
        (lambda s: s.set_parameter("friction", np.ones((3, 2))), InvalidInput, r"shape \(3, 2\)"),
        (lambda s: s.set_parameter("gravity", [0.0] * 3), InvalidInput, "'gravity' is not tun"),
    ],
)
def test_what_cannot_be_is_refused(make: Any, error: type[ArmError], said: str) -> None:
    sim = Simulator(tunable("payload", "friction", payloads=[LOAD]), backend="vm")
    with pytest.raises(error, match=said):
        make(sim)


@pytest.mark.parametrize("name", ["two_link", "gripper"])
def test_a_push_is_a_torque_that_no_limit_cuts(name: str, rng: np.random.Generator) -> None:
    sim = Simulator(models.scene(name), integrator="rk4")
    sim.step(np.zeros(sim.n))
    before = sim.state
    external_change(sim)()
    assert sim.state is before
    push = rng.normal(scale=50.0, size=sim.n)
    sim.set_parameter("external", push)
    free = ArmModel(models.scene(name))
    vars(free)["command_limit"] = np.full(sim.n, np.inf)
    other = Simulator(free, integrator="rk4")
    other.step(np.zeros(sim.n))
    sim.step(np.zeros(sim.n))
    other.step(push)
    np.testing.assert_allclose(sim.state.v, other.state.v, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(sim.effort, np.zeros(sim.n))
    assert sim.arm.step_count == 2


def test_wrenches_are_jacobian_transposed(rng: np.random.Generator) -> None:
    dyn: Dynamics = models.dynamics("panda")
    q, hand, elbow = rng.normal(size=7), rng.normal(size=6), rng.normal(size=6)
    wrenches = ExternalWrenches(dyn)
    wrenches.push("panda_hand", hand, until=5)
    wrenches.push("panda_link4", elbow, until=3)
    J = {f: TaskSpace(dyn, f, "local").jacobian(q) for f in ("panda_hand", "panda_link4")}
    both = J["panda_hand"].T @ hand + J["panda_link4"].T @ elbow
    np.testing.assert_allclose(wrenches.advance(q, 3), both, atol=ALGEBRA)
    np.testing.assert_allclose(wrenches.advance(q, 5), J["panda_hand"].T @ hand, atol=ALGEBRA)
    assert wrenches.active == ("panda_hand",)
    np.testing.assert_array_equal(wrenches.advance(q, 6), np.zeros(7))


# --- the numeric dynamics of a simulator are those that act now ----------------------------------


PUSH = np.array([2.0, -1.0])
HEAVIER = [0.8, 0.1, 0.0, 0.02, 2e-3, 0.0, 0.0, 3e-3, 0.0, 2e-3]
RAIL = {"type": "plane", "frames": ["tip", "world"], "height": -0.3, "switchable": True}
LOSSY = {"actuator": {"efficiency": 0.8}, "friction": {"viscous": 0.2, "coulomb": 0.4}}


def present(**more: Any) -> dict[str, Any]:
    dry = ["coulomb"] if more.get("joints") else []
    return {
        "robot": models.scene("two_link").robot.model_dump(),
        "payloads": [{"frame": "tip", "mass": 0.1}],
        "initial": {"position": {"shoulder": 0.3, "elbow": 0.1}},
        "tunable": ["gravity", "payload", "friction", "external", *dry],
        **more,
    }


def test_forward_dynamics_are_those_of_the_next_tick() -> None:
    joints = {"*": LOSSY}
    sim = Simulator(present(joints=joints, initial={"velocity": {"shoulder": 0.5, "elbow": -0.7}}))
    sim.set_parameter("gravity", [0.5, 0.0, -3.0])
    sim.set_parameter("payload", HEAVIER)
    sim.set_parameter("friction", [0.7, 0.1])
    sim.set_parameter("external", PUSH)
    sim.set_parameter("coulomb", [0.9, 0.2])
    tau, h = np.array([1.0, 0.5]), sim.dt
    before = sim.state
    predicted = sim.dynamics.forward(before.q, before.v, tau)
    after = sim.step(tau)
    later = sim.dynamics.forward(after.q, after.v, tau)
    np.testing.assert_allclose((after.v - before.v) / h, (predicted + later) / 2, atol=1e-4)
    assert abs(predicted - Dynamics(sim.model).forward(before.q, before.v, tau)).min() > 0.1


def test_external_torques_are_in_the_sum_of_all_terms_only() -> None:
    sim = Simulator(present(), backend="vm")
    plain, state = sim.dynamics, np.array([[0.3, 0.1], [0.5, -0.2], [1.0, 2.0]])
    sim.set_parameter("external", PUSH)
    assert_close(sim.dynamics.inverse(*state), plain.inverse(*state) - PUSH, PINOCCHIO)
    for terms in (Term.ALL & ~Term.SPRING, Term.GRAVITY, Term.INERTIA | Term.FRICTION):
        own, expected = (arm.inverse(*state, terms=terms) for arm in (sim.dynamics, plain))
        np.testing.assert_array_equal(own, expected)
    np.testing.assert_array_equal(sim.dynamics.gravity(state[0]), plain.gravity(state[0]))


def test_static_friction_bears_external_torques() -> None:
    sim = Simulator(present(gravity=[0, 0, 0], joints={"*": {"friction": {"coulomb": 3.0}}}))
    still = np.zeros(2)
    sim.set_parameter("external", PUSH)
    np.testing.assert_array_equal(sim.dynamics.forward(still, still, still), still)
    sim.set_parameter("external", 2 * PUSH)
    assert sim.dynamics.forward(still, still, still)[0] > 0.0


def test_the_constraints_are_those_that_are_active() -> None:
    sim = Simulator(present(constraints=[RAIL]), backend="vm")
    q, v, tau = sim.state.q, sim.state.v, np.array([0.3, 0.2])
    sim.set_parameter("external", PUSH)
    held = sim.dynamics.forward(q, v, tau)
    assert_close(held, Dynamics(sim.model).forward(q, v, tau + PUSH), PINOCCHIO)
    a, lam = sim.dynamics.constrained_forward(q, v, tau)
    assert_close(a, held, PINOCCHIO)
    assert_close(sim.dynamics.constrained_inverse(q, v, a, lam), tau, 1e-9)
    sim.set_constraint("plane_0", on=False)
    free = Dynamics(present())
    assert_close(sim.dynamics.forward(q, v, tau), free.forward(q, v, tau + PUSH), 1e-9)
    assert not sim.dynamics.constrained_forward(q, v, tau)[1].any()
    both = sim.dynamics.constrained_forward(q, v, tau, active=["plane_0"])[0]
    assert_close(both, held, PINOCCHIO)
