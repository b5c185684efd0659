# SPDX-License-Identifier: Apache-2.0
"""Models with internal states: x = (q, v, z) through every part of the simulator.

The law is a toy, a coil on a joint, so that what is tested is the simulator and not a motor.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from samples import covering
from scipy.integrate import solve_ivp

import models
from arm_dynamics import ArmModel, Dynamics, InvalidInput, load_scene
from arm_dynamics.actuation import StateKind
from arm_dynamics.actuation.drives import states_of
from arm_sim import Simulator
from models.toy_law import Motor
from tolerances import assert_close

Build = Callable[..., Simulator]
FRICTION = {"viscous": 0.1, "coulomb": 0.0}


def scene_of(friction: dict[str, float]) -> dict[str, Any]:
    scene = models.scene("double_pendulum").model_dump(exclude_unset=True)
    return scene | {"joints": {"*": {"friction": friction}}}


@pytest.fixture
def build(monkeypatch: pytest.MonkeyPatch) -> Build:
    """Simulators of the double pendulum with a motor on its first joint."""

    def make(law: Motor, friction: dict[str, float] = FRICTION, **options: Any) -> Simulator:
        monkeypatch.setattr("arm_sim.plant.plant.laws_of", lambda model: (law,))
        monkeypatch.setattr("arm_sim.stepping.stepper.recipe_of", lambda *_: "")  # has no such law
        return Simulator(scene_of(friction), **options)

    return make


@cache
def truth(L: float, duration: float) -> np.ndarray:
    """State after a while by SciPy, from Pinocchio's dynamics and the law in plain numbers."""
    law, u = Motor((True, False), L=L), U
    dynamics = Dynamics(scene_of(FRICTION))
    n = dynamics.n

    def slope(_: float, x: np.ndarray) -> np.ndarray:
        q, v, z = x[:n], x[n : 2 * n], x[2 * n :]
        current = z[0] if law.L else (u[0] - law.K * v[0]) / law.R
        tau = np.array([law.K * current, u[1]])
        dz = [(u[0] - law.R * z[0] - law.K * v[0]) / law.L] if law.L else []
        return np.concatenate([v, dynamics.forward(q, v, tau), dz])

    x0 = np.concatenate([dynamics.model.q0, dynamics.model.v0, np.zeros(int(L > 0.0))])
    return solve_ivp(slope, (0.0, duration), x0, "Radau", rtol=1e-11, atol=1e-12).y[:, -1]


U = np.array([3.0, 0.2])
CASES: list[dict[str, Any]] = [
    {"integrator": "rk4"},
    {"integrator": "dopri5"},
    {"integrator": "dop853", "tolerance": 1e-10},
    {"integrator": "implicit"},
    {"integrator": "implicit", "tolerance": 1e-10},
]


@pytest.mark.parametrize(("options", "L"), covering(CASES, [0.01, 0.0]), ids=str)
def test_agrees_with_scipy(build: Build, options: dict[str, Any], L: float) -> None:
    law = Motor((True, False), L=L)
    sim = build(law, **options)
    wanted = truth(L, 0.3)
    run = sim.run(0.3, U)
    state = sim.state
    assert_close(np.concatenate([state.q, state.v, state.z]), wanted, 1e-7)
    assert run.z.shape == (301, sim.arm.plant.nz)
    assert_close(run.command[:, 0], np.full(301, 3.0), 0.0)


def test_orders_hold_with_states(build: Build) -> None:
    law = Motor((True, False), L=0.05)
    for name, order in (("semi_implicit_euler", 1), ("rk4", 4), ("nystrom4", 4)):
        errors = []
        for dt in (0.004, 0.002):
            sim = build(law, integrator=name, dt=dt)
            wanted = truth(law.L, 0.2)[: sim.n]
            errors.append(np.abs(sim.run(0.2, U).q[-1] - wanted).max())
        assert abs(np.log2(errors[0] / errors[1]) - order) < 0.3, name


def test_torque_at_the_joint_is_the_motors(build: Build) -> None:
    law = Motor((True, False))
    sim = build(law, integrator="rk4")
    run = sim.run(0.05, U)
    assert_close(run.tau[:-1, 0], law.K * run.z[1:, 0], 1e-15)
    assert_close(run.tau[:, 1], np.full(51, U[1]), 0.0)
    assert_close(sim.effort, run.tau[-1], 1e-15)


def test_dry_friction_holds_until_the_current_has_grown(build: Build) -> None:
    """From rest, i = V/R (1 - e^(-Rt/L)): the joint leaves at K i = Fs, not before."""
    law = Motor((True, False), K=1.0, R=1.0, L=0.1)
    sim = build(law, {"viscous": 0.0, "coulomb": 0.3, "static": 0.5}, integrator="rk4")
    sim.reset([0.0, 0.0])
    run = sim.run(0.2, [1.0, 0.0])
    leaves = -0.1 * np.log(0.5)
    moving = run.time[np.nonzero(run.v[:, 0])[0][0]]
    assert moving - 1e-3 <= leaves <= moving
    assert not run.v[run.time < leaves - 1e-3].any()


def test_states_are_set_and_named(build: Build) -> None:
    sim = build(Motor((True, False)), integrator="rk4")
    assert sim.z_names == ("joint0 current [A]",)
    assert sim.reset(z=[0.25]).z[0] == 0.25
    assert sim.set_state(z=[0.5]).z[0] == 0.5
    assert sim.set_state(q=[1.0, 0.0]).z[0] == 0.0
    with pytest.raises(InvalidInput, match=r"z has shape \(2,\)"):
        sim.reset(z=[0.0, 0.0])


def test_auto_sees_how_fast_a_coil_is(build: Build) -> None:
    quick = build(Motor((True, False), L=0.01))
    assert quick.plan.integrator == "dop853" and quick.choice.tolerance
    plan = build(Motor((True, False), L=1e-6)).plan
    assert plan.integrator == "implicit" and "its drive" in plan.reason


@pytest.mark.parametrize(("ratio", "scale"), [(0.5, 1.0), (4.0, 0.25), (-4.0, 0.25)])
def test_currents_are_scaled_to_torques_at_the_joint(ratio: float, scale: float) -> None:
    """An ampere that makes 4 N m at the joint counts like a quarter, whichever way it turns."""
    motor = {"command": "voltage", "resistance": 1.0, "inductance": 1e-3, "gear_ratio": ratio,
             "torque_constant": 1.0, "back_emf_constant": 1.0}  # fmt: skip
    given = models.scene("two_link").model_dump(exclude_unset=True)
    model = ArmModel(load_scene(given | {"joints": {"elbow": {"actuator": motor}}}))
    (current,) = states_of(model.drives[1], 1, "elbow", True)
    assert (current.joint, current.kind, current.scale) == (1, StateKind.CURRENT, scale)
