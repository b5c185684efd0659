# SPDX-License-Identifier: Apache-2.0
"""Arms under random torques above a table: what must hold whatever they do."""

from functools import cache

import numpy as np
import pytest
from samples import sampled

import models
from arm_sim import Simulator, contact_history
from models.touching import contact
from tolerances import ENERGY_DRIFT, ORDER

TWO_LINK = {"robot": {"urdf": str(models.SCENES / "two_link.urdf")}}
START = {"initial": {"position": {"shoulder": 0.4, "elbow": 0.5}}}


@cache
def arm(mu: float, e: float) -> Simulator:
    """Two links; the tip and the elbow may touch a table 0.2 m below the shoulder."""
    below = {"point": [0, 0, -0.2]}
    touch = [
        contact(frame, plane=below, friction=mu, restitution=e) for frame in ("tip", "forearm")
    ]
    return Simulator({**TWO_LINK, **START, "constraints": touch}, integrator="rk4", dt=1e-3)


@pytest.mark.parametrize("seed", sampled(range(10), 2))
def test_never_inside_never_pulled_never_more_energy(seed: int) -> None:
    """Ten seconds each: gaps, forces and the energy that the torques have not put in."""
    rng = np.random.default_rng(seed)
    sim = arm(float(rng.choice([0.0, 0.3, 0.5])), float(rng.choice([0.0, 0.4, 0.9])))
    sim.reset()
    ticks = 10_000
    tau = np.repeat(rng.normal(0.0, [8.0, 3.0], (ticks // 100, 2)), 100, axis=0)
    run = sim.run(ticks * sim.dt, tau)
    assert sim.arm.plant.mechanics.contact is not None
    states = np.hstack([run.q, run.v])[::3]
    gaps = np.array(sim.arm.plant.mechanics.contact.geometry(states.T)[0])[::3]
    assert gaps.min() > -1e-12 and sim.impacts > 0
    assert np.diff(run.balance).max() < ENERGY_DRIFT * run.kinetic.max()
    sim.reset()
    history = contact_history(sim, sim.run(0.4, tau[:400]))
    assert (history.force[:, :, 2] >= 0.0).all()


def test_order_is_kept_through_touching_sliding_and_bouncing() -> None:
    """With events located to rounding: order 4 as without contact."""
    scene = {"constraints": [contact("tip", plane={"point": [0, 0, -0.2]}, friction=0.2,
                                     restitution=0.5)]}  # fmt: skip
    exact = Simulator({**TWO_LINK, **START, **scene}, tolerance=1e-13, dt=1e-2)
    wanted = exact.run(0.7).q[-1]
    impacts = exact.impacts
    errors = []
    for dt in (5e-3, 2.5e-3, 1.25e-3):
        sim = Simulator({**TWO_LINK, **START, **scene}, integrator="rk4", dt=dt)
        errors.append(np.abs(sim.run(0.7).q[-1] - wanted).max())
        assert sim.impacts == impacts
    assert impacts >= 2
    assert 0.5 * np.log2(errors[0] / errors[2]) > 4 - ORDER
