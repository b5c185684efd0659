# SPDX-License-Identifier: Apache-2.0
"""Bad arguments, and numbers that grow without bound, are refused; the simulator stays usable."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_sim import Recording, SimulationDiverged, Simulator, State

NAN, INF = float("nan"), float("inf")
ZERO = np.zeros(3)
BAD_OPTIONS: dict[str, tuple[dict[str, Any], str]] = {
    "unknown integrator": ({"integrator": "rk5"}, "rk4"),
    "dt zero": ({"dt": 0.0}, "dt"), "dt NaN": ({"dt": NAN}, "dt"),
    "dt a number as text": ({"dt": "1"}, "dt = '1'"),
    "tolerance a truth value": ({"integrator": "dop853", "tolerance": True}, "tolerance = True"),
    "tolerance below rounding": ({"tolerance": 1e-20}, "tolerance"),
    "tolerance without estimate": ({"integrator": "rk4", "tolerance": 1e-8}, "rk4"),
    "unknown backend": ({"backend": "gpu"}, "native"),
}  # fmt: skip
BAD_VECTORS = {
    "too short": [0.0, 0.0], "a row of a batch": np.zeros((1, 3)), "words": ["a", "b", "c"],
    "NaN": [0.0, NAN, 0.0], "infinite": [0.0, 0.0, -INF], "mapping": {"joint1": 0.0},
}  # fmt: skip
BAD_RUNS: dict[str, tuple[Any, Any]] = {
    "negative duration": (-1.0, None),
    "duration infinite": (INF, None),
    "duration a number as text": ("1", None),
    "table too short": (0.01, np.zeros((9, 3))),
    "table with NaN": (0.01, np.full((10, 3), NAN)),
    "function of wrong length": (0.01, lambda state: np.zeros(2)),
    "function of NaN": (0.01, lambda state: [NAN, 0.0, 0.0]),
    "function of nothing": (0.01, lambda state: None),
}


@pytest.fixture
def sim() -> Simulator:
    return models.simulator("planar_3r")


def keeps_state(sim: Simulator, call: Callable[[], object]) -> str:
    """The call is refused, the state is what it was, and the next step works; returns what was
    said.
    """
    before = sim.step([1.0, 0.5, 0.2])
    with pytest.raises(InvalidInput) as caught:
        call()
    assert sim.state is before
    assert np.isfinite(sim.step(ZERO).q).all()
    return str(caught.value)


@pytest.mark.parametrize(("options", "word"), BAD_OPTIONS.values(), ids=BAD_OPTIONS)
def test_bad_option(options: dict[str, Any], word: str) -> None:
    with pytest.raises(InvalidInput) as caught:
        Simulator(models.scene("planar_3r"), **options)
    assert word in str(caught.value)


@pytest.mark.parametrize("value", BAD_VECTORS.values(), ids=BAD_VECTORS)
def test_bad_vector(sim: Simulator, value: Any) -> None:
    assert keeps_state(sim, lambda: sim.step(value)).startswith("tau")
    assert keeps_state(sim, lambda: sim.reset(q=value)).startswith("q")
    assert keeps_state(sim, lambda: sim.reset(v=value)).startswith("v")


@pytest.mark.parametrize(("duration", "control"), BAD_RUNS.values(), ids=BAD_RUNS)
def test_bad_run(sim: Simulator, duration: Any, control: Any) -> None:
    keeps_state(sim, lambda: sim.run(duration, control))


class Holding:
    """A controller without memory."""

    def torque(self, state: Any, reference: Any) -> Any:
        return reference.q - state.q


BAD_CONTROLLERS: dict[str, tuple[Any, Any, str]] = {
    "a function as reference": (Holding(), np.sin, "reference is of type ufunc; an object with"),
    "a reference of a function": (lambda state: ZERO, np.sin, "a reference is for a controller"),
    "a function of two": (lambda state, more: ZERO, None, "a function of one argument, the state"),
}


@pytest.mark.parametrize(
    ("control", "reference", "said"), BAD_CONTROLLERS.values(), ids=BAD_CONTROLLERS
)
def test_bad_controller(sim: Simulator, control: Any, reference: Any, said: str) -> None:
    assert said in keeps_state(sim, lambda: sim.run(0.01, control, reference))
    assert len(sim.run(0.01, Holding())) == 11


def test_controllers_own_error_passes_through(sim: Simulator) -> None:
    def control(state: object) -> None:
        raise ZeroDivisionError("in the user's code")

    with pytest.raises(ZeroDivisionError, match="user's code"):
        sim.run(0.01, control)
    assert sim.arm.step_count == 0


# Friction so stiff that explicit steps of 10 ms grow without bound.
STIFF: dict[str, Any] = {
    "robot": {"urdf": str(models.FOLDER / "planar_3r.urdf")},
    "joints": {"*": {"friction": {"viscous": 1e6, "coulomb": 0.0}}},
    "initial": {"velocity": {"joint1": 1.0}},
}
FREE = {**STIFF, "joints": {"*": {**STIFF["joints"]["*"], "limits": {"stop": False}}}}
"""The same without end stops, and so without events."""


@pytest.mark.parametrize("scene", [STIFF, FREE], ids=["with stops", "without events"])
@pytest.mark.parametrize("backend", ["native", "vm"])
def test_the_last_good_state_and_the_motion_so_far_are_kept(
    backend: str, scene: dict[str, Any]
) -> None:
    sim = Simulator(scene, integrator="euler", dt=1e-2, backend=backend)
    with pytest.raises(SimulationDiverged) as caught:
        sim.run(10.0)
    run = caught.value.recording
    assert len(run) == sim.arm.step_count + 1 > 1
    np.testing.assert_array_equal(run.q[-1], sim.state.q)
    assert np.isfinite([run.q, run.v]).all()
    last = sim.reset()
    with pytest.raises(SimulationDiverged):
        for _ in range(1000):
            last = sim.step(np.zeros(3))
    assert sim.state is last and sim.arm.step_count == last.step == len(run) - 1
    np.testing.assert_array_equal(last.q, run.q[-1])


def test_a_controller_that_diverges_breaks_the_run_off_where_it_is(tmp_path: Path) -> None:
    sim, stops = Simulator("two_link"), []

    def control(state: State) -> list[float]:
        if state.step == 7:
            with pytest.raises(SimulationDiverged) as caught:
                Simulator(FREE, integrator="euler", dt=1e-2).run(10.0)
            stops.append(caught.value)
            raise caught.value
        return [0.0, 0.0]

    with pytest.raises(SimulationDiverged) as caught:
        sim.record(tmp_path / "run.mcap", 1.0, control)
    assert caught.value is stops[0] and sim.arm.step_count == 7
    np.testing.assert_array_equal(Recording.load(tmp_path / "run.mcap").q[-1], sim.state.q)


def test_commands_of_ticks_that_are_not_made_do_not_arrive() -> None:
    late = FREE | {"commands": {"delay": 0.03}}
    sims = [Simulator(late, integrator="euler", dt=1e-2) for _ in range(2)]
    table = np.linspace(0.0, 1.0, 3000).reshape(1000, 3)
    for sim, control in zip(sims, (table, lambda state: table[state.step]), strict=True):
        with pytest.raises(SimulationDiverged):
            sim.run(10.0, control)
        sim.set_state(v=np.zeros(3))
        sim.step(np.zeros(3))
    np.testing.assert_array_equal(sims[0].effort, sims[1].effort)


def test_adaptive_steps_that_cannot_meet_the_tolerance() -> None:
    """A torque without bound on a light joint: error control gives up with the state kept."""
    sim = Simulator(models.scene("double_pendulum"), tolerance=1e-12)
    before = sim.state
    with pytest.raises(SimulationDiverged, match="1e-12"):
        sim.step([1e300, -1e300])
    assert sim.state is before
    assert np.isfinite(sim.step([0.0, 0.0]).q).all()
