# SPDX-License-Identifier: Apache-2.0
"""Joint controllers: behaviour at rest, in motion and at limits; refusals."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.linalg import expm

import models
from arm_dynamics import InvalidInput
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
    Settings,
    Switch,
    make_controller,
    tuned,
)
from arm_dynamics.task_space import TaskSpace
from arm_dynamics.trajectory import Reference
from arm_sim import Simulator
from tolerances import ALGEBRA, assert_close


def at_rest(q: np.ndarray) -> Reference:
    return Reference(np.asarray(q, float), np.zeros(len(q)), np.zeros(len(q)))


def test_without_error_model_based_laws_are_inverse_dynamics(robot: str, rng) -> None:
    dyn = models.dynamics(robot)
    q, v, a = models.random_state(rng, dyn.n)
    state, reference = Measured(q, v), Reference(q, v, a)
    rigid = dyn.inverse(q, v, a, terms=7) + dyn.model.viscous * v
    for control in (FeedForwardPD(dyn, 50.0, 5.0), JointImpedance(dyn.model, 50.0)):
        assert_close(control.torque(state, reference), rigid, ALGEBRA)
    weight = dyn.gravity(q)
    assert_close(PDGravity(dyn.model, 50.0, 5.0).torque(state, reference), weight, ALGEBRA)
    assert_close(GravityCompensation(dyn, 2.0).torque(state), weight - 2.0 * v, ALGEBRA)
    assert_close(PD(dyn.n, 50.0, 5.0).torque(state, reference), np.zeros(dyn.n), ALGEBRA)


@pytest.mark.parametrize(("name", "omega"), [("panda", 15.0), ("panda", 400.0), ("z1", 60.0)])
def test_tuned_gains_are_stable_when_held_for_a_tick(name: str, omega: float) -> None:
    """The linear sampled loop at rest, in postures that were not used for tuning."""
    dyn, dt = models.dynamics(name), 1e-3
    kp, kd = tuned(dyn, omega, dt=dt)
    rng, n = np.random.default_rng(5), dyn.n
    none, still = np.zeros((n, n)), np.zeros((n, 3 * n))
    for M in dyn.mass_matrix(rng.uniform(-3.0, 3.0, (20, n))):
        W = np.linalg.inv(M)
        moving = np.hstack([none, np.eye(n), none]), np.hstack([none, -W * dyn.model.viscous, W])
        tick = expm(dt * np.vstack([*moving, still]))[: 2 * n]
        closed = tick[:, : 2 * n] - tick[:, 2 * n :] @ np.hstack([np.diag(kp), np.diag(kd)])
        assert abs(np.linalg.eigvals(closed)).max() < 1.0 + 1e-9


def test_gains_of_a_posture_are_those_of_its_inertia() -> None:
    dyn, q = models.dynamics("two_link"), np.array([0.3, 0.8])
    kp, kd = tuned(dyn, 10.0, 0.5, q)
    inertia = dyn.mass_matrix(q).diagonal()
    assert_close([kp, kd], [100.0 * inertia, 10.0 * inertia - dyn.model.viscous], ALGEBRA)


def test_a_state_in_single_precision_is_taken_as_the_numbers_it_holds() -> None:
    law, q = ComputedTorque(models.dynamics("two_link")), np.float32([0.1, 0.7])
    single, double = (law.torque(Measured(x, x), at_rest(NONE)) for x in (q, q.astype(float)))
    assert single.dtype == np.float64 and single.tolist() == double.tolist()


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
    control.to(Seen(11.0))
    assert control.torque(still, at_rest([0.0])) == [11.0] and not control.fading
    control.to(Seen(12.0))
    control.restart()
    assert control.torque(still, at_rest([0.0])) == [12.0] and not control.fading


def test_disturbance_observer_sees_the_load_and_takes_it_off() -> None:
    believed = models.dynamics("two_link")
    load = {"payloads": [{"frame": "tip", "mass": 0.5}]}
    sim = Simulator(models.scene("two_link").model_dump(exclude_none=True) | load, dt=2e-3)
    goal = sim.state.q.copy()
    helped = DisturbanceObserver(ComputedTorque(believed, 10.0), believed, sim.dt, 30.0)
    done = sim.run(3.0, lambda s: helped.torque(s, at_rest(goal)))
    load = believed.gravity(goal) - sim.dynamics.gravity(goal)
    assert_close(helped.disturbance, load, 1e-4)
    assert abs(load).min() > 1.0 and abs(done.q[-1] - goal).max() < 1e-5


@pytest.mark.parametrize("asked", [5.0, 5.1, -5.0, -5.1])
def test_torques_beyond_a_limit_are_cut_to_it_on_both_sides(asked: float) -> None:
    control = Saturated(PD(2, 10.0, 0.0), 5.0, 2)
    tau = control.torque(Measured(np.zeros(2), np.zeros(2)), at_rest([0.1 * asked, 0.0]))
    assert_close(tau, [np.sign(asked) * min(abs(asked), 5.0), 0.0], ALGEBRA)
    assert control.saturated.tolist() == [abs(asked) > 5.0, False]
    control.unlimited_torque[:] = 99.0  # the caller's own
    assert_close(control.unlimited_torque, [asked, 0.0], ALGEBRA)


def test_compiled_code_has_the_narrowest_of_nested_limits() -> None:
    control = make_controller("computed_torque", models.dynamics("two_link"))
    nested = Saturated(Saturated(control, [5.0, 20.0], 2), 10.0, 2).compiled()
    assert nested is not None and nested.limit.tolist() == [5.0, 10.0]


def test_a_restart_and_a_hand_over_forget_an_old_integral() -> None:
    pid = PID(1, 1.0, 1.0, 0.0, 1e-3)
    still, limited = Measured(np.zeros(1), np.zeros(1)), Saturated(pid, np.inf, 1)
    for forget in (limited.restart, lambda: Switch(PD(1, 1.0, 0.0), 1e-3).to(pid)):
        limited.torque(still, at_rest([1.0]))
        assert pid.integral[0] != 0.0
        forget()
        assert pid.integral[0] == 0.0


PLAIN, ARM = PD(2, 1.0, 1.0), models.dynamics("two_link")
BAD_SETTINGS: list[tuple[Callable[..., object], tuple[object, ...], str]] = [
    (PD, (2, [1.0, -1.0], 1.0), r"kp is \[ 1. -1.\]"),
    (PID, (2, 1.0, 1.0, 1.0, 0.0), "dt is 0"),
    (tuned, (ARM, 10.0, 1.0, np.zeros(2), -1.0), "dt is -1"),
    (PID, (2, [1.0, 0.0], [0.0, 1.0], 1.0, 1e-3), "positive where ki is positive"),
    (Saturated, (PLAIN, [5.0, 0.0], 2), r"limit is \[5.0, 0.0\]"),
    (DisturbanceObserver, (PLAIN, ARM, 1e-2, 100.0), "must stay below one"),
    (Switch, (PLAIN, 1e-3, -1.0), "fade is -1"),
    (FrictionFeedForward, (PLAIN, ARM.model, "wet"), "allowed: all, dry"),
]


@pytest.mark.parametrize(("law", "settings", "said"), BAD_SETTINGS)
def test_bad_settings_are_refused(
    law: Callable[..., object], settings: tuple[object, ...], said: str
) -> None:
    with pytest.raises(InvalidInput, match=said):
        law(*settings)


NONE = np.zeros(2)
BAD = [
    (Measured(np.array([np.nan, 0.0]), NONE), at_rest(NONE), r"state.q\[0\] = nan"),
    (Measured(NONE, np.array([0.0, np.inf])), at_rest(NONE), r"state.v\[1\] = inf"),
    (Measured(np.zeros(3), NONE), at_rest(NONE), r"state.q has shape \(3,\)"),
    (Measured(np.zeros((1, 2)), NONE), at_rest(NONE), r"state.q has shape \(1, 2\)"),
    (Measured(NONE, NONE), Reference(NONE, NONE, np.zeros(())), r"reference.a has shape \(\)"),
    (Measured(NONE, NONE), NONE, "the reference is of type ndarray"),
]


@pytest.mark.parametrize(("state", "reference", "said"), BAD)
def test_wrong_states_and_references_are_refused(
    state: Measured, reference: object, said: str
) -> None:
    dyn = models.dynamics("two_link")
    for control in (PD(2, 1.0, 1.0), FeedForwardPD(dyn, 1.0, 1.0), ComputedTorque(dyn)):
        with pytest.raises(InvalidInput, match=said):
            control.torque(state, reference)


STIFF = np.array([600.0, 500.0, 400.0, 300.0, 50.0, 40.0, 30.0])
DAMPED = np.array([60.0, 50.0, 40.0, 30.0, 5.0, 4.0, 3.0])


def torque(name: str, q: np.ndarray, v: np.ndarray, **settings: object) -> np.ndarray:
    """Torque of the Panda's impedance at its start for a displacement and a speed."""
    dynamics = models.dynamics("panda")
    place, still = dynamics.model.q0, np.zeros(7)
    control = make_controller(name, dynamics, Settings(frame="panda_hand", **settings))  # type: ignore[arg-type]
    there = Reference(place, still, still)
    answer = control.torque(Measured(place + q, v), there)
    return np.asarray(answer - control.torque(Measured(place, still), there))


def test_joints_push_back_by_stiffness_and_damping(rng: np.random.Generator) -> None:
    """τ = K e + D ė in N m/rad and N m s/rad, beside what the motion itself takes; with a damping
    ratio D = 2 ζ √(K M_ii), whatever the bandwidth.
    """
    (q, v), still = 1e-7 * rng.normal(size=(2, 7)), np.zeros(7)
    dynamics = models.dynamics("panda")
    place = dynamics.model.q0
    weight = dynamics.gravity(place + q) - dynamics.gravity(place)
    back = torque("joint_impedance", q, still, stiffness=STIFF, damping=DAMPED)
    np.testing.assert_allclose(back - weight, -STIFF * q, rtol=1e-5, atol=1e-9)
    back = torque("joint_impedance", still, v, stiffness=STIFF, damping=DAMPED)
    np.testing.assert_allclose(back, -DAMPED * v, rtol=1e-5, atol=1e-12)
    own = {"stiffness": STIFF, "damping_ratio": 0.7, "bandwidth": 50.0}
    damped = 1.4 * np.sqrt(STIFF * dynamics.mass_matrix(place).diagonal())
    np.testing.assert_allclose(torque("joint_impedance", still, v, **own), -damped * v, rtol=1e-5)


def test_the_hand_pushes_back_in_newtons_per_metre(rng: np.random.Generator) -> None:
    """Twice the stiffness of an axis doubles its force and does not change the others."""
    q, still = 1e-6 * rng.normal(size=7), np.zeros(7)
    dynamics = models.dynamics("panda")
    J = TaskSpace(dynamics, "panda_hand").jacobian(dynamics.model.q0)
    soft = np.array([400.0, 400.0, 0.0, 20.0, 20.0, 20.0])
    stiff = soft * [2.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    more, less = (
        torque("cartesian_impedance", q, still, stiffness=K, damping=5.0) for K in (stiff, soft)
    )
    np.testing.assert_allclose(more - less, J[0] * -400.0 * (J[0] @ q), rtol=1e-4, atol=1e-9)
