# SPDX-License-Identifier: Apache-2.0
"""Scenes whose friction acts faster than a tick: the implicit method, and when it is chosen."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, load_scene
from arm_sim import SimulationDiverged, Simulator
from arm_sim.integrators.selection import Choice, choose, fastest_rate
from arm_sim.plant.plant import Plant
from tolerances import assert_close


def arm(name: str, viscous: float) -> dict[str, object]:
    """A robot with so much friction in each joint, and no other."""
    scene = models.scene(name).model_dump(exclude_unset=True)
    return {**scene, "joints": {"*": {"friction": {"viscous": viscous, "coulomb": 0.0}}}}


def scara(**options: Any) -> Simulator:
    return Simulator(models.boundless(load_scene(arm("scara", 1e4))), **options)


def test_stays_accurate_where_explicit_steps_blow_up() -> None:
    truth = scara(integrator="implicit", tolerance=1e-11).run(0.2).q[-1]
    with pytest.raises(SimulationDiverged):
        scara(integrator="rk4").run(0.2)
    between_stops = Simulator(arm("scara", 1e4), integrator="rk4").run(0.2)
    assert not between_stops.trusted
    assert_close(scara(integrator="implicit").run(0.2).q[-1], truth, 1e-9)


def test_agrees_with_the_explicit_pair_on_a_stiff_arm() -> None:
    """The explicit pair gets there too, in many small steps, the first tries of which overflow."""
    explicit = scara(integrator="dop853", tolerance=1e-9, dt=0.1).run(0.1).q[-1]
    implicit = scara(integrator="implicit", tolerance=1e-9, dt=0.1).run(0.1).q[-1]
    assert_close(implicit, explicit, 1e-7)


def test_damping_rate_of_a_closed_form(rng: np.random.Generator) -> None:
    """One pendulum of inertia m l² = 1: the rate is the coefficient itself."""
    viscous = float(rng.uniform(1.0, 1e4))
    scene = models.scene("pendulum").model_dump(exclude_unset=True)
    scene["joints"] = {"*": {"friction": {"viscous": viscous}}}
    assert_close(fastest_rate(Simulator(scene).arm.plant), viscous, 1e-9 * viscous)


def test_auto_takes_it_only_where_it_is_needed() -> None:
    """By the fastest of Panda's joints, as its wrist is light."""

    def auto(viscous: float, tolerance: float | None = None) -> Choice:
        return choose(Plant(ArmModel(load_scene(arm("panda", viscous)))), None, None, tolerance)

    assert auto(0.003).method.name == "rk4"
    assert auto(0.003, 1e-6).method.name == "dop853"
    assert auto(50.0).method.name == "implicit" and "stiff" in auto(50.0).reason
    assert auto(50.0, 1e-6).method.name == "implicit"
