# SPDX-License-Identifier: Apache-2.0
"""A double pendulum whose elbow hardly gives: explicit methods need steps far below what the
motion asks for, the implicit one does not.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from arm_sim import SimulationDiverged, Simulator
from tolerances import TRAJECTORY, assert_close

HERE = Path(__file__).parent
DATA = json.loads((HERE / "stiff_elbow.json").read_text())["motion"]
SCENE = HERE / "stiff_elbow.yaml"


def test_what_is_chosen_by_itself() -> None:
    sim = Simulator(SCENE, dt=1e-2)
    assert sim.plan.integrator == "implicit"
    run = sim.run(1.0)
    for t, state in DATA.items():
        th1, th2, w1, w2 = (float(x) for x in state)
        k = round(100 * float(t))
        assert_close(run.q[k], [th1, th2 - th1], TRAJECTORY)
        assert_close(run.v[k], [w1, w2 - w1], TRAJECTORY)


def test_rk4_at_1_ms_is_beyond_its_stability() -> None:
    """And says so: no numbers that look like a motion."""
    with pytest.raises(SimulationDiverged):
        Simulator(SCENE, integrator="rk4", dt=1e-3).run(1.0)


def test_error_control_finds_the_steps_that_an_explicit_method_needs() -> None:
    sim = Simulator(SCENE, integrator="dop853", tolerance=1e-9, dt=1e-2)
    th1, th2 = (float(x) for x in DATA["1"][:2])
    np.testing.assert_allclose(sim.run(1.0).q[-1], [th1, th2 - th1], rtol=0.0, atol=1e-8)
