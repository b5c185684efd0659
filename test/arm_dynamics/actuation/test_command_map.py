# SPDX-License-Identifier: Apache-2.0
"""Commands for torques: what a controller sends to motors driven by current or voltage."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, load_scene
from arm_dynamics.actuation import rigid_twin
from arm_dynamics.control import ComputedTorque
from arm_dynamics.trajectory import Reference
from arm_sim import Simulator
from arm_sim.plant.actuation import computed_torque
from models.driven import wheel
from tolerances import ALGEBRA, INVERSE_PAIR, PINOCCHIO, assert_close

URDF = models.scene("two_link").robot.urdf
MOTOR = {"resistance": 0.8, "torque_constant": 0.06, "rotor_inertia": 3e-5, "gear_ratio": -50.0}
POLES = {"cogging": {"amplitude": 0.01, "order": 4, "phase": 0.2}}
SOFT = {"stiffness": 3e3, "damping": 4.0}


def arm(**drive: Any) -> dict[str, Any]:
    return {"robot": {"urdf": URDF}, "joints": {"*": drive}}


def test_voltage_of_a_motion_by_hand() -> None:
    """V = R τ / (N K_t) + N K_e v, for one state and for many."""
    dyn = Dynamics(wheel(command="voltage", **MOTOR))
    q, v, a = np.array([[0.3], [0.1]]), np.array([[2.0], [-1.0]]), np.array([[5.0], [0.5]])
    tau = dyn.inverse(q, v, a)
    wanted = 0.8 * tau / (-50 * 0.06) - 50.0 * 0.06 * v
    assert_close(dyn.command(q, v, a), wanted, PINOCCHIO)
    assert_close(dyn.command(q[0], v[0], a[0]), wanted[0], PINOCCHIO)


@pytest.mark.parametrize(
    ("command", "gain", "back_emf"), [("current", 0.5, 0.0), ("voltage", 1.0, 2.0)]
)
def test_one_motor_beside_a_joint_commanded_by_torque(
    command: str, gain: float, back_emf: float
) -> None:
    """N K_t = 2 N m/A = 2 V s/rad."""
    motor = {"command": command, "resistance": 2.0, "torque_constant": 0.04,
             "rotor_inertia": 0.0, "gear_ratio": 50.0}  # fmt: skip
    dyn = Dynamics({"robot": {"urdf": URDF}, "joints": {"elbow": {"actuator": motor}}})
    v, tau = np.array([3.0, -1.0]), np.array([5.0, 7.0])
    wanted = [5.0, gain * 7.0 - back_emf]
    assert_close(dyn.command_map(np.zeros(2), v, tau), wanted, ALGEBRA)


@pytest.mark.parametrize("command", ["torque", "current", "voltage"])
def test_command_gives_the_acceleration_it_was_asked_for(
    command: str, rng: np.random.Generator
) -> None:
    """Rigid drives without inductance: to rounding."""
    sim = Simulator(arm(actuator=MOTOR | POLES | {"command": command}), backend="vm")
    for _ in range(5):
        q, v, a = models.random_state(rng, 2)
        u = sim.dynamics.command(q, v, a)
        slope = sim.arm.plant.free.rhs(np.concatenate([q, v]), u, np.zeros(0)).full().ravel()
        assert_close(slope[2:], a, INVERSE_PAIR)


def test_rotors_behind_springs_are_moved_too(rng: np.random.Generator) -> None:
    """The command of a flexible arm is that of the same arm with rigid transmissions."""
    motor = MOTOR | {"command": "voltage", "rotor_damping": 2e-5}
    soft = load_scene(arm(actuator=motor, transmission=SOFT))
    q, v, a = models.random_state(rng, 2)
    rigid = Dynamics(arm(actuator=motor))
    assert_close(Dynamics(soft).command(q, v, a), rigid.command(q, v, a), ALGEBRA)
    twin = Dynamics(rigid_twin(soft))
    assert_close(twin.mass_matrix(q), rigid.mass_matrix(q), PINOCCHIO)
    assert not any(drive.coupling for drive in twin.model.drives if drive)


def sine(t: float) -> Reference:
    """0.3 rad at 3 rad/s."""
    s, c = 0.3 * np.sin(3 * t), 0.3 * np.cos(3 * t)
    return Reference(np.full(2, 0.3 - c), np.full(2, 3 * s), np.full(2, 9 * c))


def test_compiled_computed_torque_commands_volts() -> None:
    """The same motion as the controller in Python, to rounding."""
    sim = Simulator(arm(actuator=MOTOR | POLES | {"command": "voltage"}))
    dyn, control = sim.dynamics, ComputedTorque(sim.dynamics, bandwidth=15.0)
    first = sim.run(0.1, lambda s: dyn.command_map(s.q, s.v, control.torque(s, sine(s.time))))
    sim.reset()
    second = sim.run(0.1, computed_torque(sim.model, sine, bandwidth=15.0))
    assert abs(first.command).max() > 5.0
    assert_close(second.q, first.q, ALGEBRA)
    assert_close(second.command, first.command, 1e-8)


@pytest.mark.parametrize("command", ["torque", "current", "voltage"])
def test_factors_make_the_same_commands_to_the_bit(command: str, rng: np.random.Generator) -> None:
    commands = Dynamics(arm(actuator=MOTOR | {"command": command})).command_map
    q, v, tau = rng.normal(size=(3, 2))
    factors = commands.factors
    made = factors[0] * tau + factors[1] * v if factors else tau
    assert made.tobytes() == commands(q, v, tau).tobytes()
    weightless = arm() | {"commands": {"gravity_compensated": True}}
    for by_position in (arm(actuator=MOTOR | POLES), weightless):
        assert Dynamics(by_position).command_map.factors is None
