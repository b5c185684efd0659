# SPDX-License-Identifier: Apache-2.0
"""The double pendulum of point masses against Taylor series of high order."""

import json
from pathlib import Path

import numpy as np
import pytest

import models
from tolerances import TRAJECTORY, assert_close

DATA = json.loads(Path(__file__).with_name("double_pendulum.json").read_text())
CASES = [(name, int(t)) for name in ("pi6_pi4", "pi2_pi2") for t in DATA[name]]
START = {"pi6_pi4": (np.pi / 6, np.pi / 4), "pi2_pi2": (np.pi / 2, np.pi / 2)}


@pytest.mark.parametrize(("name", "t"), CASES)
def test_rk4_at_1_ms(name: str, t: int) -> None:
    """The reference has absolute angles; the elbow of the robot is relative."""
    sim = models.simulator("double_pendulum", integrator="rk4", dt=1e-3)
    first, second = START[name]
    sim.reset(q=[first, second - first], v=[0.0, 0.0])
    run = sim.run(float(t))
    th1, th2, w1, w2 = (float(x) for x in DATA[name][str(t)])
    assert_close(run.q[-1], [th1, th2 - th1], TRAJECTORY)
    assert_close(run.v[-1], [w1, w2 - w1], TRAJECTORY)
