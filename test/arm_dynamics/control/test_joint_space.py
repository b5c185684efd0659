# SPDX-License-Identifier: Apache-2.0
"""Joint controllers: behaviour at rest, in motion and at limits; refusals."""

from itertools import product
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from samples import sampled
from scipy.linalg import expm

import models
from arm_dynamics import ArmModel, InvalidInput, load_scene
from arm_dynamics.control import (
    PD,
    PID,
    ComputedTorque,
    DisturbanceObserver,
    FeedForwardPD,
    FrictionFeedForward,
    GravityCompensation,
    HalfTickAhead,
    JointImpedance,
    Measured,
    PDGravity,
    Saturated,
    Switch,
    tuned,
)
from arm_dynamics.control.compiled_law import CompiledLaw
from arm_dynamics.trajectory import Reference
from arm_sim import Simulator
from tolerances import ALGEBRA, assert_close


def at_rest(q: np.ndarray) -> Reference:
    return Reference(np.asarray(q, float), np.zeros(len(q)), np.zeros(len(q)))


def with_load(name: str, frame: str, mass: float, **joints: object) -> ArmModel:
    given = models.scene(name).model_dump(exclude_none=True)
    given["payloads"] = [{"frame": frame, "mass": mass}]
    for joint, settings in joints.items():
        given["joints"].setdefault(joint, {}).update(settings)
    return ArmModel(load_scene(given))


def test_without_error_model_based_laws_are_inverse_dynamics(robot: str, rng) -> None:
    dyn = models.dynamics(robot)
    q, v, a = models.random_state(rng, dyn.n)
    state, reference = Measured(q, v), Reference(q, v, a)
    rigid = dyn.inverse(q, v, a, terms=7) + dyn.model.viscous * v
    for control in (FeedForwardPD(dyn, 50.0, 5.0), JointImpedance(dyn.model, 50.0)):
        assert_close(control.torque(state, reference), rigid, ALGEBRA)
    weight = dyn.gravity(q)
    assert_close(PDGravity(dyn.model, 50.0, 5.0).torque(state, reference), weight, ALGEBRA)
    assert_close(GravityCompensation(dyn).torque(state), weight, ALGEBRA)
    assert_close(PD(dyn.n, 50.0, 5.0).torque(state, reference), np.zeros(dyn.n), ALGEBRA)


@pytest.mark.parametrize("name", sampled(["two_link", "panda"], 1))
def test_pd_with_gravity_leaves_no_error(name: str) -> None:
    sim = models.simulator(name, dt=1e-3)
    dyn = sim.dynamics
    goal = sim.state.q + 0.2
    control = PDGravity(dyn, *tuned(dyn, 12.0))
    done = sim.run(9.0, lambda s: control.torque(s, at_rest(goal)))
    assert abs(done.q[-1] - goal).max() < 1e-8
    assert abs(done.v[-1]).max() < 1e-8


@pytest.mark.parametrize(
    ("name", "omega"), sampled(product(["panda", "kinova", "ur10", "z1"], [15.0, 60.0, 400.0]), 4)
)
def test_tuned_gains_are_stable_when_held_for_a_tick(name: str, omega: float) -> None:
    """The linear sampled loop at rest, in postures that were not used for tuning."""
    dyn, dt = models.dynamics(name), 1e-3
    kp, kd = tuned(dyn, omega, dt=dt)
    rng, n = np.random.default_rng(5), dyn.n
    none, still = np.zeros((n, n)), np.zeros((n, 3 * n))
    for M in dyn.mass_matrix(rng.uniform(-3.0, 3.0, (50, n))):
        W = np.linalg.inv(M)
        moving = np.hstack([none, np.eye(n), none]), np.hstack([none, -W * dyn.model.viscous, W])
        tick = expm(dt * np.vstack([*moving, still]))[: 2 * n]
        closed = tick[:, : 2 * n] - tick[:, 2 * n :] @ np.hstack([np.diag(kp), np.diag(kd)])
        assert abs(np.linalg.eigvals(closed)).max() < 1.0 + 1e-9


def test_gains_of_a_posture_are_those_of_its_inertia() -> None:
    dyn, q = models.dynamics("two_link"), np.array([0.3, 0.8])
    kp, kd = tuned(dyn, 10.0, 0.5, q)
    inertia = dyn.mass_matrix(q).diagonal()
    assert_close(kp, 100.0 * inertia, ALGEBRA)
    assert_close(kd, 10.0 * inertia - dyn.model.viscous, ALGEBRA)


def test_pd_alone_sags_by_weight_over_stiffness() -> None:
    sim = models.simulator("two_link", dt=1e-3)
    kp, kd = 200.0, 30.0
    goal = sim.state.q.copy()
    done = sim.run(6.0, lambda s: PD(2, kp, kd).torque(s, at_rest(goal)))
    sag = sim.dynamics.gravity(done.q[-1]) / kp
    assert abs(sag).min() > 1e-3
    np.testing.assert_allclose(goal - done.q[-1], sag, atol=1e-7)


def test_pid_removes_what_pd_leaves() -> None:
    sim = models.simulator("two_link", dt=1e-3)
    kp, kd = tuned(sim.dynamics, 15.0)
    control = PID(2, kp, 5.0 * kp, kd, sim.dt)
    goal = sim.state.q.copy()
    done = sim.run(6.0, lambda s: control.torque(s, at_rest(goal)))
    assert abs(done.q[-1] - goal).max() < 1e-6
    assert_close(control.integral, sim.dynamics.gravity(goal), 1e-3)


def test_pid_does_not_wind_up() -> None:
    """With a limit below the weight, the integral stays near the limit and recovers at once."""
    control = PID(1, 10.0, 40.0, 1.0, 1e-2, limit=5.0)
    stuck = Measured(np.zeros(1), np.zeros(1))
    for _ in range(2000):
        tau = control.torque(stuck, at_rest([1.0]))
        assert abs(tau[0]) <= 5.0
    free = PID(1, 10.0, 40.0, 1.0, 1e-2)
    for _ in range(2000):
        free.torque(stuck, at_rest([1.0]))
    assert free.integral[0] > 700.0
    assert abs(control.integral[0]) < 20.0
    control.torque(stuck, at_rest([-1.0]))
    recovery = next(k for k in range(200) if control.torque(stuck, at_rest([-1.0]))[0] <= -4.9)
    assert recovery < 60


def test_a_pid_whose_integral_is_faster_than_a_tick_stays_at_its_limit() -> None:
    """ki dt / kp = 5: correcting the integral five times over would oscillate and grow."""
    control = PID(1, 1.0, 5000.0, 0.0, 1e-3, limit=3.0)
    stuck = Measured(np.zeros(1), np.zeros(1))
    torques = [control.torque(stuck, at_rest([1.0]))[0] for _ in range(100)]
    assert torques[0] == 1.0
    assert torques[1:] == [3.0] * 99
    assert abs(control.integral[0]) <= 3.0 + 5.0


def test_float_keeps_still_and_yields(rng: np.random.Generator) -> None:
    sim = models.simulator("panda", dt=1e-3)
    control = GravityCompensation(sim.dynamics)
    done = sim.run(1.0, lambda s: control.torque(s))
    assert abs(done.q[-1] - done.q[0]).max() < 1e-9
    damped = GravityCompensation(sim.dynamics, 2.0)
    v = rng.normal(size=7)
    state = Measured(sim.state.q, v)
    assert_close(damped.torque(state), sim.dynamics.gravity(sim.state.q) - 2 * v, ALGEBRA)


def test_joint_impedance_acts_as_a_spring_under_external_torque() -> None:
    """A constant external torque displaces it by torque over stiffness."""
    sim = models.simulator("two_link", dt=1e-3)
    goal, push = sim.state.q.copy(), np.array([3.0, -1.0])
    control = JointImpedance(sim.dynamics, 80.0, 1.0)
    done = sim.run(5.0, lambda s: control.torque(s, at_rest(goal)) + push)
    np.testing.assert_allclose(done.q[-1] - goal, push / 80.0, atol=1e-6)


@pytest.mark.parametrize("zeta", [0.5, 1.0, 2.0])
def test_half_a_tick_ahead_the_law_of_the_books_gives_the_linear_response(zeta: float) -> None:
    """At 1 kHz within 1e-4 of the step; without it 1.7e-3."""
    omega = 10.0
    sim = models.simulator("two_link", integrator="rk4", dt=1e-3)
    goal = sim.state.q + [0.3, -0.2]
    law = ComputedTorque(sim.dynamics, omega, zeta, dt=0.0)
    control, reference = HalfTickAhead(law, sim.dynamics, sim.dt), at_rest(goal)
    done = sim.run(0.6, lambda s: control.torque(s, reference))
    error = (goal - done.q) / (goal - done.q[0])
    roots = np.roots([1.0, 2 * zeta * omega, omega**2]).astype(complex)
    if zeta == 1.0:
        wanted = (1 + omega * done.time) * np.exp(-omega * done.time)
    else:
        weights = np.array([roots[1], -roots[0]]) / (roots[1] - roots[0])
        wanted = (np.exp(np.outer(done.time, roots)) @ weights).real
    np.testing.assert_allclose(error, np.column_stack([wanted, wanted]), rtol=0, atol=1e-4)


class Seen:
    """A controller of constant torque that keeps the state it was given."""

    def __init__(self, *torque: float) -> None:
        self.tau, self.state = np.array(torque), Measured(np.zeros(0), np.zeros(0))

    def torque(self, state: Measured, reference: Reference) -> np.ndarray:
        self.state = state
        return self.tau


def test_half_a_tick_ahead_is_where_the_held_torque_leads() -> None:
    """q + v h + a h²/2 and v + a h, with the acceleration under the last torque."""
    dyn = models.dynamics("two_link")
    q, v, h = np.array([0.4, -0.7]), np.array([1.0, 2.0]), 0.01
    law = Seen(3.0, -1.0)
    control = HalfTickAhead(law, dyn, 2.0 * h)
    control.torque(Measured(q, v), at_rest(q))
    assert_close([law.state.q, law.state.v], [q + h * v, v], ALGEBRA)
    control.torque(Measured(q, v), at_rest(q))
    a = dyn.forward(q, v, law.tau)
    assert abs(a).min() > 1.0
    assert_close([law.state.q, law.state.v], [q + h * v + a * h * h / 2, v + a * h], ALGEBRA)


def test_a_hand_over_begins_and_ends_gently() -> None:
    """The share of the old torque falls along the cubic that is flat at both ends."""
    control, still = Switch(Seen(1.0), 1e-3, 0.1), Measured(np.zeros(1), np.zeros(1))
    control.torque(still, at_rest([0.0]))
    control.to(Seen(0.0))
    share = np.array([control.torque(still, at_rest([0.0]))[0] for _ in range(101)])
    assert_close(share[[0, 50, 100]], [1.0, 0.5, 0.0], ALGEBRA)
    assert_close(share + share[::-1], np.ones(101), ALGEBRA)
    steps = -np.diff(share)
    assert max(steps[0], steps[-1]) < 3.0 / 100**2 < steps.max()
    assert steps.max() == pytest.approx(1.5 / 100, rel=1e-3)


def test_without_an_earlier_torque_nothing_is_handed_over() -> None:
    control, still = Switch(Seen(1.0), 0.05), Measured(np.zeros(1), np.zeros(1))
    own = Seen(0.0)
    control.to(own)
    torques = []
    for tick in range(6):
        own.tau = np.array([11.0 + tick])
        torques.append(control.torque(still, at_rest([0.0]))[0])
    assert torques == [11.0, 12.0, 13.0, 14.0, 15.0, 16.0] and not control.fading


def test_disturbance_observer_sees_the_load_and_takes_it_off() -> None:
    believed = models.dynamics("two_link")
    sim = Simulator(with_load("two_link", "tip", 0.5), dt=2e-3)
    goal = sim.state.q.copy()
    plain = ComputedTorque(believed, 10.0)
    done = sim.run(4.0, lambda s: plain.torque(s, at_rest(goal)))
    left = abs(done.q[-1] - goal).max()
    sim.reset()
    helped = DisturbanceObserver(ComputedTorque(believed, 10.0), believed, sim.dt, 30.0)
    done = sim.run(4.0, lambda s: helped.torque(s, at_rest(goal)))
    load = believed.gravity(goal) - sim.dynamics.gravity(goal)
    assert_close(helped.disturbance, load, 1e-4)
    assert abs(done.q[-1] - goal).max() < 1e-5 < left


def test_observer_of_a_right_model_sees_nothing() -> None:
    sim = models.simulator("panda", dt=1e-3)
    control = DisturbanceObserver(ComputedTorque(sim.dynamics, 10.0), sim.dynamics, 1e-3, 30.0)
    goal = sim.state.q + 0.3
    largest = 0.0
    for _ in range(800):
        sim.step(control.torque(sim.state, at_rest(goal)))
        largest = max(largest, abs(control.disturbance).max())
    assert largest < 0.05 * abs(sim.dynamics.gravity(goal)).max()


def test_friction_fed_forward_is_that_of_the_motion_wanted() -> None:
    joints = {"shoulder": {"friction": {"coulomb": 2.0, "viscous": 0.5}}}
    model = with_load("two_link", "tip", 0.1, **joints)
    q, v = np.array([0.1, 0.2]), np.array([1.0, -1.0])
    reference = Reference(q, v, np.zeros(2))
    control = FrictionFeedForward(PD(2, 0.0, 0.0), model)
    tau = control.torque(Measured(q, np.zeros(2)), reference)
    assert_close(tau, [2.5, -model.viscous[1]], ALGEBRA)
    assert_close(control.torque(Measured(q, v), at_rest(q)), np.zeros(2), ALGEBRA)
    dry = FrictionFeedForward(PD(2, 0.0, 0.0), model, "dry")
    assert_close(dry.torque(Measured(q, v), reference), [2.0, 0.0], ALGEBRA)


@pytest.mark.parametrize(
    ("asked", "cut"),
    [(4.9, False), (5.0, False), (5.1, True), (-4.9, False), (-5.0, False), (-5.1, True)],
)
def test_torques_beyond_a_limit_are_cut_to_it_on_both_sides(asked: float, cut: bool) -> None:
    control = Saturated(PD(2, 10.0, 0.0), 5.0, 2)
    assert control.asked.tolist() == [0.0, 0.0]
    assert not control.saturated.any()
    tau = control.torque(Measured(np.zeros(2), np.zeros(2)), at_rest([0.1 * asked, 0.0]))
    assert_close(tau, [np.sign(asked) * min(abs(asked), 5.0), 0.0], ALGEBRA)
    assert control.saturated.tolist() == [cut, False]
    control.asked[:] = 99.0  # the caller's own
    assert_close(control.asked, [asked, 0.0], ALGEBRA)


def test_compiled_code_has_the_narrowest_of_nested_limits() -> None:
    inner = SimpleNamespace(compiled=lambda: CompiledLaw(cast(Any, None)))
    nested = Saturated(Saturated(cast(Any, inner), [5.0, 20.0], 2), 10.0, 2).compiled()
    assert nested is not None
    assert nested.limit.tolist() == [5.0, 10.0]


def test_a_restart_reaches_what_is_within_limits() -> None:
    pid = PID(1, 1.0, 1.0, 0.0, 1e-3)
    control = Saturated(pid, np.inf, 1)
    control.torque(Measured(np.zeros(1), np.zeros(1)), at_rest([1.0]))
    assert pid.integral[0] != 0.0
    control.restart()
    assert pid.integral[0] == 0.0


def test_hand_over_forgets_an_old_integral() -> None:
    pid = PID(1, 1.0, 1.0, 0.0, 1e-3)
    still = Measured(np.zeros(1), np.zeros(1))
    for _ in range(100):
        pid.torque(still, at_rest([1.0]))
    Switch(PD(1, 1.0, 0.0), 1e-3).to(pid)
    assert pid.integral[0] == 0.0


BAD_STATES = [
    (np.array([np.nan, 0.0]), np.zeros(2), r"state.q\[0\] = nan"),
    (np.zeros(2), np.array([0.0, np.inf]), r"state.v\[1\] = inf"),
    (np.zeros(3), np.zeros(2), r"state.q has shape \(3,\)"),
    (np.zeros((1, 2)), np.zeros((1, 2)), r"state.q has shape \(1, 2\)"),
]


@pytest.mark.parametrize(("q", "v", "complaint"), BAD_STATES)
def test_bad_states_are_refused(q: np.ndarray, v: np.ndarray, complaint: str) -> None:
    dyn = models.dynamics("two_link")
    for control in (PD(2, 1.0, 1.0), GravityCompensation(dyn), JointImpedance(dyn, 1.0)):
        with pytest.raises(InvalidInput, match=complaint):
            control.torque(Measured(q, v), at_rest(np.zeros(2)))


def test_bad_settings_are_refused() -> None:
    dyn = models.dynamics("two_link")
    with pytest.raises(InvalidInput, match="kp is -1"):
        PD(2, -1.0, 1.0)
    with pytest.raises(InvalidInput, match=r"kp is \[ 1. -1.\]"):
        PD(2, [1.0, -1.0], 1.0)
    with pytest.raises(InvalidInput, match=r"bandwidth is \[20.0, 2000000.0\]; allowed: at most"):
        ComputedTorque(dyn, [20.0, 2e6])
    with pytest.raises(InvalidInput, match=r"kd has shape \(3,\)"):
        PDGravity(dyn, 1.0, [1.0, 1.0, 1.0])
    with pytest.raises(InvalidInput, match="dt is 0"):
        PID(2, 1.0, 1.0, 1.0, 0.0)
    with pytest.raises(InvalidInput, match="dt is -1"):
        tuned(dyn, 10.0, q=np.zeros(2), dt=-1.0)
    with pytest.raises(InvalidInput, match="positive where ki is positive"):
        PID(2, 0.0, 1.0, 1.0, 1e-3)
    with pytest.raises(InvalidInput, match="positive where ki is positive"):
        PID(2, [1.0, 0.0], [0.0, 1.0], 1.0, 1e-3)
    with pytest.raises(InvalidInput, match="limit is 0"):
        Saturated(PD(2, 1.0, 1.0), 0.0, 2)
    with pytest.raises(InvalidInput, match=r"limit is \[5.0, 0.0\]"):
        Saturated(PD(2, 1.0, 1.0), [5.0, 0.0], 2)
    for bandwidth in (200.0, 100.0, [200.0, 20.0], [20.0, 200.0]):
        with pytest.raises(InvalidInput, match="must stay below one"):
            DisturbanceObserver(PD(2, 1.0, 1.0), dyn, 1e-2, bandwidth)
    with pytest.raises(InvalidInput, match="fade is -1"):
        Switch(PD(2, 1.0, 1.0), 1e-3, -1.0)
    with pytest.raises(InvalidInput, match="allowed: all, dry"):
        FrictionFeedForward(PD(2, 1.0, 1.0), dyn.model, "wet")


@pytest.mark.parametrize(
    ("reference", "said"),
    [
        (
            Reference(np.zeros(3), np.zeros(2), np.zeros(2)),
            r"reference.q has shape \(3,\); \(2,\)",
        ),
        (Reference(np.zeros(2), np.zeros(2), np.zeros(())), r"reference.a has shape \(\); \(2,\)"),
        (np.zeros(2), "the reference is of type ndarray; positions q, velocities v and"),
        (None, "the reference is of type NoneType"),
    ],
)
def test_a_wrong_reference_is_reported(reference: object, said: str) -> None:
    dyn, state = models.dynamics("two_link"), Measured(np.zeros(2), np.zeros(2))
    for control in (PD(2, 1.0, 1.0), FeedForwardPD(dyn, 1.0, 1.0), ComputedTorque(dyn)):
        with pytest.raises(InvalidInput, match=said):
            control.torque(state, reference)
