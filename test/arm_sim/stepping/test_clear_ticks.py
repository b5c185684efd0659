# SPDX-License-Identifier: Apache-2.0
"""Ticks that are made without the engine of events are those that it makes, bit for bit."""

import ctypes
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.addresses import pointer
from arm_sim import Simulator
from arm_sim.derivatives.eventful_ticks import TickTrace
from arm_sim.stepping import Stepper
from models.touching import contact

PLANAR = {"robot": {"urdf": str(models.FOLDER / "planar_3r.urdf")}}
STATES, TRIES = 150, 100


def dry(**friction: Any) -> dict[str, Any]:
    return {"joints": {"*": {"friction": {"coulomb": 0.3, **friction}, "limits": LIMITS}}}


LIMITS = {"lower": -2.0, "upper": 2.0, "stop": {"restitution": 0.3}}
TIP = contact("link3", point=[0.2, 0, 0], plane={"point": [0, 0, -0.5]}, friction=0.5)
SCENES = {
    "dry friction": PLANAR | dry(),
    "dry friction and a plane": PLANAR | dry(static=0.4, viscous=0.1) | {"constraints": [TIP]},
    "dry friction and LuGre": PLANAR | {"joints": {
        "joint1": {"friction": {"coulomb": 0.3}},
        "joint2": {"friction": {"coulomb": 0.2, "lugre": {"sigma0": 1.0}}},
    }},
}  # fmt: skip


def by_the_engine(stepper: Stepper, x: Array, u: Array, dt: float) -> tuple[Array, bool]:
    """State after a tick in which events are looked for, and whether it had one."""
    trace, after = TickTrace(), np.empty_like(x)
    code = stepper.compiled
    made = code.engine.trace_tick(
        code.scene, pointer(x), pointer(u), pointer(stepper.p), ctypes.c_double(dt), None,
        ctypes.byref(trace), pointer(after),
    )  # fmt: skip
    return (after if made else np.full_like(x, np.nan)), trace.count > 1


def drawn_state(simulator: Simulator, rng: np.random.Generator) -> Array:
    """A state at rest, about to turn, to meet a stop or to touch, or far from all of these."""
    n, plant = simulator.n, simulator._stepper._plant
    lower, upper = simulator.model.stops.place
    v = rng.normal(size=n) * 10.0 ** rng.uniform(-6.0, 0.5, size=n) * (rng.random(n) > 0.3)
    for _ in range(TRIES):
        q = rng.uniform(lower, upper)
        q = np.where(rng.random(n) < 0.1, upper - 10.0 ** rng.uniform(-5.0, -1.0, size=n), q)
        q = np.where(rng.random(n) < 0.1, lower + 10.0 ** rng.uniform(-5.0, -1.0, size=n), q)
        x = np.concatenate([q, v, np.zeros(plant.nz)])
        heights = np.array(plant.gaps(q)) if plant.points else np.array([0.5])
        if 0.0 < heights.min() < 10.0 ** rng.uniform(-4.0, 0.0):
            break
    return x


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("dt", [1e-3, 2e-2])
def test_ticks_are_those_of_the_engine(name: str, dt: float, rng: np.random.Generator) -> None:
    simulator = Simulator(SCENES[name], dt=dt, integrator="rk4")
    stepper, n, eventful = simulator._stepper, simulator.n, 0
    for _ in range(STATES):
        x = drawn_state(simulator, rng)
        u = rng.normal(size=n) * 10.0 ** rng.uniform(-2.0, 1.0)
        if rng.random() < 0.5:  # so that what is at rest may stay there
            u += simulator.dynamics.gravity(x[:n])
        u = np.clip(u, -15.0, 15.0)
        wanted, event = by_the_engine(stepper, x, u, dt)
        eventful += event
        found = stepper.advance_each(x[None], u[None], stepper.p[None], 1)[0][0]
        np.testing.assert_array_equal(found, wanted)
        np.testing.assert_array_equal(np.signbit(found), np.signbit(wanted))  # of zeros
    assert 0.02 < eventful / STATES < 0.9


@pytest.mark.parametrize("lanes", [1, 4])
def test_joints_that_are_held_have_speed_zero_of_one_sign(lanes: int) -> None:
    """Given -0, they have 0 after a tick, beside a joint that moves or not, as by the engine."""
    simulator = Simulator(SCENES["dry friction"], dt=1e-3, integrator="rk4")
    q, v = np.tile([1.5, 0.1, -0.1], (4, 1)), np.full((4, 3), -0.0)
    v[2:, 0] = 0.5
    tau = simulator.dynamics.gravity(q[0])
    after = simulator.rollout(q, v, tau, 2, lanes=lanes)[:, 1:, 3:]
    assert (after[:2] == 0.0).all()
    assert not np.signbit(after).any()
