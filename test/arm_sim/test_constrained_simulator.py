# SPDX-License-Identifier: Apache-2.0
"""Simulators of scenes with constraints: switches, rollouts, derivatives, what is refused."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ConstraintError, InvalidInput
from arm_sim import Simulator
from models.linkages import TIP, interpreted, scene, worst_gaps
from tolerances import CLOSURE, CLOSURE_SPEED, assert_close


def pen(active: bool, *others: dict[str, Any], **joints: Any) -> Simulator:
    sheet = {
        "type": "plane", "name": "sheet", "height": -0.4, "switchable": True, "active": active,
    }  # fmt: skip
    pin = {"type": "point", "name": "pin", "switchable": True, "active": False,
           "points": [[0, 0, 0], [2.0, 0, 0]]}  # fmt: skip
    start = {"position": {"shoulder": -0.5, "elbow": -0.3}}
    build = Simulator if others else interpreted
    return build({"robot": {"urdf": str(models.SCENES / "two_link.urdf")}, "initial": start,
                  "constraints": [sheet | TIP, pin | TIP, *others], "joints": joints})  # fmt: skip


def test_switching() -> None:
    sim = pen(active=True)
    assert sim.held_constraints == ("sheet",)
    held = sim.run(0.2)
    assert sim.multipliers()[0] != 0.0
    sim.set_constraint("sheet", False)
    assert sim.held_constraints == ()
    np.testing.assert_array_equal(sim.multipliers(), np.zeros(4))
    free, plain = sim.run(0.1), interpreted(str(models.SCENES / "two_link.urdf"))
    plain.reset(held.q[-1], held.v[-1])
    assert_close(free.q[-1], plain.run(0.1).q[-1], 1e-11)  # of two methods
    state = sim.set_constraint("sheet", True)
    assert state.time == free.time[-1]
    gap, speed = worst_gaps(sim, sim.run(0.2), 1)
    assert gap < CLOSURE
    assert speed < CLOSURE_SPEED


def test_switching_leaves_the_states_of_laws_alone() -> None:
    bristles = {"coulomb": 0.2, "lugre": {"sigma0": 1e3, "sigma1": 1.0}}
    sim = pen(active=True, elbow={"friction": bristles})
    bent = sim.run(0.05).z[-1]
    assert bent.any()
    np.testing.assert_array_equal(sim.set_constraint("sheet", False).z, bent)


def test_switching_on_takes_the_velocity_across_only() -> None:
    """As a blow without rebound: the impulse is Aᵀ times something."""
    sim = pen(active=False)
    sim.reset(v=[1.0, 2.0])
    q, before = sim.state.q, sim.state.v
    state = sim.set_constraint("sheet", True)
    rows = sim.dynamics.constrained.closure.rows
    A = rows.stacked(state.q, state.v, ("sheet",)).jacobian[0]
    impulse = sim.dynamics.mass_matrix(state.q) @ (before - state.v)
    assert abs(impulse[0] * A[1] - impulse[1] * A[0]) < 1e-10
    assert abs(state.q - q).max() < 0.5


def test_what_cannot_be_switched_loses_nothing() -> None:
    sim = pen(active=True)
    sim.run(0.1)
    before = sim.state
    with pytest.raises(ConstraintError, match="'pin' by"):
        sim.set_constraint("pin", True)
    with pytest.raises(InvalidInput, match="'roof' cannot be switched; switchable: sheet, pin"):
        sim.set_constraint("roof", True)
    assert sim.state is before
    assert sim.held_constraints == ("sheet",)
    sim.run(0.1)


def test_what_would_be_switched_on_behind_a_ceiling_stays_off() -> None:
    plane = {"point": [0, 0, -0.45], "normal": [0, 0, -1]}
    sim = pen(False, {"type": "contact", "name": "ceiling", "frame": "tip", "plane": plane})
    before = sim.state
    with pytest.raises(ConstraintError, match="'ceiling' is .* m inside its plane"):
        sim.set_constraint("sheet", True)
    assert sim.state is before and sim.held_constraints == ()


def test_rollouts_close_positions_and_velocities() -> None:
    """Positions that obey already stay as they are; speeds across the loop are lost."""
    sim = interpreted(scene("four_bar"))
    q = sim.state.q + np.array([[0.0, 0, 0], [0.01, 0, 0], [0.0, 0.02, -0.01]])
    motion = sim.rollout(q, 0 * q, np.zeros(3), 5)
    residuals = [sim.dynamics.constrained.closure.residuals(x[:3])["loop"] for x in motion[:, -1]]
    assert max(residuals) < CLOSURE
    q, v = np.tile(sim.state.q, (2, 1)), np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    motion = sim.rollout(q, v, np.zeros(3), 1)
    A = sim.dynamics.constrained.closure.rows.stacked(q[0], v[0], ("loop",)).jacobian
    assert np.abs(A @ v[0]).max() > 0.01
    assert np.abs(A @ motion[0, 0, 3:]).max() < CLOSURE_SPEED < np.abs(motion[0, 0, 3:]).max()
    np.testing.assert_array_equal(motion[1, 0], np.r_[q[1], v[1]])
