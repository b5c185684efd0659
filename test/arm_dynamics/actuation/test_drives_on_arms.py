# SPDX-License-Identifier: Apache-2.0
"""Drives on arms of every kind, alone and many at once."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from samples import sampled

import models
from arm_sim import Simulator
from tolerances import BACKENDS, FINITE_DIFF, assert_close

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


def driven(robot: str, kind: str, **options: Any) -> Simulator:
    scene = models.scene(robot).model_dump(exclude_unset=True)
    free = {"limits": {"stop": False}}  # some arms start at a stop
    return Simulator(scene | {"joints": {"*": KINDS[kind] | free}}, **options)


@pytest.mark.parametrize(
    ("robot", "kind"), sampled(product(["gantry", "gripper", "scara"], KINDS), 4)
)
def test_every_kind_of_arm_moves_and_keeps_its_account(robot: str, kind: str) -> None:
    """Sliding joints, mimic joints, branches: no energy is created."""
    sim = driven(robot, kind, backend="auto" if kind == "lossy" else "vm")
    volts = 8.0 * np.sin(0.04 * np.arange(50))[:, None] * np.ones(sim.n)
    recording = sim.run(0.05, volts)
    assert abs(recording.q[-1] - recording.q[0]).max() > 1e-4
    assert abs(recording.balance).max() < 1e-6 * recording.supplied[-1]
    assert abs(recording.tau).max() > 0.0


@pytest.mark.parametrize("kind", sampled(KINDS, 2))
def test_rollout_is_run(kind: str) -> None:
    sim = driven("two_link", kind, integrator="rk4", dt=5e-4)
    volts = np.array([5.0, -3.0])
    run = sim.run(0.05, volts)
    sim.reset()
    q, v = sim.state.q, sim.state.v
    last = sim.rollout(np.tile(q, (3, 1)), np.tile(v, (3, 1)), volts, 100, last_only=True)
    whole = np.concatenate([run.q[-1], run.v[-1], run.z[-1]])
    for row in last:
        assert_close(row[: len(whole)], whole[: len(row)], BACKENDS)


@pytest.mark.parametrize("kind", sampled(["belt", "rigid"], 1))
def test_linearize_is_the_slope_of_a_tick(kind: str) -> None:
    sim = driven("two_link", kind)
    sim.run(0.02, [5.0, -3.0])
    state, volts, step = sim.state, np.array([2.0, 1.0]), 1e-4
    A, B = sim.linearize(state, volts)
    x = np.concatenate([state.q, state.v, state.z])

    def after(x: np.ndarray, u: np.ndarray) -> np.ndarray:
        sim.set_state(x[:2], x[2:4], x[4:])
        s = sim.step(u)
        return np.concatenate([s.q, s.v, s.z])

    for k, unit in enumerate(np.eye(len(x))):
        slope = (after(x + step * unit, volts) - after(x - step * unit, volts)) / (2 * step)
        assert_close(A[:, k], slope, FINITE_DIFF)
    for k, unit in enumerate(np.eye(2)):
        slope = (after(x, volts + step * unit) - after(x, volts - step * unit)) / (2 * step)
        assert_close(B[:, k], slope, FINITE_DIFF)


@pytest.mark.parametrize("kind", sampled(["harmonic", "belt", "rigid"], 1))
def test_virtual_machine_and_compiled_code_agree(kind: str) -> None:
    ends = []
    for backend in ("auto", "vm"):
        sim = driven("two_link", kind, backend=backend, integrator="rk4", dt=5e-4)
        sim.run(0.05, [6.0, -4.0])
        ends.append(np.concatenate([sim.state.q, sim.state.v, sim.state.z]))
    assert_close(ends[0], ends[1], BACKENDS)


def test_replay_to_the_bit() -> None:
    sim = driven("two_link", "harmonic")
    first = sim.run(0.1, [6.0, -4.0])
    sim.reset()
    second = sim.run(0.1, [6.0, -4.0])
    np.testing.assert_array_equal(first.z, second.z)
    np.testing.assert_array_equal(first.q, second.q)
