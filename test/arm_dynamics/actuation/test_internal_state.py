# SPDX-License-Identifier: Apache-2.0
"""Models with internal states: x = (q, v, z) through every method and the plan."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, InvalidInput, load_scene
from arm_dynamics.actuation import StateKind
from arm_dynamics.actuation.drives import states_of
from arm_sim import Simulator
from models.driven import linear, wheel
from tolerances import assert_close

# A coil on a wheel, L i' = V - R i - K ω and J ω' = K i.
J, R, L, K, VOLTS, T = 0.05, 2.0, 0.05, 0.5, 3.0, 0.2
COIL = {"command": "voltage", "resistance": R, "torque_constant": K}
METHODS: list[dict[str, Any]] = [
    {"integrator": "rk4"},
    {"integrator": "dopri5"},
    {"integrator": "dop853", "tolerance": 1e-10},
    {"integrator": "implicit"},
    {"integrator": "nystrom4"},
]


def exact() -> np.ndarray:
    """Angle, speed and current after a while."""
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, K / J], [0.0, -K / L, -R / L]])
    return linear(A, np.array([0.0, 0.0, VOLTS / L]), np.zeros(3), T)


@pytest.mark.parametrize("options", METHODS, ids=str)
def test_agrees_with_the_matrix_exponential(options: dict[str, Any]) -> None:
    run = Simulator(wheel(J, inductance=L, **COIL), **options).run(T, [VOLTS])
    assert_close(np.concatenate([run.q[-1], run.v[-1], run.z[-1]]), exact(), 1e-7)
    assert_close(run.tau[:-1, 0], K * run.z[1:, 0], 1e-15)


def test_dry_friction_holds_until_the_current_has_grown() -> None:
    """From rest, i = V/R (1 - e^(-Rt/L)): the joint leaves at K i = Fs, not before."""
    scene = wheel(J, inductance=L, **COIL)
    scene["joints"]["axle"]["friction"] = {"coulomb": 0.3, "static": 0.5}
    run = Simulator(scene, integrator="rk4").run(0.2, [VOLTS])
    leaves = -L / R * np.log(1.0 - 0.5 * R / (K * VOLTS))
    moving = run.time[np.nonzero(run.v[:, 0])[0][0]]
    assert moving - 1e-3 <= leaves <= moving
    assert not run.v[run.time < leaves - 1e-3].any()


def test_states_are_set_and_named() -> None:
    sim = Simulator(wheel(J, inductance=L, **COIL), integrator="rk4")
    assert sim.z_names == ("axle motor current [A]",)
    assert sim.reset(z=[0.25]).z[0] == 0.25
    assert sim.set_state(z=[0.5]).z[0] == 0.5
    assert sim.set_state(q=[1.0]).z[0] == 0.0
    with pytest.raises(InvalidInput, match=r"z has shape \(2,\)"):
        sim.reset(z=[0.0, 0.0])


def test_the_choice_of_a_method_sees_how_fast_a_coil_is() -> None:
    assert Simulator(wheel(J, inductance=L, **COIL)).plan.integrator == "dop853"
    plan = Simulator(wheel(J, inductance=1e-6, **COIL)).plan
    assert plan.integrator == "implicit" and "its drive" in plan.reason


@pytest.mark.parametrize(("ratio", "scale"), [(0.5, 1.0), (-4.0, 0.25)])
def test_currents_are_scaled_to_torques_at_the_joint(ratio: float, scale: float) -> None:
    """An ampere that makes 4 N m at the joint counts like a quarter, whichever way it turns."""
    motor = {"command": "voltage", "resistance": 1.0, "inductance": 1e-3, "gear_ratio": ratio,
             "torque_constant": 1.0, "back_emf_constant": 1.0}  # fmt: skip
    given = models.scene("two_link").model_dump(exclude_unset=True)
    model = ArmModel(load_scene(given | {"joints": {"elbow": {"actuator": motor}}}))
    (current,) = states_of(model.drives[1], 1, "elbow", True)
    assert (current.joint, current.kind, current.scale) == (1, StateKind.CURRENT, scale)
