# SPDX-License-Identifier: Apache-2.0
"""Runs that are broken off count, send and record only what was done."""

import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import models
from arm_sim import Recording, SimulationDiverged, Simulator, State

# Friction so stiff that explicit steps of 10 ms grow without bound.
FREE: dict[str, Any] = {
    "robot": {"urdf": str(models.FOLDER / "planar_3r.urdf")},
    "joints": {"*": {"friction": {"viscous": 1e6}, "limits": {"stop": False}}},
    "initial": {"velocity": {"joint1": 1.0}},
}


def diverging(**changed: Any) -> Simulator:
    return Simulator(FREE | changed, integrator="euler", dt=1e-2)


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
    sims = [diverging(commands={"delay": 0.03}) for _ in range(2)]
    table = np.linspace(0.0, 1.0, 3000).reshape(1000, 3)
    for sim, control in zip(sims, (table, lambda state: table[state.step]), strict=True):
        with pytest.raises(SimulationDiverged):
            sim.run(10.0, control)
        sim.set_state(v=np.zeros(3))
        sim.step(np.zeros(3))
    np.testing.assert_array_equal(sims[0].effort, sims[1].effort)


def test_an_interruption_at_rest_registers_the_ticks_that_were_made() -> None:
    sim = diverging(initial={}, gravity=[0.0, 0.0, 0.0])
    stepper = sim.arm.compiled.stepper

    class Interrupted:
        def ticks(self, x: Any, command: Any, *rows: Any) -> Any:
            stepper.ticks(x, command, *(array[:2] for array in rows))()
            return lambda: signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        sim.arm.roll(Interrupted(), np.zeros(3), *(np.zeros((9, k)) for k in (6, 3, 2)))
    assert sim.arm.step_count == 2
