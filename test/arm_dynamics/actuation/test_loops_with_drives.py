# SPDX-License-Identifier: Apache-2.0
"""Closed chains whose joints have motors, springs and bristles."""

from typing import Any

import numpy as np
import pytest
from samples import sampled

import models
from arm_dynamics import load_scene
from arm_sim import Simulator
from tolerances import CLOSURE, CLOSURE_SPEED, assert_close

MOTOR = {"rotor_inertia": 1e-4, "gear_ratio": 20.0}
LAWS: dict[str, dict[str, Any]] = {
    "armature": {"actuator": MOTOR},
    "voltage": {"actuator": {**MOTOR, "torque_constant": 0.05, "resistance": 1.0,
                             "inductance": 1e-3, "command": "voltage"}},
    "belt": {"actuator": MOTOR, "transmission": {"stiffness": 500.0, "damping": 0.3}},
    "bristles": {"friction": {"coulomb": 0.2, "lugre": {"sigma0": 1e4, "sigma1": 10.0}}},
}  # fmt: skip


@pytest.mark.parametrize("law", sampled(LAWS, 2))
def test_loop_stays_closed_and_the_account_closes(law: str) -> None:
    free = load_scene(models.SCENES / "four_bar.yaml")
    crank = Simulator(free).joint_names[0]
    scene = load_scene({**free.model_dump(exclude_unset=True), "joints": {crank: LAWS[law]}})
    sim = Simulator(scene, tolerance=1e-9)
    run = sim.run(0.5, np.array([1.0, 0.0, 0.0]))
    rows = sim.dynamics.constrained.closure.rows.stacked(
        sim.state.q, sim.state.v, sim.held_constraints
    )
    assert abs(rows.residual).max() < CLOSURE
    assert abs(rows.jacobian @ sim.state.v).max() < CLOSURE_SPEED
    assert abs(sim.state.q - run.q[0]).max() > 0.05
    assert_close(run.balance, np.zeros(len(run)), 1e-6)
