# SPDX-License-Identifier: Apache-2.0
"""Every drive accounts for its energy: what it stores changes by what comes in, is lost, goes out.

Of one wheel at an instant, where no integrator is involved, ∂E/∂x · x' = supplied - lost -
torque · v; and on arms of every kind, along a motion.
"""

from typing import Any

import numpy as np
import pytest
from samples import covering

import models
from arm_sim import Simulator
from models.driven import law, of_states, wheel
from models.linkages import scene
from tolerances import ALGEBRA, CLOSURE, CLOSURE_SPEED, assert_close

WINDING = {"resistance": 0.8, "torque_constant": 0.06}
ROTOR = {"rotor_inertia": 4e-5, "rotor_damping": 2e-5, "gear_ratio": -60.0}
VOLTAGE = WINDING | ROTOR | {"command": "voltage", "inductance": 8e-4}
COGGING = {"cogging": {"amplitude": 5e-3, "order": 6, "phase": 0.3}}
HARMONIC = {
    "stiffness": 4e3, "damping": 1.5, "stiffening": 1e6,
    "hysteresis": {"torque": 3.0, "deflection": 2e-3, "sharpness": 1.7},
    "kinematic_error": {"amplitude": 3e-3, "order": 2.0, "phase": 0.2},
}  # fmt: skip

DRIVES: dict[str, Any] = {
    "torque": wheel(gear_ratio=30.0),
    "torque, limited": wheel(**WINDING, gear_ratio=30.0, current_limit=4.0, voltage_limit=24.0),
    "voltage, no inductance": wheel(**WINDING, command="voltage", gear_ratio=10.0),
    "voltage, no inductance, limited": wheel(**WINDING, command="voltage", current_limit=3.0),
    "voltage, limited": wheel(**VOLTAGE, current_limit=2.0),
    "another back-EMF": wheel(**VOLTAGE, back_emf_constant=0.07),
    "belt under voltage": wheel(0.1, {"stiffness": 300.0, "damping": 2.0}, **VOLTAGE, **COGGING),
    "play": wheel(0.1, {"stiffness": 900.0, "damping": 2.0, "backlash": 0.6}, **VOLTAGE),
    "harmonic drive": wheel(0.1, HARMONIC, **VOLTAGE, **COGGING),
    "harmonic drive under torque": wheel(0.1, HARMONIC, **ROTOR),
}


def states(rng: np.random.Generator, nz: int, number: int = 50) -> Any:
    """Positions, velocities, states and commands; a hysteresis stays below one."""
    for _ in range(number):
        q, z = rng.uniform(-1.0, 1.0), rng.uniform(-0.99, 0.99, nz)
        yield [q], rng.normal(0.0, 2.0, 1), q + z if nz in (2, 3) else z, rng.normal(0.0, 20.0, 1)


@pytest.mark.parametrize("name", DRIVES)
def test_energy_is_accounted_for_and_only_supplied(name: str, rng: np.random.Generator) -> None:
    drives = law(DRIVES[name])
    of = of_states(drives, 1)
    for x in states(rng, len(drives.states)):
        now = {name: float(of[name](*x)) for name in of if name != "slope"}
        out = now["supplied"] - now["lost"] - now["torque"] * x[1][0]
        scale = abs(now["supplied"]) + abs(now["lost"]) + 1.0
        assert_close(now["rate"] / scale, out / scale, ALGEBRA)
        assert now["stored"] >= 0.0
        assert now["lost"] >= -1e-12 or name == "another back-EMF"


def test_constants_that_differ_are_counted_as_a_loss(rng: np.random.Generator) -> None:
    """(K_e - K_t) i ω: in SI units the constants of an ideal motor are equal."""
    drives = law(DRIVES["another back-EMF"])
    lost = of_states(drives, 1)["lost"]
    for x in states(rng, 1, 20):
        i, speed = x[2][0], -60.0 * x[1][0]
        assert_close(float(lost(*x)), 0.8 * i**2 + 0.01 * i * speed, ALGEBRA)


MOTOR = VOLTAGE | {"voltage_limit": 24.0}
KINDS: dict[str, Any] = {
    "rigid": {"actuator": MOTOR},
    "lossy": {"actuator": MOTOR | {"efficiency": 0.8}},
    "belt": {"actuator": MOTOR, "transmission": {"stiffness": 2e3, "damping": 3.0}},
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


@pytest.mark.parametrize("joint", [FLEXIBLE, BRISTLES], ids=["belt", "bristles"])
def test_loop_stays_closed_and_the_account_closes(joint: dict[str, Any]) -> None:
    crank = models.dynamics("four_bar").joint_names[0]
    sim = Simulator(scene("four_bar", joints={crank: joint}), tolerance=1e-9)
    run = sim.run(0.5, np.array([1.0, 0.0, 0.0]))
    rows = sim.dynamics.constrained.closure.rows.stacked(
        sim.state.q, sim.state.v, sim.held_constraints
    )
    assert abs(rows.residual).max() < CLOSURE
    assert abs(rows.jacobian @ sim.state.v).max() < CLOSURE_SPEED
    assert abs(sim.state.q - run.q[0]).max() > 0.05
    assert_close(run.balance, np.zeros(len(run)), 1e-6)
