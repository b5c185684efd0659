# SPDX-License-Identifier: Apache-2.0
"""Drives on arms of every kind."""

from typing import Any

import numpy as np
import pytest
from samples import covering

import models
from arm_sim import Simulator
from models.linkages import scene
from tolerances import CLOSURE, CLOSURE_SPEED, assert_close

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
KINDS: dict[str, Any] = {
    "rigid": {"actuator": MOTOR},
    "lossy": {"actuator": MOTOR | {"efficiency": 0.8}},
    "belt": {"actuator": MOTOR, "transmission": BELT},
    "harmonic": {"actuator": MOTOR, "transmission": HARMONIC},
}


@pytest.mark.parametrize(("robot", "kind"), covering(["gantry", "gripper", "scara"], KINDS))
def test_every_kind_of_arm_moves_and_keeps_its_account(robot: str, kind: str) -> None:
    """Sliding joints, mimic joints, branches: no energy is created."""
    given = models.scene(robot).model_dump(exclude_unset=True)
    free = {"limits": {"stop": False}}  # some arms start at a stop
    backend = "auto" if kind == "lossy" else "vm"
    sim = Simulator(given | {"joints": {"*": KINDS[kind] | free}}, backend=backend)
    volts = 8.0 * np.sin(0.04 * np.arange(50))[:, None] * np.ones(sim.n)
    recording = sim.run(0.05, volts)
    assert abs(recording.q[-1] - recording.q[0]).max() > 1e-4
    assert abs(recording.balance).max() < 1e-6 * recording.supplied[-1]


BRISTLES = {"friction": {"coulomb": 0.2, "lugre": {"sigma0": 1e4, "sigma1": 10.0}}}
GEARED = {"rotor_inertia": 1e-4, "gear_ratio": 20.0}
FLEXIBLE = {"actuator": GEARED, "transmission": {"stiffness": 500.0, "damping": 0.3}}


@pytest.mark.parametrize("law", [FLEXIBLE, BRISTLES], ids=["belt", "bristles"])
def test_loop_stays_closed_and_the_account_closes(law: dict[str, Any]) -> None:
    crank = models.dynamics("four_bar").joint_names[0]
    sim = Simulator(scene("four_bar", joints={crank: law}), tolerance=1e-9)
    run = sim.run(0.5, np.array([1.0, 0.0, 0.0]))
    rows = sim.dynamics.constrained.closure.rows.stacked(
        sim.state.q, sim.state.v, sim.held_constraints
    )
    assert abs(rows.residual).max() < CLOSURE
    assert abs(rows.jacobian @ sim.state.v).max() < CLOSURE_SPEED
    assert abs(sim.state.q - run.q[0]).max() > 0.05
    assert_close(run.balance, np.zeros(len(run)), 1e-6)
