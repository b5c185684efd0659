# SPDX-License-Identifier: Apache-2.0
"""Scenes whose friction acts faster than a tick: the implicit method, and when it is chosen."""

from typing import Any

import pytest

import models
from arm_dynamics import load_scene
from arm_sim import SimulationDiverged, Simulator
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
