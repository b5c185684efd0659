# SPDX-License-Identifier: Apache-2.0
"""When numbers are no longer finite, an error is raised and the last good state is kept."""

from typing import Any

import numpy as np
import pytest

import models
from arm_sim import SimulationDiverged, Simulator

# Friction so stiff that explicit steps of 10 ms grow without bound.
STIFF: dict[str, Any] = {
    "robot": {"urdf": str(models.FOLDER / "planar_3r.urdf")},
    "joints": {"*": {"friction": {"viscous": 1e6, "coulomb": 0.0}}},
    "initial": {"velocity": {"joint1": 1.0}},
}
FREE = {**STIFF, "joints": {"*": {**STIFF["joints"]["*"], "limits": {"stop": False}}}}
"""The same without end stops, and so without events."""
WAYS = pytest.mark.parametrize("backend", ["native", "vm"])
ARMS = pytest.mark.parametrize("scene", [STIFF, FREE], ids=["with stops", "without events"])


def diverging(backend: str = "auto", scene: dict[str, Any] = STIFF) -> Simulator:
    return Simulator(scene, integrator="euler", dt=1e-2, backend=backend)


def finite(sim: Simulator) -> bool:
    return bool(np.isfinite(sim.state.q).all() and np.isfinite(sim.state.v).all())


@ARMS
@WAYS
def test_step_keeps_the_last_good_state(backend: str, scene: dict[str, Any]) -> None:
    sim = diverging(backend, scene)
    last = sim.state
    with pytest.raises(SimulationDiverged):
        for _ in range(1000):
            last = sim.step(np.zeros(3))
    assert sim.state is last and sim.arm.step_count == last.step > 0
    assert finite(sim)


@ARMS
@WAYS
def test_run_keeps_the_motion_so_far(backend: str, scene: dict[str, Any]) -> None:
    sim = diverging(backend, scene)
    with pytest.raises(SimulationDiverged) as caught:
        sim.run(10.0)
    run = caught.value.recording
    assert len(run) == sim.arm.step_count + 1 > 1
    np.testing.assert_array_equal(run.q[-1], sim.state.q)
    assert finite(sim) and np.isfinite(run.v).all()


def test_adaptive_steps_that_cannot_meet_the_tolerance() -> None:
    """A torque without bound on a light joint: error control gives up with the state kept."""
    sim = Simulator(models.scene("double_pendulum"), tolerance=1e-12)
    before = sim.state
    with pytest.raises(SimulationDiverged, match="1e-12"):
        sim.step([1e300, -1e300])
    assert sim.state is before and finite(sim)
    assert np.isfinite(sim.step([0.0, 0.0]).q).all()
