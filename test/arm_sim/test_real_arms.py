# SPDX-License-Identifier: Apache-2.0
"""Bundled arms with the drives that their robots have: published numbers, and what they do."""

import numpy as np
import pytest

import models
from arm_dynamics import Term
from arm_dynamics.trajectory import Waypoint
from arm_sim.simulation.closed_loop import ClosedLoop

# Gaz et al., supplementary material: A [N m], o [rad/s], alpha [s/rad] of
# A / (1 + exp(-alpha (v + o))) - A / (1 + exp(-alpha o)).
GAZ = np.array([
    [0.54615, 0.87224, 0.64068, 1.2794, 0.83904, 0.30301, 0.56489],
    [0.039533, 0.025882, -0.04607, 0.036194, 0.026226, -0.021047, 0.0035526],
    [5.1181, 9.0657, 10.136, 5.5903, 8.3469, 17.133, 10.336],
])  # fmt: skip


@pytest.mark.parametrize("name", models.REAL_DRIVES)
def test_it_follows_a_quintic_at_half_its_limits_by_computed_torque(
    name: str, rng: np.random.Generator
) -> None:
    """All joints at once, each up to half its speed limit; 15/8 of the mean speed is the peak."""
    pair = ClosedLoop(models.SCENES / f"{name}.yaml", dt=1e-3)
    sim, duration = pair.simulator, 0.8
    model, start = sim.model, sim.state.q
    away = 0.5 * model.velocity_limit * duration * 8.0 / 15.0 * rng.choice([-1.0, 1.0], sim.n)
    beyond = (start + away > model.position_upper) | (start + away < model.position_lower)
    way = pair.follow([Waypoint(duration, start + np.where(beyond, -away, away))])
    assert way.stretch == 1.0
    run = pair.run(duration)
    wanted = np.array([way.sample(t).q for t in run.time])
    np.testing.assert_allclose(np.abs(run.v).max(0), 0.5 * model.velocity_limit, rtol=0.02)
    assert (np.sqrt(np.mean((run.q - wanted) ** 2, axis=0)) < 1e-3).all()
    assert (np.abs(run.tau) < model.effort_limit).all()


@pytest.mark.parametrize("name", models.REAL_DRIVES)
def test_bodies_are_those_of_the_plain_scene(name: str, rng: np.random.Generator) -> None:
    real, plain = (models.dynamics(n) for n in (name, name.removeprefix("real_")))
    q = rng.normal(size=real.n)
    np.testing.assert_array_equal(real.gravity(q), plain.gravity(q))
    added = real.mass_matrix(q) - plain.mass_matrix(q)
    franka = [0.6057] * 2 + [0.4625] * 2 + [0.2055] * 3
    expected = franka if name in ("real_panda", "real_fr3") else 0.1
    np.testing.assert_allclose(added, np.diag(np.full(real.n, expected)), atol=1e-4)


def test_friction_of_the_panda_is_the_published_one_where_it_has_levelled_off() -> None:
    A, o, alpha = GAZ
    for v in (-2.0, 2.0):
        published = A / (1 + np.exp(-alpha * (v + o))) - A / (1 + np.exp(-alpha * o))
        still = np.zeros(7)
        ours = models.dynamics("real_panda").inverse(
            still, np.full(7, v), still, terms=Term.FRICTION
        )
        np.testing.assert_allclose(ours, published, atol=7e-3)
