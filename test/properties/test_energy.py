# SPDX-License-Identifier: Apache-2.0
"""Energy: conserved when nothing takes or gives any, and accounted for when something does."""

import numpy as np
import pytest
from samples import sampled

import models
from arm_sim import Simulator
from tolerances import DRY_BALANCE, ENERGY_DRIFT, assert_close

# Light wrists on heavy arms flail when let go: the time is short, so that speeds stay those of a
# robot.
SECONDS = 0.3
EACH = sampled(models.ROBOTS, 3)


def energies(name: str, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Total energy by Pinocchio alone."""
    return np.array([sum(models.oracle(name).energy(*state)) for state in zip(q, v, strict=True)])


def start(sim: Simulator, rng: np.random.Generator) -> np.ndarray:
    """Put the robot anywhere within reach, moving gently; returns a torque that would accelerate
    it gently.
    """
    low, high = sim.model.position_lower.clip(-1.5, 1.5), sim.model.position_upper.clip(-1.5, 1.5)
    q, v = rng.uniform(low, high), 0.2 * rng.normal(size=sim.n)
    sim.reset(q, v)
    tau = sim.dynamics.inverse(q, v, rng.normal(size=sim.n), terms=7)
    return np.asarray(tau.clip(-sim.model.effort_limit, sim.model.effort_limit))


@pytest.mark.parametrize("robot", EACH)
def test_conserved_without_losses(robot: str, rng: np.random.Generator) -> None:
    scene = models.scene(robot).model_dump(exclude_unset=True)
    still = {"friction": {"viscous": 0.0, "coulomb": 0.0}, "limits": {"stop": False}}
    joints = {name: joint | still for name, joint in scene.get("joints", {}).items()}
    sim = Simulator({**scene, "joints": {**joints, "*": still}}, integrator="rk4")
    start(sim, rng)
    run = sim.run(SECONDS)
    total = energies(robot, run.q[::50], run.v[::50])
    exchanged = max(1e-3, float(np.ptp(run.kinetic)))
    assert_close((total - total[0]) / exchanged, np.zeros_like(total), ENERGY_DRIFT)


@pytest.mark.parametrize("robot", EACH)
def test_power_balance(robot: str, rng: np.random.Generator) -> None:
    """What the drives give is in the energies or in the bearings; the integral by Simpson's rule
    over short ticks.
    """
    sim = models.simulator(robot, stops=False, integrator="rk4", dt=1e-4)
    run = sim.run(SECONDS, start(sim, rng))
    given = ((run.q[1:] - run.q[:-1]) * run.tau[:-1]).sum()
    power = np.einsum("ki,ki->k", sim.dynamics.friction(run.v), run.v)
    lost = (power[0] + power[-1] + 4 * power[1:-1:2].sum() + 2 * power[2:-1:2].sum()) * sim.dt / 3
    change = energies(robot, run.q[[0, -1]], run.v[[0, -1]]) @ [-1.0, 1.0]
    scale = max(1e-3, abs(given), lost, float(np.ptp(run.kinetic)))
    allowed = DRY_BALANCE / 100 if sim.model.has_dry_friction else ENERGY_DRIFT
    assert abs(change - given + lost) / scale < allowed
