# SPDX-License-Identifier: Apache-2.0
"""When numbers are no longer finite, an error is raised and the last good state is kept."""

import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import models
from arm_sim import Recording, SimulationDiverged, Simulator, State

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


def test_a_controller_that_diverges_breaks_the_run_off_where_it_is(tmp_path: Path) -> None:
    sim, stops = Simulator("two_link"), []

    def control(state: State) -> list[float]:
        if state.step == 7:
            with pytest.raises(SimulationDiverged) as caught:
                diverging().run(10.0)
            stops.append(caught.value)
            raise caught.value
        return [0.0, 0.0]

    with pytest.raises(SimulationDiverged) as caught:
        sim.record(tmp_path / "run.mcap", 1.0, control)
    assert caught.value is stops[0] and sim.arm.step_count == 7
    np.testing.assert_array_equal(Recording.load(tmp_path / "run.mcap").q[-1], sim.state.q)


def test_commands_of_ticks_that_are_not_made_do_not_arrive() -> None:
    sims = [diverging(scene={**FREE, "commands": {"delay": 0.03}}) for _ in range(2)]
    table = np.linspace(0.0, 1.0, 3000).reshape(1000, 3)
    for sim, control in zip(sims, (table, lambda state: table[state.step]), strict=True):
        with pytest.raises(SimulationDiverged):
            sim.run(10.0, control)
        sim.set_state(v=np.zeros(3))
        sim.step(np.zeros(3))
    np.testing.assert_array_equal(sims[0].effort, sims[1].effort)


def test_an_interruption_at_rest_registers_the_ticks_that_were_made() -> None:
    sim = diverging(scene={**FREE, "initial": {}, "gravity": [0.0, 0.0, 0.0]})
    stepper = sim.arm.compiled.stepper

    class Interrupted:
        def ticks(self, x: Any, command: Any, *rows: Any) -> Any:
            stepper.ticks(x, command, *(array[:2] for array in rows))()
            return lambda: signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        sim.arm.roll(Interrupted(), np.zeros(3), *(np.zeros((9, k)) for k in (6, 3, 2)))
    assert sim.arm.step_count == 2
