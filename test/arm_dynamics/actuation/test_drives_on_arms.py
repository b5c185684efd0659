# SPDX-License-Identifier: Apache-2.0
"""Drives on arms of every kind."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from samples import sampled

import models
from arm_sim import Simulator

MOTOR = {
    "command": "voltage", "resistance": 0.8, "inductance": 8e-4, "torque_constant": 0.06,
    "rotor_inertia": 3e-5, "rotor_damping": 1e-5, "gear_ratio": -60.0, "voltage_limit": 24.0,
}  # fmt: skip
BELT = {"stiffness": 2e3, "damping": 3.0}
HARMONIC = BELT | {
    "stiffening": 1e5,
    "hysteresis": {"torque": 0.5, "deflection": 1e-3},
    "kinematic_error": {"amplitude": 1e-3, "order": 2},
}
KINDS: dict[str, dict[str, Any]] = {
    "rigid": {"actuator": MOTOR},
    "lossy": {"actuator": MOTOR | {"efficiency": 0.8}},
    "belt": {"actuator": MOTOR, "transmission": BELT},
    "harmonic": {"actuator": MOTOR, "transmission": HARMONIC},
}


@pytest.mark.parametrize(
    ("robot", "kind"), sampled(product(["gantry", "gripper", "scara"], KINDS), 4)
)
def test_every_kind_of_arm_moves_and_keeps_its_account(robot: str, kind: str) -> None:
    """Sliding joints, mimic joints, branches: no energy is created."""
    scene = models.scene(robot).model_dump(exclude_unset=True)
    free = {"limits": {"stop": False}}  # some arms start at a stop
    backend = "auto" if kind == "lossy" else "vm"
    sim = Simulator(scene | {"joints": {"*": KINDS[kind] | free}}, backend=backend)
    volts = 8.0 * np.sin(0.04 * np.arange(50))[:, None] * np.ones(sim.n)
    recording = sim.run(0.05, volts)
    assert abs(recording.q[-1] - recording.q[0]).max() > 1e-4
    assert abs(recording.balance).max() < 1e-6 * recording.supplied[-1]
