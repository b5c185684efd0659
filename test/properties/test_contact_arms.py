# SPDX-License-Identifier: Apache-2.0
"""Arms under random torques above a table: what must hold whatever they do."""

import numpy as np
import pytest
from samples import sampled

import models
from arm_sim import Simulator, contact_history
from models.touching import contact
from tolerances import ENERGY_DRIFT


@pytest.mark.parametrize("seed", sampled(range(10), 2))
def test_never_inside_never_pulled_never_more_energy(seed: int) -> None:
    """Ten seconds each: gaps, forces and the energy that the torques have not put in.

    Two links; the tip and the forearm may touch a table 0.2 m below the shoulder.
    """
    rng = np.random.default_rng(seed)
    mu, e = float(rng.choice([0.0, 0.3, 0.5])), float(rng.choice([0.0, 0.4, 0.9]))
    law = {"plane": {"point": [0, 0, -0.2]}, "friction": mu, "restitution": e}
    touch = [contact(frame, **law) for frame in ("tip", "forearm")]
    start, urdf = {"shoulder": 0.4, "elbow": 0.5}, str(models.SCENES / "two_link.urdf")
    scene = {"robot": {"urdf": urdf}, "constraints": touch, "initial": {"position": start}}
    sim, ticks = Simulator(scene, integrator="rk4", dt=1e-3), 10_000
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
