# SPDX-License-Identifier: Apache-2.0
"""Arms that move on springs, against closed forms and independent integrations."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import models
from arm_dynamics import ArmModel, load_scene
from arm_sim import Simulator
from arm_sim.integrators.selection import choose, fastest_rate
from arm_sim.plant import Plant
from models.touching import rails
from tolerances import BACKENDS, ENERGY_DRIFT, PINOCCHIO, SPRING, assert_close

TWO_LINK = {"urdf": models.scene("two_link").robot.urdf}
PENDULUM = {"urdf": models.scene("pendulum").robot.urdf}
STILL = {"friction": {"viscous": 0.0, "coulomb": 0.0}}
BETWEEN = {
    "frames": ["forearm", "upper_arm"], "points": [[0.15, 0, 0.02], [0.2, 0, 0.1]],
    "stiffness": 120.0, "rest_length": 0.25, "damping": 1.5,
}  # fmt: skip
TO_WORLD = {
    "frames": ["upper_arm", "world"], "points": [[0.3, 0, 0], [0, 0, 0.6]],
    "stiffness": 80.0, "rest_length": 0.1, "damping": 0.5, "force": 15.0,
}  # fmt: skip


def test_a_pendulum_on_a_spring_swings_as_the_closed_form_says() -> None:
    """No gravity, 1 kg m²: a damped oscillation about the spring's rest."""
    k, c, rest = 40.0, 0.8, 0.3
    joints = {"swing": {"spring": {"stiffness": k, "rest": rest, "damping": c}}}
    scene = {"robot": PENDULUM, "gravity": [0, 0, 0], "joints": joints}
    run = Simulator(scene, tolerance=1e-12).run(2.0)
    omega, fall = np.sqrt(k - c**2 / 4), np.exp(-c / 2 * run.time)
    wave = np.cos(omega * run.time) + c / (2 * omega) * np.sin(omega * run.time)
    assert_close(run.q[:, 0], rest - rest * fall * wave, SPRING)
    assert abs(run.balance).max() < SPRING


@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_energy_goes_from_springs_to_motion_and_heat(damping: float) -> None:
    joints = {"*": {**STILL, "spring": {"stiffness": 8.0, "damping": damping}}}
    springs = [{**BETWEEN, "damping": damping}, {**TO_WORLD, "damping": damping}]
    start = {"position": {"shoulder": 0.9, "elbow": -1.5}}
    scene = {"robot": TWO_LINK, "joints": joints, "springs": springs, "initial": start}
    run = Simulator(scene).run(1.0, [1.0, -2.0])
    assert np.ptp(run.kinetic) > 0.5
    assert abs(run.balance).max() < ENERGY_DRIFT * np.ptp(run.potential)
    assert run.lost[-1] > 0.1 if damping else abs(run.lost).max() == 0.0


def test_a_cord_swings_free_until_it_is_taut() -> None:
    """A pendulum whose cord is slack to 0.5 rad beyond the vertical, against an integration
    that restarts there.
    """
    anchor = np.array([-0.6, 0.0])  # in the plane of the pendulum
    slack = float(np.hypot(np.sin(0.5) + 0.6, np.cos(0.5)))
    cord = {
        "frames": ["bob", "world"], "points": [[0, 0, -1], [anchor[0], 0, anchor[1]]],
        "stiffness": 300.0, "rest_length": slack, "tension_only": True,
    }  # fmt: skip
    scene = {"robot": PENDULUM, "springs": [cord], "initial": {"position": {"swing": -1.0}}}
    run = Simulator(scene, integrator="rk4", dt=2e-4).run(1.6)

    def swing(_: float, x: np.ndarray) -> list[float]:
        way = np.array([np.sin(x[0]), -np.cos(x[0])]) - anchor
        L = float(np.linalg.norm(way))
        torque = 300.0 * max(0.0, L - slack) * (way @ [np.cos(x[0]), np.sin(x[0])]) / L
        return [x[1], -9.81 * np.sin(x[0]) - torque]

    def taut(_: float, x: np.ndarray) -> float:
        return float(x[0] - 0.5)

    taut.terminal = True  # type: ignore[attr-defined]
    time, state = 0.0, np.array([-1.0, 0.0])
    while time < 1.6:
        part = solve_ivp(swing, (time, 1.6), state, "DOP853", events=taut, rtol=1e-12, atol=1e-12)
        time, state = float(part.t[-1]), part.y[:, -1]
        if time < 1.6:  # across the kink
            state = state + 1e-9 * np.array(swing(time, state))
            time += 1e-9
    assert run.q.max() > 0.55
    np.testing.assert_allclose(run.q[-1, 0], state[0], rtol=0.0, atol=1e-6)
    assert abs(run.balance).max() < 1e-6


def test_the_balanced_arm_needs_no_torque_wherever_it_is(rng: np.random.Generator) -> None:
    dyn = models.dynamics("spring_balanced_arm")
    q = rng.uniform(-np.pi, np.pi, (1000, 2))
    assert abs(dyn.gravity(q)).max() > 8.0
    assert_close(dyn.inverse(q, 0.0 * q, 0.0 * q), 0.0 * q, PINOCCHIO)
    assert np.ptp(dyn.energy(q, 0.0 * q)[1]) < PINOCCHIO


def test_arms_side_by_side_move_as_alone(rng: np.random.Generator) -> None:
    """Choices in the equations, of cords and play, are made for each arm of a register."""
    play = {
        "actuator": {"rotor_inertia": 1e-3},
        "transmission": {"stiffness": 300.0, "damping": 1.0, "backlash": 1e-2},
    }
    springs = [TO_WORLD, {**BETWEEN, "tension_only": True}]
    scene = {"robot": TWO_LINK, "springs": springs, "joints": {"elbow": play}}
    sim = Simulator(scene, integrator="rk4")
    q, v = rng.normal(size=(2, 5, 2))
    lanes = sim.rollout(q, v, np.zeros(2), 100, lanes=4)
    assert_close(lanes, sim.rollout(q, v, np.zeros(2), 100, lanes=1), BACKENDS)
    sim.reset(q[0], v[0])
    assert_close(lanes[0, :, :2], sim.run(0.1).q, BACKENDS)


def test_rate_of_springs_is_that_of_their_oscillation() -> None:
    """A mass on a wire: the roots of m s² + c s + k = 0; a cord counts as taut."""
    for k, c, wanted in ((400.0, 0.0, 20.0), (400.0, 50.0, 40.0), (0.0, 7.0, 7.0)):
        joints = {"y": {"spring": {"stiffness": k, "damping": c}}}
        cord = {
            "frames": ["body", "world"], "points": [[0, 0, 0], [0, 3, 0]], "stiffness": k,
            "damping": c, "force": 1e-9, "tension_only": True,
            **({"rest_length": 3.0} if k else {}),
        }  # fmt: skip
        for springs in ({"joints": joints}, {"springs": [cord]}):
            model = ArmModel(load_scene({**rails("y"), **springs}))
            assert fastest_rate(Plant(model)) == pytest.approx(wanted, rel=1e-6)


def test_a_stiff_cord_gets_error_control_although_it_is_slack() -> None:
    for stiffness, method, tolerance in (
        (1e2, "rk4", None), (1e8, "dop853", 1e-10), (1e10, "implicit", 1e-8)
    ):  # fmt: skip
        spring = {**TO_WORLD, "stiffness": stiffness, "rest_length": 2.0, "tension_only": True}
        plant = Plant(ArmModel(load_scene({"robot": TWO_LINK, "springs": [spring]})))
        choice = choose(plant, None, None, None)
        assert (choice.method.name, choice.tolerance) == (method, pytest.approx(tolerance))
