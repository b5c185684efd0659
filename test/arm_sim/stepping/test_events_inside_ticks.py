# SPDX-License-Identifier: Apache-2.0
"""Events that begin and end within a tick: nothing of them shows at its ends."""

from typing import Any

import numpy as np
import pytest
from samples import covering
from scipy.integrate import solve_ivp

from arm_sim import Simulator
from models.rotor import rotor
from models.touching import contact, rails, unbalance
from tolerances import CLOSED_FORM, assert_close

STILL, G = [0, 0, 0], 9.81


def ended(scene: dict[str, Any], start: tuple[Any, ...], tau: Any, time: float, **how: Any) -> Any:
    sim = Simulator(scene, **how)
    sim.reset(*start)
    recording = sim.run(time, tau)
    assert recording.trusted or how.get("integrator") in ("rk4", "nystrom4")
    return recording


@pytest.mark.parametrize(
    ("method", "depth", "way"),
    [(None, 1.002, 1), ("rk4", 1.02, 1), ("implicit", 1.02, -1)],
)  # fmt: skip
def test_a_sliding_joint_that_would_turn_back_for_a_moment_sticks(
    method: str | None, depth: float, way: int
) -> None:
    """A link on a spring slides at 1 rad/s under its friction; a swing takes it below zero.

    The reference are ticks of 20 µs, at whose ends the reversal shows.
    """
    link, motor, stiffness, level = 0.01, 0.02, 2000.0, 3.0
    scene = rotor(link, coulomb=level)
    scene["joints"]["axle"] |= {
        "actuator": {"rotor_inertia": motor}, "transmission": {"stiffness": stiffness}
    }  # fmt: skip
    twist = [level / stiffness, 1 - depth * link / motor]
    start = [0.0], [way * (1 + depth)], way * np.array(twist)
    fine = ended(scene, start, [way * level], 0.02, dt=2e-5)
    fixed = method in ("rk4", "nystrom4")
    how = {"integrator": method} if fixed or method is None else {
        "integrator": method, "tolerance": 1e-9
    }  # fmt: skip
    dt = 2e-4 if fixed else 1e-3
    found = ended(scene, start, [way * level], 0.02, dt=dt, **how)
    np.testing.assert_allclose(found.q[-1], fine.q[-1], rtol=0, atol=1e-6 if fixed else 1e-8)


def test_a_mass_that_bounces_off_an_elastic_stop_within_a_tick() -> None:
    """Contact with the spring lasts half a period; then the mass returns at the same speed."""
    stiffness, start = 1e8, 3.3e-4
    scene = rails(axes="x", mass=1.0)
    scene |= {
        "gravity": STILL,
        "joints": {"x": {"limits": {"lower": -9, "upper": 0.1, "stop": {"stiffness": stiffness}}}},
    }
    recording = ended(scene, ([start], [1.0]), [0.0], 0.2, integrator="dop853", tolerance=1e-10)
    leaves = 0.1 - start + np.pi / np.sqrt(stiffness)
    assert_close(recording.q[-1], [0.1 - (0.2 - leaves)], CLOSED_FORM)


@pytest.mark.parametrize("how", [{"integrator": "rk4"}, {"tolerance": 1e-9}], ids=str)
@pytest.mark.parametrize("part", [0.125, 0.875])
def test_a_mass_that_rises_to_its_stop_within_a_tick(part: float, how: dict[str, Any]) -> None:
    """It would turn back at this part of the tick, a tenth of a millimetre above the stop."""
    dt, above, stop = 0.05, 1e-4, 0.5
    speed, left = G * part * dt, dt - part * dt + np.sqrt(2 * above / G)
    scene = rails(axes="z", mass=1.0)
    scene |= {"joints": {"z": {"limits": {"lower": -9, "upper": stop}}}}
    start = [stop + above - 0.5 * speed**2 / G], [speed]
    end = ended(scene, start, [0.0], dt, dt=dt, **how)
    found, falls = [end.q[-1, 0], end.v[-1, 0]], [stop - 0.5 * G * left**2, -G * left]
    np.testing.assert_allclose(found, falls, rtol=0, atol=1e-9)


def test_a_step_that_an_event_cuts_short_is_as_accurate_as_others() -> None:
    """Friction rises from the sliding to the static level just before a wheel turns back.

    A step across the reversal passes that over; cut at the reversal, it ends at the peak.
    """
    friction = {"coulomb": 0.1, "static": 0.15, "stribeck_velocity": 0.05}
    scene = rotor(0.01, **friction)
    scene["joints"]["axle"] |= {"spring": {"stiffness": 1000.0}}
    start, tolerance = ([0.05], [-0.5]), 1e-9
    exact = ended(scene, start, [0.0], 0.1, dt=5e-3, integrator="implicit", tolerance=1e-13)
    found = ended(scene, start, [0.0], 0.1, dt=5e-3, integrator="dop853", tolerance=tolerance)
    np.testing.assert_allclose(found.q, exact.q, rtol=0, atol=10 * tolerance)


MASS, SPEED, LOAD = 5.5, 240.0, 576.0
"""Mass on a rail [kg], speed of a wheel on it [rad/s], and force of its unbalance [N]."""
HELD = {
    # Axis of the rail, settings of the scene; push, level of the load that is held, and resistance
    # once it is not, relative to LOAD.
    "by dry friction": (
        "x", {"joints": {"x": {"friction": {"coulomb": 0.7 * LOAD, "static": 1.04 * LOAD}}}},
        (0.09, 1.04, 0.7),
    ),
    "by a stop": ("x", {"joints": {"x": {"limits": {"lower": 0, "upper": 1}}}}, (-0.97, 0, 0)),
    "by its weight": (
        "z", {"gravity": [0, 0, -0.97 * LOAD / MASS], "constraints": [contact("body")]},
        (0, 0.97, 0.97),
    ),
}  # fmt: skip


def shaken(axis: str, settings: dict[str, Any]) -> dict[str, Any]:
    """Scene of a body on a rail with an unbalanced wheel, too heavy to lose speed."""
    turn = "0 0 1" if axis == "x" else "0 1 0"
    wheel = unbalance(turn, 0.5, 0.02, inertia=1e9)
    return rails(axis, 5.0, branches=[wheel]) | {"gravity": STILL} | settings


# How ticks are made, and what the place may be off by.
PEAKED: list[tuple[dict[str, Any], float]] = [
    ({"integrator": "rk4"}, 2e-5), ({"integrator": "nystrom4"}, 2e-5),
    ({"integrator": "dop853"}, 1e-10), ({"tolerance": 1e-10}, 1e-11),
]  # fmt: skip


@pytest.mark.parametrize(("held", "accuracy"), covering(HELD, PEAKED), ids=str)
def test_what_holds_gives_way_to_a_load_that_peaks_within_a_tick(
    held: str, accuracy: tuple[dict[str, Any], float]
) -> None:
    """The wheel turns by 1.2 rad in the tick, at whose ends the load is below 0.9 of the level."""
    how, allowed = accuracy
    axis, settings, (push, level, resists) = HELD[held]
    turn, begins = 1.2, -0.58  # angles of the unbalance from the rail [rad]
    sim = Simulator(shaken(axis, settings), dt=turn / SPEED, **how)
    sim.reset([0.0, begins - (axis == "z") * np.pi / 2], [0.0, SPEED])
    state = sim.step([push * LOAD, 0.0])
    loose, ends = -np.arccos(level - push), begins + turn
    rises = np.cos(loose) - np.cos(ends) - (ends - loose) * np.sin(loose)
    way = (0.5 * (push - resists) * (ends - loose) ** 2 + rises) * LOAD / MASS / SPEED**2
    assert way > 1e-6
    assert abs(state.q[0] - way) < allowed


@pytest.mark.parametrize(("how", "allowed"), [
    ({"integrator": "implicit", "tolerance": 1e-10, "dt": 1e-3}, 1e-8),
    ({"integrator": "dop853", "tolerance": 1e-11, "dt": 2e-2}, 1e-9),
], ids=str)  # fmt: skip
def test_a_lossy_gear_whose_torque_changes_its_sign(how: dict[str, Any], allowed: float) -> None:
    """η of the torque where the motor drives, 1/η where it is driven; by SciPy in pieces."""
    J, eta, command, speed, time = 0.02, 0.7, 0.01, 3.0, 0.16
    cogging = {"gear_ratio": 30.0, "cogging": {"amplitude": 0.004, "order": 6}}
    scene = rotor(J) | {"gravity": STILL}
    scene["joints"]["axle"] = {"actuator": cogging | {"efficiency": eta}}
    sim = Simulator(scene, **how)
    sim.reset([0.0], [speed])
    sim.run(time, [command])

    def torque(_: float, x: np.ndarray) -> float:
        return float(command - 0.12 * np.sin(180.0 * x[0]))

    torque.terminal, t, x, changes = True, 0.0, np.array([0.0, speed]), -1  # type: ignore[attr-defined]
    drives = torque(t, x) > 0
    while t < time:
        part = eta if drives else 1 / eta
        torque.direction = -1 if drives else 1  # type: ignore[attr-defined]
        found = solve_ivp(
            lambda t, x, part=part: [x[1], part * torque(t, x) / J], (t, time), x, "DOP853",
            events=torque, rtol=1e-12, atol=1e-13, max_step=1e-3,
        )  # fmt: skip
        t, x, drives, changes = found.t[-1], found.y[:, -1], not drives, changes + 1
    assert changes > 0 and x[1] > 0.0
    assert_close([sim.state.q[0], sim.state.v[0]], x, allowed)
