# SPDX-License-Identifier: Apache-2.0
"""Scenes whose friction acts faster than a tick: the implicit method, and when it is chosen."""

from __future__ import annotations

import numpy as np
import pytest

import models
from arm_sim import SimulationDiverged, Simulator
from arm_sim.integrators.selection import damping_rate
from tolerances import assert_close


def panda(viscous: float, **options: object) -> Simulator:
    scene = models.scene("panda").model_dump(exclude_unset=True)
    scene["joints"] = {"*": {"friction": {"viscous": viscous, "coulomb": 0.0}}}
    return Simulator(scene, **options)  # type: ignore[arg-type]


def test_stays_accurate_where_explicit_steps_blow_up() -> None:
    truth = panda(50.0, integrator="implicit", tolerance=1e-11).run(0.2).q[-1]
    with pytest.raises(SimulationDiverged):
        panda(50.0, integrator="rk4").run(0.2)
    assert_close(panda(50.0, integrator="implicit").run(0.2).q[-1], truth, 1e-9)


def test_agrees_with_the_explicit_pair_on_a_stiff_arm() -> None:
    """The explicit pair gets there too, in many small steps, the first tries of which overflow."""
    explicit = panda(50.0, integrator="dop853", tolerance=1e-9, dt=0.1).run(0.1).q[-1]
    implicit = panda(50.0, integrator="implicit", tolerance=1e-9, dt=0.1).run(0.1).q[-1]
    assert_close(implicit, explicit, 1e-7)


def test_damping_rate_of_a_closed_form(rng: np.random.Generator) -> None:
    """One pendulum of inertia m l² = 1: the rate is the coefficient itself."""
    viscous = float(rng.uniform(1.0, 1e4))
    scene = models.scene("pendulum").model_dump(exclude_unset=True)
    scene["joints"] = {"*": {"friction": {"viscous": viscous}}}
    assert_close(damping_rate(Simulator(scene).model), viscous, 1e-9 * viscous)


def test_auto_takes_it_only_where_it_is_needed() -> None:
    assert panda(0.003).plan.integrator == "rk4"
    assert panda(0.003, tolerance=1e-6).plan.integrator == "dop853"
    stiff = panda(50.0).plan
    assert stiff.integrator == "implicit" and "stiff" in stiff.reason
    assert panda(50.0, tolerance=1e-6).plan.integrator == "implicit"
