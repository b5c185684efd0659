# SPDX-License-Identifier: Apache-2.0
"""Events that begin and end within a tick: nothing of them shows at its ends."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from arm_sim import Simulator
from models.rotor import rotor
from models.touching import rails
from tolerances import CLOSED_FORM, assert_close

STILL, G = [0, 0, 0], 9.81


def ended(scene: dict[str, Any], start: tuple[Any, ...], tau: Any, time: float, **how: Any) -> Any:
    sim = Simulator(scene, **how)
    sim.reset(*start)
    recording = sim.run(time, tau)
    assert recording.trusted or how.get("integrator") in ("rk4", "nystrom4")
    return recording


@pytest.mark.parametrize("method", [None, "rk4", "nystrom4", "dopri5", "implicit"])
@pytest.mark.parametrize("depth", [1.002, 1.02])
def test_a_sliding_joint_that_would_turn_back_for_a_moment_sticks(
    method: str | None, depth: float
) -> None:
    """A link on a spring slides at 1 rad/s under its friction; a swing takes it below zero.

    The reference are ticks of 20 µs, at whose ends the reversal shows.
    """
    link, motor, stiffness, level = 0.01, 0.02, 2000.0, 3.0
    scene = rotor(link, coulomb=level)
    scene["joints"]["axle"] |= {
        "actuator": {"rotor_inertia": motor}, "transmission": {"stiffness": stiffness}
    }  # fmt: skip
    start = [0.0], [1 + depth], [level / stiffness, 1 - depth * link / motor]
    fine = ended(scene, start, [level], 0.02, dt=2e-5)
    fixed = method in ("rk4", "nystrom4")
    how = {"integrator": method} if fixed or method is None else {
        "integrator": method, "tolerance": 1e-9
    }  # fmt: skip
    dt = 2e-4 if fixed else 1e-3
    found = ended(scene, start, [level], 0.02, dt=dt, **how)
    np.testing.assert_allclose(found.q[-1], fine.q[-1], rtol=0, atol=1e-6 if fixed else 1e-8)


@pytest.mark.parametrize("stiffness", [1e7, 1e8])
@pytest.mark.parametrize("start", [0.0, 3.3e-4, 7.1e-4])
def test_a_mass_that_bounces_off_an_elastic_stop_within_a_tick(
    stiffness: float, start: float
) -> None:
    """Contact with the spring lasts half a period; then the mass returns at the same speed."""
    scene = rails(axes="x", mass=1.0)
    scene |= {
        "gravity": STILL,
        "joints": {"x": {"limits": {"lower": -9, "upper": 0.1, "stop": {"stiffness": stiffness}}}},
    }
    recording = ended(scene, ([start], [1.0]), [0.0], 0.2, integrator="dop853", tolerance=1e-10)
    leaves = 0.1 - start + np.pi / np.sqrt(stiffness)
    assert_close(recording.q[-1], [0.1 - (0.2 - leaves)], CLOSED_FORM)


@pytest.mark.parametrize("how", [{"integrator": "rk4"}, {"tolerance": 1e-9}], ids=str)
@pytest.mark.parametrize("part", [0.125, 0.375, 0.625, 0.875])
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


@pytest.mark.parametrize("method", ["implicit", "dop853"])
def test_a_cord_that_is_taut_for_a_moment(method: str) -> None:
    """A mass on a rail is caught by a stiff cord and thrown back, all in the middle of a tick."""
    stiffness, slack, speed, dt = 1e6, 0.01, 1.0, 0.02
    scene = rails(axes="x", mass=1.0)
    scene |= {
        "gravity": STILL,
        "springs": [
            {"name": "cord", "frames": ["body", "world"], "points": [STILL, [-1, 0, 0]],
             "stiffness": stiffness, "rest_length": 1.0 + slack, "tension_only": True}
        ],
    }  # fmt: skip
    how = {"integrator": method, "tolerance": 1e-9, "dt": dt}
    recording = ended(scene, ([0.0], [speed]), [0.0], dt, **how)
    leaves = slack / speed + np.pi / np.sqrt(stiffness)
    way = slack - speed * (dt - leaves)
    np.testing.assert_allclose(recording.q[-1], [way], rtol=0, atol=1e-7)


def test_current_that_reaches_its_limit_within_a_tick() -> None:
    """A motor under voltage: the current rises, then is held at its limit exactly."""
    resistance, inductance, limit, voltage = 1.0, 2e-3, 2.5, 6.0
    scene = rotor(1e3)  # so heavy that back-EMF is nil
    scene["joints"]["axle"]["actuator"] = {
        "command": "voltage", "resistance": resistance, "inductance": inductance,
        "torque_constant": 0.05, "current_limit": limit,
    }  # fmt: skip
    sim = Simulator(scene, integrator="rk4", dt=2e-4)
    recording = sim.run(4e-3, [voltage])
    t, rise = recording.time, inductance / resistance
    current = voltage / resistance * -np.expm1(-t / rise)
    np.testing.assert_allclose(recording.z[:, 0], np.minimum(current, limit), rtol=0, atol=1e-5)
    np.testing.assert_allclose(recording.z.max(), limit, rtol=1e-12)
    A, B = sim.linearize(sim.state, [voltage])
    assert_close(B[2], [0.0], CLOSED_FORM)  # what is held at its limit ignores the voltage


@pytest.mark.parametrize("tolerance", [1e-8, 1e-10])
def test_a_step_that_an_event_cuts_short_is_as_accurate_as_others(tolerance: float) -> None:
    """Friction rises from the sliding to the static level just before a wheel turns back.

    A step across the reversal passes that over; cut at the reversal, it ends at the peak.
    """
    friction = {"coulomb": 0.1, "static": 0.15, "stribeck_velocity": 0.05}
    scene = rotor(0.01, **friction)
    scene["joints"]["axle"] |= {"spring": {"stiffness": 1000.0}}
    start = [0.05], [-0.5]
    exact = ended(scene, start, [0.0], 0.1, dt=5e-3, integrator="implicit", tolerance=1e-13)
    found = ended(scene, start, [0.0], 0.1, dt=5e-3, integrator="dop853", tolerance=tolerance)
    np.testing.assert_allclose(found.q, exact.q, rtol=0, atol=10 * tolerance)
