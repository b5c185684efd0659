# SPDX-License-Identifier: Apache-2.0
"""Task-space controllers: their control laws, straight lines, contact, singularities."""

import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import InvalidInput
from arm_dynamics.control import (
    CartesianImpedance,
    ComputedTorque,
    Measured,
    MotionForce,
    OperationalSpace,
    at_rest,
)
from arm_dynamics.control.task_space import AlongJoints, task_reference
from arm_dynamics.task_space import Pose, TaskSpace
from arm_dynamics.trajectory import Reference, TaskReference, joint_path, line, timed
from tolerances import ALGEBRA, INVERSE_PAIR, assert_close


def panda() -> TaskSpace:
    return TaskSpace(models.dynamics("panda"), "panda_hand_tcp")


def two_link() -> TaskSpace:
    return TaskSpace(models.dynamics("two_link"), "tip", selection=("x", "z"))


def random_reference(task: TaskSpace, rng: np.random.Generator) -> tuple[Measured, TaskReference]:
    q = models.dynamics("panda").model.q0 + rng.uniform(-0.3, 0.3, 7)
    pose = task.pose(q + rng.uniform(-0.05, 0.05, 7))
    reference = TaskReference(pose.position, pose.rotation, rng.normal(size=6), rng.normal(size=6))
    return Measured(q, rng.normal(size=7)), reference


def acceleration(task: TaskSpace, state: Measured, tau: np.ndarray) -> np.ndarray:
    dyn = models.dynamics("panda")
    a = dyn.forward(state.q, state.v, tau + dyn.friction(state.v))
    return task.jacobian(state.q) @ a + task.bias(state.q, state.v)


def errors(task: TaskSpace, state: Measured, reference: TaskReference) -> np.ndarray:
    here = task.pose(state.q)
    turn = pin.log3(reference.rotation @ here.rotation.T)
    return np.concatenate([reference.position - here.position, turn])


def test_operational_space_accelerates_the_hand_as_asked(rng: np.random.Generator) -> None:
    """ẍ = ẍ_d + 2 ζ ω ė + ω² e by forward dynamics, whatever the posture does."""
    task = panda()
    for posture in (None, rng.uniform(-1, 1, 7)):
        state, reference = random_reference(task, rng)
        tau = OperationalSpace(task, 12.0, 0.8, posture).torque(state, reference)
        rate = reference.velocity - task.jacobian(state.q) @ state.v
        wanted = reference.acceleration + 2 * 0.8 * 12 * rate
        wanted = wanted + 144 * errors(task, state, reference)
        assert_close(acceleration(task, state, tau), wanted, INVERSE_PAIR)


def test_operational_space_is_khatibs_formula(rng: np.random.Generator) -> None:
    task, dyn = panda(), models.dynamics("panda")
    state, reference = random_reference(task, rng)
    terms = task.terms(state.q, state.v)
    wanted = reference.acceleration + 40 * (reference.velocity - terms.velocity)
    wanted = wanted + 400 * errors(task, state, reference)
    force = terms.inertia @ wanted + terms.coriolis + terms.gravity
    free = dyn.inverse(state.q, state.v, -8.0 * state.v, terms=7)
    tau = terms.jacobian.T @ force + terms.null_space.T @ free
    assert_close(OperationalSpace(task, 20.0).torque(state, reference), tau, INVERSE_PAIR)


def test_an_impedance_is_damped_by_the_mass_that_each_axis_feels() -> None:
    """D = 2 ζ √(K Λ_ii)."""
    task, K, q, v = two_link(), [300.0, 500.0], np.array([0.3, 0.8]), np.array([0.5, -0.4])
    J, D = task.jacobian(q), 2.0 * np.sqrt(K * task.terms(q).inertia.diagonal())
    more, less = (
        CartesianImpedance(task, K, zeta).torque(Measured(q, v), at_rest(task, q))
        for zeta in (1.0, 0.0)
    )
    assert_close(more - less, -J.T @ (D * (J @ v)), INVERSE_PAIR)


def test_along_the_force_the_hand_is_only_braked(rng: np.random.Generator) -> None:
    """u·ẍ = -2 ζ ω u·ẋ whatever the reference asks for there; across u it is followed."""
    task, u = panda(), np.array([0.0, 0.6, -0.8])
    for _ in range(5):
        state, reference = random_reference(task, rng)
        tau = MotionForce(task, u, 12.0, 0.8).torque(state, reference)
        found = acceleration(task, state, tau)
        rate = reference.velocity - task.jacobian(state.q) @ state.v
        wanted = reference.acceleration + 2 * 0.8 * 12 * rate
        wanted = wanted + 144 * errors(task, state, reference)
        braked = -2 * 0.8 * 12 * (u @ (task.jacobian(state.q) @ state.v)[:3])
        wanted[:3] += (braked - u @ wanted[:3]) * u
        assert_close(found, wanted, INVERSE_PAIR)


def test_straight_line_at_half_a_metre_per_second() -> None:
    """Panda, within a tenth of a millimetre of where it should be, in both spaces."""
    sim, task = models.simulator("panda", dt=1e-3), panda()
    start = task.pose(sim.state.q)
    end = Pose(
        start.position + [0.1, 0.35, -0.15], pin.exp3(np.array([0.2, 0, 0.3])) @ start.rotation
    )
    motion = timed(line(start, end), 0.5, 2.0, "trapezoid")
    path = joint_path(task, motion)
    laws = (
        (ComputedTorque(sim.dynamics, 20.0), path.sample),
        (OperationalSpace(task, 20.0, friction=True), motion.sample),
    )
    for control, sample in laws:
        sim.reset()
        done = sim.run(motion.duration + 0.2, lambda s: control.torque(s, sample(s.time)))  # noqa: B023
        wanted = np.array([motion.sample(float(t)).position for t in done.time])
        off = np.linalg.norm(task.pose(done.q).position - wanted, axis=1)
        assert off.max() < 1e-4


@pytest.mark.parametrize("kind", ["operational", "impedance", "force"])
def test_through_a_singularity_nothing_breaks(kind: str) -> None:
    """Asked to reach beyond the stretched arm and back, torques and speeds stay bounded."""
    sim, task = models.simulator("two_link", dt=1e-3), two_link()
    sim.reset([0.3, 0.4], [0.0, 0.0])
    whole = TaskSpace(models.dynamics("two_link"), "tip", selection="position")
    control = {
        "operational": OperationalSpace(task, 10.0),
        "impedance": CartesianImpedance(task, 200.0, 1.0),
        "force": MotionForce(whole, [0, 0, 1], 10.0),
    }[kind]
    near = at_rest(task, [0.3, 0.4], 2.0)
    direction = near.position / np.linalg.norm(near.position)
    largest, straightest = 0.0, 1.0
    for k in range(1500):
        radius = 0.85 + 0.15 * np.sin(2 * np.pi * k / 1000)
        wanted = TaskReference(
            radius * direction, near.rotation, near.velocity, near.acceleration, 2.0
        )
        tau = control.torque(sim.state, wanted)
        assert np.isfinite(tau).all()
        largest = max(largest, abs(tau).max())
        straightest = min(straightest, abs(np.sin(sim.state.q[1])))
        sim.step(tau)
        assert abs(sim.state.v).max() < 60.0
    assert largest < 1e4
    if kind != "force":
        assert straightest < 0.03


def test_joint_references_are_followed_by_task_controllers(rng: np.random.Generator) -> None:
    task = panda()
    q, v, a = 0.2 * rng.normal(size=(3, 7))
    q = q + models.dynamics("panda").model.q0
    meant = task_reference(task, Reference(q, v, a))
    assert_close(meant.velocity, task.jacobian(q) @ v, INVERSE_PAIR)
    assert_close(meant.acceleration, task.jacobian(q) @ a + task.bias(q, v), INVERSE_PAIR)
    inner = OperationalSpace(task, 20.0)
    state = Measured(q + 0.01, v)
    tau = AlongJoints(inner, task).torque(state, Reference(q, v, a))
    assert_close(tau, inner.torque(state, meant), INVERSE_PAIR)


def test_a_planar_task_presses_along_its_own_axes() -> None:
    """Force for force at a standing arm: statics, τ = G + Jᵀ f, whatever the other axes hold."""
    task, dyn = two_link(), models.dynamics("two_link")
    q = np.array([0.3, 0.8])
    tau = MotionForce(task, [1, 0, -1]).torque(Measured(q, 0 * q), at_rest(task, q, force=10.0))
    press = 10.0 * np.array([1.0, -1.0]) / np.sqrt(2.0)
    assert_close(tau, dyn.gravity(q) + press @ task.jacobian(q), ALGEBRA)


def test_bad_settings_and_states_are_refused() -> None:
    task = two_link()
    local = TaskSpace(models.dynamics("two_link"), "tip", "local", ("x", "z"))
    with pytest.raises(InvalidInput, match="'local_world_aligned' is expected"):
        OperationalSpace(local)
    with pytest.raises(InvalidInput, match=r"stiffness has shape \(3,\)"):
        CartesianImpedance(task, [1.0, 1.0, 1.0])
    with pytest.raises(InvalidInput, match=r"is not among the axes of the task, \('x', 'z'\)"):
        MotionForce(task, [0, 1, 1])
    with pytest.raises(InvalidInput, match=r"state.v\[0\] = nan"):
        state = Measured(np.zeros(2), np.array([np.nan, 0.0]))
        OperationalSpace(task).torque(state, at_rest(task, [0.3, 0.5]))
