# SPDX-License-Identifier: Apache-2.0
"""Flexible joints, belts and harmonic drives: against closed forms, and rigid in the limit."""

from typing import Any

import numpy as np

from arm_sim import Simulator
from models.driven import law, linear, of_states, wheel
from tolerances import PINOCCHIO, assert_close

# Rotor and link of a two-mass oscillator, as seen at the joint.
LINK, ROTOR, RATIO = 0.1, 2e-5, 50.0
AT_JOINT = ROTOR * RATIO**2


def drive(transmission: dict[str, Any], **actuator: Any) -> Any:
    return wheel(LINK, transmission, rotor_inertia=ROTOR, gear_ratio=RATIO, **actuator)


def test_two_masses_on_a_spring() -> None:
    """A belt from rest under a held torque, against the matrix exponential."""
    k, d, b, tau, t = 80.0, 0.2, 1e-5, 1.5, 0.3
    scene = drive({"stiffness": k, "damping": d}, rotor_damping=b)
    sim = Simulator(scene, tolerance=1e-10, backend="vm")
    sim.run(t, [tau])
    A = np.zeros((4, 4))  # q, v, θ, θ'
    A[0, 1] = A[2, 3] = 1.0
    A[1] = np.array([-k, -d, k, d]) / LINK
    A[3] = np.array([k, d, -k, -d - b * RATIO**2]) / AT_JOINT
    wanted = linear(A, np.array([0, 0, 0, tau / AT_JOINT]), np.zeros(4), t)
    got = [*sim.state.q, *sim.state.v, *sim.state.z]
    assert_close(got, wanted, 1e-8)


PLAY = {"stiffness": 2e3, "damping": 1.0, "backlash": 0.02}


def test_within_the_play_nothing_is_transmitted() -> None:
    flow = of_states(law(drive(PLAY)), 1)
    for twist in (-0.0099, -0.004, 0.0, 0.0099):
        assert float(flow["torque"]([0.3], [2.0], [0.3 + twist, -1.0], [0.0])) == 0.0
    assert_close(float(flow["torque"]([0], [0], [0.015, 0], [0])), 2e3 * 0.005, PINOCCHIO)
    assert_close(float(flow["torque"]([0], [0], [-0.015, 0], [0])), -2e3 * 0.005, PINOCCHIO)


def test_flanks_push_and_never_pull() -> None:
    """However fast the teeth separate, neither pulls the other."""
    flow = of_states(law(drive(PLAY)), 1)
    for side in (1.0, -1.0):
        pull = float(flow["torque"]([0.0], [0.0], [side * 0.0101, -side * 50.0], [0.0]))
        assert pull == 0.0
        push = float(flow["torque"]([0.0], [0.0], [side * 0.0101, side * 50.0], [0.0]))
        assert side * push > 50.0


def test_teeth_rattle_with_restitution_and_keep_momentum() -> None:
    """Without damping a collision of two masses in the play gives the speeds of the textbook."""
    sim = Simulator(drive(PLAY | {"damping": 0.0}), tolerance=1e-11, dt=1e-4, backend="vm")
    sim.reset(z=[0.0, 1.0])
    sim.run(0.03)  # through the gap and back into it
    v, w = sim.state.v[0], sim.state.z[1]
    total = AT_JOINT + LINK
    assert_close([v, w], [2 * AT_JOINT / total, (AT_JOINT - LINK) / total], 1e-6)


ERROR = {"amplitude": 2e-3, "order": 2.0, "phase": 0.4}


def test_kinematic_error_shifts_the_output_by_itself() -> None:
    """Without load the output stands where the geometry puts it."""
    harmonic = {"stiffness": 1e4, "kinematic_error": ERROR}
    drives = law(drive(harmonic))
    for q in (-1.0, 0.0, 0.7):
        position, speed = drives.initial(np.array([q]), np.array([0.5]))
        error = 2e-3 * np.sin(2 * RATIO * position + 0.4)
        assert_close(position + error, q, PINOCCHIO)
        flow = of_states(drives, 1)
        torque = float(flow["torque"]([q], [0.5], [position, speed], [0]))
        assert abs(torque) < 1e-10
        faster = 2e-3 * 2 * RATIO * np.cos(2 * RATIO * position + 0.4)
        assert_close(speed * (1.0 + faster), 0.5, PINOCCHIO)  # the spring is not being wound
