# SPDX-License-Identifier: Apache-2.0
"""Servos at rest: where the torques balance, whatever the tick, and exactly."""

from typing import Any

import numpy as np
import pytest

from arm_sim import JointCommand, Simulator
from arm_sim.recording.contents import FREE, SERVOS
from models.rotor import rotor

K, T = 1.0, 4.0


def soft(**friction: Any) -> dict[str, Any]:
    """A wheel of 1 kg m² without weight, critically damped on a servo of 1 N m/rad."""
    scene = rotor(1.0, **friction)
    scene["joints"]["axle"]["servo"] = {"stiffness": K}
    return {**scene, "gravity": [0, 0, 0], "tunable": ["external"]}


def approach(t: float) -> float:
    """Share of a critically damped motion that is done after t."""
    return 1.0 - float(np.exp(-t) * (1.0 + t))


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_small_pushes_and_errors_move_a_soft_servo_to_its_balance(dt: float) -> None:
    """By 30 nanoradians: in a tick it gains 3e-11 rad/s, or 3e-10."""
    sim = Simulator(soft(), dt=dt)
    sim.reset([2e-8])
    sim.run(T, JointCommand(position=[0.0]))
    assert sim.state.q[0] == pytest.approx(2e-8 * (1.0 - approach(T)), abs=2e-10)
    sim.reset()
    sim.set_parameter("external", [3e-8])
    sim.run(T, JointCommand(position=[0.0]))
    assert sim.state.q[0] == pytest.approx(3e-8 / K * approach(T), rel=0.01)


def test_a_push_that_static_friction_bears_moves_nothing() -> None:
    sim = Simulator(soft(coulomb=1e-3), dt=1e-3)
    sim.set_parameter("external", [9e-4])
    run = sim.run(1.0, JointCommand(position=[0.0]))
    assert not run.q.any()


def test_at_rest_it_stays_to_the_bit_until_it_is_pushed() -> None:
    sim = Simulator(soft(), dt=1e-2)
    sim.reset([0.1])
    run = sim.run(40.0, JointCommand(position=[0.1 + 1e-12]))
    assert (run.q[-500:] == run.q[-1]).all() and not run.v[-500:].any()
    assert abs(run.q[-1, 0] - 0.1 - 1e-12) < 1e-13
    assert run.hold is not None and run.hold[0] == FREE and (run.hold[-500:-1] == SERVOS).all()
    sim.set_parameter("external", [1e-9])
    assert sim.run(T, JointCommand(position=[0.1 + 1e-12])).q[-1, 0] - 0.1 > 0.9e-9 * approach(T)


@pytest.mark.parametrize("go_on", [
    lambda sim: sim.run(0.01, [0.0]),
    lambda sim: sim.step([0.0]),
    lambda sim: sim.reset([0.0]),
])  # fmt: skip
def test_what_servos_hold_is_free_once_they_do_not(go_on: Any) -> None:
    sim = Simulator(soft(), dt=1e-3)
    sim.run(0.01, JointCommand(position=[0.0]))
    assert sim.arm.hold == SERVOS
    go_on(sim)
    assert sim.arm.hold == FREE


@pytest.mark.parametrize("placed", ["set_state", "reset"])
def test_what_was_commanded_before_an_arm_was_placed_is_no_stream(placed: str) -> None:
    """The place after it has no velocity, as the first one of all."""
    sims = [Simulator(soft(), dt=1e-3) for _ in range(2)]
    for k in (1, 2):
        sims[0].step(JointCommand(position=[1e-3 * k], stamp=1_000_000 * k))
    for sim in sims:
        getattr(sim, placed)(q=[3e-3], v=[0.0])
        sim.step(JointCommand(position=[3e-3], stamp=3_000_000))
    assert sims[0].state.v[0] == sims[1].state.v[0] == 0.0


def test_a_joint_that_no_servo_holds_moves_on() -> None:
    """Slower than anything that counts as rest, beside a joint that rests."""
    urdf = """<robot name="two"><link name="base"/>{}</robot>""".format("".join(
        f"""<link name="l{i}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1"
        iyz="0" izz="1"/></inertial></link><joint name="j{i}" type="continuous">
        <parent link="base"/><child link="l{i}"/><axis xyz="0 0 1"/></joint>""" for i in range(2)
    ))  # fmt: skip
    sim = Simulator({"robot": {"urdf": urdf}, "gravity": [0, 0, 0]}, dt=1e-3)
    sim.reset(v=[0.0, 5e-11])
    sim.run(1.0, JointCommand(position=[0.0, np.nan], effort=[np.nan, 0.0]))
    assert sim.state.q.tolist() == [0.0, pytest.approx(5e-11)]


@pytest.mark.parametrize("transmission", [None, {"stiffness": 200.0, "damping": 1.0}])
def test_behind_motors_too(transmission: dict[str, float] | None) -> None:
    """Under a weight: motors by voltage or on a soft shaft come to rest, and stay to the bit."""
    motor = {"command": "voltage", "resistance": 1.0, "inductance": 0.01, "torque_constant": 1.0,
             "rotor_inertia": 0.1}  # fmt: skip
    scene = rotor(0.5)
    scene["robot"]["urdf"] = scene["robot"]["urdf"].replace("0 0 1", "0 1 0").replace(
        "<mass", '<origin xyz="0.2 0 0"/><mass'
    )  # fmt: skip
    scene["joints"]["axle"] |= {"actuator": motor} | (
        {"transmission": transmission} if transmission else {}
    )
    sim = Simulator(scene)
    run = sim.run(7.0, JointCommand(position=[0.3]))
    assert abs(run.q[-1, 0] - 0.3) < 1e-3
    assert (run.q[-500:] == run.q[-1]).all()
