# SPDX-License-Identifier: Apache-2.0
"""Bad arguments are refused at once, and the simulator stays usable."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_sim import Simulator

NAN, INF = float("nan"), float("inf")
ZERO = np.zeros(3)
BAD_OPTIONS: dict[str, tuple[dict[str, Any], str]] = {
    "unknown integrator": ({"integrator": "rk5"}, "rk4"),
    "integrator not a name": ({"integrator": 4}, "integrator"), "dt zero": ({"dt": 0.0}, "dt"),
    "dt negative": ({"dt": -1e-3}, "dt"), "dt NaN": ({"dt": NAN}, "dt"),
    "dt infinite": ({"dt": INF}, "dt"), "dt absurd": ({"dt": 1e6}, "dt"),
    "dt a word": ({"dt": "fast"}, "dt"), "dt a number as text": ({"dt": "1"}, "dt = '1'"),
    "tolerance a number as text": ({"tolerance": "1e-8"}, "tolerance = '1e-8'"),
    "dt a truth value": ({"dt": True}, "dt = True"),
    "tolerance a truth value": ({"integrator": "dop853", "tolerance": True}, "tolerance = True"),
    "tolerance zero": ({"tolerance": 0.0}, "tolerance"),
    "tolerance negative": ({"tolerance": -1e-6}, "tolerance"),
    "tolerance NaN": ({"tolerance": NAN}, "tolerance"),
    "tolerance below rounding": ({"tolerance": 1e-20}, "tolerance"),
    "tolerance absurd": ({"tolerance": 10.0}, "tolerance"),
    "tolerance without estimate": ({"integrator": "rk4", "tolerance": 1e-8}, "rk4"),
    "unknown backend": ({"backend": "gpu"}, "native"),
}  # fmt: skip
BAD_VECTORS = {
    "too short": [0.0, 0.0], "too long": [0.0] * 4, "scalar": 1.0, "empty": [],
    "column": np.zeros((3, 1)), "a row of a batch": np.zeros((1, 3)), "NaN": [0.0, NAN, 0.0],
    "infinite": [0.0, 0.0, -INF], "words": ["a", "b", "c"],
    "truth among numbers": [0.0, True, 0.0], "mapping": {"joint1": 0.0},
}  # fmt: skip
BAD_RUNS: dict[str, tuple[Any, Any]] = {
    "negative duration": (-1.0, None),
    "duration NaN": (NAN, None),
    "duration infinite": (INF, None),
    "duration a word": ("long", None),
    "duration a number as text": ("1", None),
    "duration nothing": (None, None),
    "duration a truth value": (True, None),
    "table too short": (0.01, np.zeros((9, 3))),
    "table too long": (0.01, np.zeros((11, 3))),
    "table too wide": (0.01, np.zeros((10, 4))),
    "table with NaN": (0.01, np.full((10, 3), NAN)),
    "vector too short": (0.01, np.zeros(2)),
    "function of nonsense": (0.01, lambda state: "torque"),
    "function of wrong length": (0.01, lambda state: np.zeros(2)),
    "function of NaN": (0.01, lambda state: [NAN, 0.0, 0.0]),
    "function of nothing": (0.01, lambda state: None),
}  # fmt: skip


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
def test_bad_torque(sim: Simulator, value: Any) -> None:
    assert keeps_state(sim, lambda: sim.step(value)).startswith("tau")


@pytest.mark.parametrize("value", BAD_VECTORS.values(), ids=BAD_VECTORS)
def test_bad_reset(sim: Simulator, value: Any) -> None:
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
    "a reference without controller": (ZERO, np.sin, "a reference is for a controller with"),
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


@pytest.mark.parametrize("name", ["steps", "threads", "lanes"])
def test_a_truth_value_counts_nothing(sim: Simulator, name: str) -> None:
    given = {"steps": 1, name: True}
    with pytest.raises(InvalidInput, match=f"{name} = True"):
        sim.rollout(ZERO[None], ZERO[None], ZERO, **given)
