# SPDX-License-Identifier: Apache-2.0
"""A Panda in violent motion: many events, none of which is lost in rounding."""

import numpy as np
import pinocchio as pin

import models
from arm_sim import Simulator
from models.touching import contact

TIP = np.array([0.0, 0.0, 0.1])  # the point that touches, in the hand's frame [m]


def test_joints_that_meet_their_stops_do_not_chatter() -> None:
    """Two that lie at stops and take a blow in turn come to rest: no tick has to be cut short."""
    sim = Simulator(models.scene("panda"))
    draw = np.random.default_rng(1)
    for _ in range(150):
        sim.run(0.02, np.clip(draw.normal(0.0, 30.0, 7), -12.0, 12.0))
    assert sim.impacts > 50
    assert sim.state.time_stepped == 0


def test_a_hand_that_rubs_on_a_table_moves_on() -> None:
    """Contact brings a creeping hand to rest, and may turn joints round that slide in friction."""
    ready = models.scene("panda")
    q = Simulator(ready).state.q
    model, data = models.oracle("panda").model, models.oracle("panda").data
    hand = model.getFrameId("panda_hand")
    full = np.concatenate([q, np.zeros(2)])  # with the fingers
    rows = pin.computeFrameJacobian(model, data, full, hand, pin.LOCAL_WORLD_ALIGNED)[:3, :7]
    height = pin.updateFramePlacement(model, data, hand).act(TIP)[2]
    table = {"point": [0.0, 0.0, height - 1e-4], "normal": [0.0, 0.0, 1.0]}
    touching = contact("panda_hand", point=TIP.tolist(), plane=table, friction=0.8)
    dry = {"*": {"friction": {"coulomb": 1.0, "static": 1.5}}}
    sim = Simulator(
        {**ready.model_dump(exclude_unset=True), "joints": dry, "constraints": [touching]}
    )
    weight = sim.dynamics.gravity(q)
    for k in range(300):
        push = 40.0 * np.sin(2.0 * np.pi * k / 250.0)
        sim.arm.advance(
            weight + rows.T @ [push * np.cos(3e-3 * k), push * np.sin(3e-3 * k), -30.0]
        )
    assert sim.impacts > 0


def test_no_point_is_left_inside_a_plane() -> None:
    """Eight points of a hand thrown at a table: ticks that are time-stepped end outside it."""
    around = [[0.06 * np.cos(a), 0.06 * np.sin(a), 0.1] for a in np.arange(8) * np.pi / 4]
    table = {"point": [0.0, 0.0, 0.3], "normal": [0.0, 0.0, 1.0]}
    touching = [
        contact(
            "panda_hand", name=f"c{k}", point=place, plane=table, friction=0.4,
            static_friction=0.5, restitution=0.3 * (k % 2),
        )
        for k, place in enumerate(around)
    ]  # fmt: skip
    ready = models.scene("panda").model_dump(exclude_unset=True)
    sim = Simulator({**ready, "constraints": touching}, integrator="rk4", dt=5e-3)
    draw, most = np.random.default_rng(1), sim.model.effort_limit
    for _ in range(150):
        sim.run(0.02, np.clip(draw.normal(0.0, 30.0, 7), -most, most))
        assert min(force.gap for force in sim.contact_forces()) > -1e-9
    assert sim.state.time_stepped > 0
