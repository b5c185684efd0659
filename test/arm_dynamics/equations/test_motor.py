# SPDX-License-Identifier: Apache-2.0
"""DC motors on rigid gears: current, speed, limits, cogging, and the rotor in the arm."""

from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import ArmModel, Dynamics, load_scene
from arm_sim import Simulator
from models.driven import WINDING, B, J, K, L, R, law, linear, of_states, wheel
from tolerances import ALGEBRA, MOTOR, PINOCCHIO, assert_close

URDF = str(models.FOLDER / "planar_3r.urdf")


def run(scene: Any, duration: float, command: float, **options: Any) -> Simulator:
    sim = Simulator(scene, backend="vm", **options)
    sim.run(duration, [command])
    return sim


# i [A] and ω [rad/s] under 12 V from rest, to twelve digits (mpmath).
STEP_RESPONSE = {
    0.001: (7.52342129490536481, 4.39717586565388795),
    0.01: (7.91604759339855606, 90.0006293962101245),
    0.05: (0.992437858136584018, 221.152515871459604),
}


@pytest.mark.parametrize("t", STEP_RESPONSE)
def test_step_response_to_the_reference_values(t: float) -> None:
    """At 1 kHz, by the method that is selected by default."""
    state = run(wheel(J, command="voltage", rotor_damping=B, **WINDING), t, 12.0).state
    np.testing.assert_allclose([state.z[0], state.v[0]], STEP_RESPONSE[t], rtol=MOTOR)


@pytest.mark.parametrize("ratio", [50.0, -50.0, 0.5])
def test_geared_motor_is_a_linear_system(ratio: float) -> None:
    """L i' = V - R i - K N v, (J_link + J N²) v' = N K i - b N² v: the matrix exponential."""
    link, volts, t = 0.2, 9.0, 0.02
    scene = wheel(
        link, command="voltage", gear_ratio=ratio, rotor_inertia=J, rotor_damping=B, **WINDING
    )
    inertia = link + J * ratio**2
    A = np.array([[-R / L, -K * ratio / L], [K * ratio / inertia, -B * ratio**2 / inertia]])
    wanted = linear(A, np.array([volts / L, 0.0]), np.zeros(2), t)
    state = run(scene, t, volts).state
    np.testing.assert_allclose([state.z[0], state.v[0]], wanted, rtol=MOTOR)


def test_rotor_is_pinocchios_armature(rng: np.random.Generator) -> None:
    joints = {
        "joint1": {"actuator": {"rotor_inertia": 2e-4, "gear_ratio": 100}},
        "joint3": {"actuator": {"rotor_inertia": 1e-4, "gear_ratio": -50}, "armature": 0.05},
    }
    dyn = Dynamics({"robot": {"urdf": URDF}, "joints": joints})
    plain = pin.buildModelFromXML(dyn.model.scene.robot.urdf)
    plain.gravity.linear = np.array(dyn.model.scene.gravity)
    plain.armature = np.array([2.0, 0.0, 0.3])
    q, v, tau = models.random_state(rng, 3)
    data = plain.createData()
    assert_close(dyn.mass_matrix(q), pin.crba(plain, data, q), PINOCCHIO)
    free = tau - dyn.friction(v)
    wanted = pin.aba(plain, data, q, v, free, pin.Convention.WORLD)
    assert_close(dyn.forward(q, v, tau), wanted, PINOCCHIO)
    sim = Simulator(dyn.model)
    slope = sim.arm.plant.rhs(np.concatenate([q, v]), tau, np.sign(v))
    assert_close(slope.full().ravel()[3:], wanted, ALGEBRA)


def test_torque_command_of_a_motor_without_limits_is_the_torque() -> None:
    """Bit for bit: a drop-in for an arm with armature."""
    urdf = models.scene("two_link").robot.urdf
    drive = {"rotor_inertia": 2e-4, "gear_ratio": 50, "torque_constant": 0.03, "resistance": 2}
    motors = Simulator({"robot": {"urdf": urdf}, "joints": {"*": {"actuator": drive}}})
    plain = Simulator({"robot": {"urdf": urdf}, "joints": {"*": {"armature": 2e-4 * 2500}}})
    for sim in (motors, plain):
        sim.run(0.2, [1.3, -0.4])
    np.testing.assert_array_equal(motors.state.q, plain.state.q)
    assert motors.state.z.size == 0


MOST, TOP = 3.0, 6.0
BY_CURRENT, BY_VOLTAGE = {"current_limit": MOST}, {"voltage_limit": TOP}
LIMITED: list[tuple[str, dict[str, float]]] = [
    ("torque", BY_CURRENT | BY_VOLTAGE), ("torque", BY_VOLTAGE), ("torque", BY_CURRENT),
    ("current", BY_CURRENT | BY_VOLTAGE), ("voltage", BY_CURRENT),
]  # fmt: skip


@pytest.mark.parametrize(("command", "limits"), LIMITED)
def test_torque_speed_curve(command: str, limits: dict[str, float]) -> None:
    """Of the current that is asked for, what the voltage can drive, and of that what may flow.

    Constant torque to the corner, a straight line to the no-load speed, braking beyond it; from
    (V + R I) / (N K) on, only the current limit is kept.
    """
    ratio, winding = 10.0, {"resistance": 0.8, "torque_constant": 0.05}
    scene = wheel(0.02, command=command, gear_ratio=ratio, **winding, **limits)
    torque = of_states(law(scene), 1)["torque"]
    most, top = limits.get("current_limit", np.inf), limits.get("voltage_limit", np.inf)
    for speed, asked in product(np.linspace(-36.0, 36.0, 25), [-1e3, -1.0, 0.0, 1.0, 1e3]):
        emf = 0.05 * ratio * speed
        wanted = {"torque": asked / (0.05 * ratio), "current": asked,
                  "voltage": (asked - emf) / 0.8}[command]  # fmt: skip
        current = np.clip(np.clip(wanted, (-top - emf) / 0.8, (top - emf) / 0.8), -most, most)
        assert_close(float(torque(0.0, speed, [], asked)), 0.05 * ratio * current, ALGEBRA)
    (drive,) = ArmModel(load_scene(scene)).drives
    assert drive is not None
    assert drive.overspeed == (pytest.approx(16.8) if len(limits) == 2 else np.inf)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_amplifier_limits_the_current_under_voltage(way: float) -> None:
    """A blocked rotor: i = V/R (1 - exp(-t R/L)) up to the limit, and there it stays."""
    scene = wheel(1e6, command="voltage", current_limit=8.0, **WINDING)
    sim = Simulator(scene, backend="vm", tolerance=1e-9)
    recording = sim.run(0.01, [way * 12.0])
    reached = -L / R * np.log(1.0 - 8.0 * R / 12.0)
    before = recording.time < reached
    wanted = way * 12.0 / R * (1.0 - np.exp(-recording.time * R / L))
    np.testing.assert_allclose(recording.z[before, 0], wanted[before], rtol=1e-6)
    np.testing.assert_allclose(recording.z[~before, 0], way * 8.0, rtol=1e-6)
    falling = sim.run(0.005, [0.0]).z[:, 0]
    np.testing.assert_allclose(falling[-1], way * 8.0 * np.exp(-5.0), rtol=1e-5)
