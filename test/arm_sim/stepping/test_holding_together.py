# SPDX-License-Identifier: Apache-2.0
"""Joints and contacts whose reactions statics does not determine hold while they can."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from arm_sim import Simulator
from models.touching import contact, free_body, rails
from tolerances import CLOSED_FORM, assert_close

G = 9.81
WITHIN = 1e-8
"""How closely limits are met, relative."""


def wheels(count: int, **joints: Any) -> dict[str, Any]:
    """Wheels w0, w1, … of 0.5 kg m² on fixed axles."""
    inertia = '<inertia ixx="0.5" iyy="0.5" izz="0.5" ixy="0" ixz="0" iyz="0"/>'
    parts = "".join(
        f'<link name="l{k}"><inertial><mass value="1"/>{inertia}</inertial></link>'
        f'<joint name="w{k}" type="continuous"><parent link="base"/><child link="l{k}"/>'
        '<axis xyz="0 0 1"/></joint>'
        for k in range(count)
    )
    urdf = f'<robot name="wheels"><link name="base"/>{parts}</robot>'
    return {"robot": {"urdf": urdf}, "joints": joints}


def coupled(count: int, **joints: Any) -> dict[str, Any]:
    """Such wheels, the second coupled one to one with the first."""
    gear = {"type": "coupling", "joints": ["w1", "w0"], "ratio": 1.0}
    return {**wheels(count, **joints), "constraints": [gear]}


def dry(sliding: float, static: float) -> dict[str, Any]:
    return {"friction": {"coulomb": sliding, "static": static}}


def feet(mu: float, static: float, com: float = 0.0) -> dict[str, Any]:
    """A block of 2 kg on two feet, half a metre before and behind its middle."""
    scene = rails("xz", 2.0, turns=True, iyy=0.1)
    scene["robot"]["urdf"] = scene["robot"]["urdf"].replace(
        "<inertial>", f'<inertial><origin xyz="{com} 0 0"/>'
    )
    points = [
        contact("body", name=name, point=[x, 0, 0], friction=mu, static_friction=static)
        for name, x in (("left", -0.5), ("right", 0.5))
    ]
    return {**scene, "constraints": points}


SETS: dict[str, tuple[dict[str, Any], list[float], float, float]] = {
    "coupled wheels": (coupled(2, **{"*": dry(1.0, 2.0)}), [1.0, 0.0], 4.0, 2.0),
    "feet under unequal loads": (
        feet(0.2, 0.4, com=0.25), [1.0, 0.0, 0.0], 0.4 * 2.0 * G, 0.2 * 2.0 * G,
    ),
    "rail and table": (
        {**rails("xz", 1.0), "joints": {"x": dry(1.0, 1.5)},
         "constraints": [contact("body", friction=0.2, static_friction=0.3)]},
        [1.0, 0.0], 1.5 + 0.3 * G, 1.0 + 0.2 * G,
    ),
}  # fmt: skip
"""Scene, direction of a load, its limit, and what opposes the motion beyond it."""


@pytest.mark.parametrize("name", SETS)
def test_they_hold_up_to_the_sum_of_their_static_limits_and_slide_beyond(name: str) -> None:
    """The mass that moves is 1 kg m² of wheels, and 2 and 1 kg of blocks."""
    scene, way, limit, against = SETS[name]
    sim = Simulator(scene)
    held = sim.run(0.02, limit * (1.0 - WITHIN) * np.array(way))
    np.testing.assert_array_equal(held.q, np.broadcast_to(held.q[0], held.q.shape))
    sim.reset()
    assert sim.step(limit * (1.0 + WITHIN) * np.array(way)).v.any()
    sim.reset()
    run = sim.run(0.1, 1.2 * limit * np.array(way))
    mass = 2.0 if "feet" in name else 1.0
    v = (1.2 * limit - against) / mass * 0.1
    assert_close(run.v[-1] @ np.sign(way), v, CLOSED_FORM)


def test_what_holds_together_holds_while_another_wheel_turns() -> None:
    """A moving joint does not change what holds: neither one joint, nor two that share."""
    for torque, holds in ((1.5, True), (3.9, True), (4.1, False)):
        sim = Simulator(coupled(3, w0=dry(1.0, 2.0), w1=dry(1.0, 2.0)))
        turning = np.array([float(name == "w2") for name in sim.joint_names])
        push = np.array([torque * (name == "w0") for name in sim.joint_names])
        sim.reset(v=turning)
        run = sim.run(0.01, push)
        assert (run.v[-1, turning == 0.0] == 0.0).all() == holds
        a, _ = sim.dynamics.constrained_forward(0 * turning, turning, push)
        assert (a[turning == 0.0] == 0.0).all() == holds


@pytest.mark.parametrize("options", [{"dt": 0.05}, {"dt": 0.05, "tolerance": 1e-10}])
def test_a_load_that_grows_within_a_tick_breaks_them_away_at_its_instant(
    options: dict[str, Any],
) -> None:
    """A winding's current rises to 8 A; at 4 N m two wheels, 2 N m each, start under 2 N m."""
    resistance, inductance, volts = 0.5, 0.01, 4.0
    motor = {"resistance": resistance, "inductance": inductance, "torque_constant": 1.0,
             "rotor_inertia": 0.0, "command": "voltage"}  # fmt: skip
    sim = Simulator(
        coupled(2, w0={**dry(1.0, 2.0), "actuator": motor}, w1=dry(1.0, 2.0)), **options
    )
    command = [volts * (name == "w0") for name in sim.joint_names]
    start = -inductance / resistance * np.log(1.0 - 4.0 * resistance / volts)
    run = sim.run(0.1, command)

    def slope(_: float, x: np.ndarray) -> list[float]:
        return [x[1], x[2] - 2.0, (volts - resistance * x[2] - x[1]) / inductance]

    exact = solve_ivp(slope, (start, 0.1), [0.0, 0.0, 4.0], "DOP853", rtol=1e-13, atol=1e-13)
    tolerance = 1e-8 if "tolerance" in options else 1e-3
    assert_close(run.q[-1], np.full(2, exact.y[0, -1]), tolerance)


def test_cones_in_space_are_round() -> None:
    """A body on four feet, pulled in any direction, and turned: µ times the sum of all loads."""
    mu = {"friction": 0.2, "static_friction": 0.4}
    legs = [contact("body", point=[x, y, 0], **mu) for x in (-1, 1) for y in (-1, 1)]
    sim = Simulator({**free_body(1.0, (0.3, 0.3, 0.3)), "constraints": legs})
    for angle in (0.1, 0.8):
        pull = 0.4 * G * np.array([np.cos(angle), np.sin(angle), 0, 0, 0, 0])
        for factor, moves in ((1.0 - WITHIN, False), (1.0 + WITHIN, True)):
            sim.reset()
            assert sim.step(factor * pull).v.any() == moves
    twist = 0.4 * G * np.sqrt(2.0) * np.array([0, 0, 0, 0, 0, 1.0])
    for factor, moves in ((1.0 - WITHIN, False), (1.0 + WITHIN, True)):
        sim.reset()
        assert sim.step(factor * twist).v.any() == moves


def test_a_block_slides_though_a_stop_bears_its_weight() -> None:
    """The contact that the stop relieves bears nothing: only the rail resists."""
    scene = rails("xz", 1.0)
    head, tail = scene["robot"]["urdf"].split('name="z"')
    scene["robot"]["urdf"] = f'{head}name="z"' + tail.replace('lower="-9"', 'lower="0"', 1)
    foot = contact("body", friction=0.3, static_friction=0.5)
    sim = Simulator({**scene, "joints": {"x": dry(1.0, 1.5)}, "constraints": [foot]})
    limit = 1.5 + 0.5 * G
    assert not sim.run(0.01, [limit * (1.0 - WITHIN), 0.0]).v.any()
    assert_close(sim.run(0.1, [limit * 1.1, 0.0]).v[-1, 0], 0.1 * (limit * 1.1 - 1.0), CLOSED_FORM)
