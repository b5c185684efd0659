# SPDX-License-Identifier: Apache-2.0
"""The stiff flyball governor, whose coupler rods are springs, against its three coordinates."""

import json
from functools import cache
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arm_sim import Recording, Simulator

HERE = Path(__file__).parent
MOTION = json.loads((HERE / "governor.json").read_text())["motion"]
WAYS: dict[str, tuple[dict[str, Any], float]] = {
    "error control": ({"integrator": "dop853", "dt": 1e-2, "tolerance": 1e-10}, 1e-9),
    "implicit": ({"integrator": "implicit", "dt": 1e-3}, 1e-5),
}


@cache
def motion(way: str) -> Recording:
    return Simulator(HERE / "governor.yaml", **WAYS[way][0]).run(10.0)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("t", MOTION)
def test_the_motion_is_that_of_the_reference(way: str, t: str) -> None:
    a, s, va, vs, psi = MOTION[t]
    run, error = motion(way), WAYS[way][1]
    k = round(float(t) / WAYS[way][0]["dt"])
    expected = {"spin": psi, "lift": s, "left": a - pi / 6, "right": a - pi / 6}
    rates = {"lift": vs, "left": va, "right": va}
    for name, value in expected.items():
        np.testing.assert_allclose(run.q[k, run.joint_names.index(name)], value, 0.0, error)
    for name, value in rates.items():
        np.testing.assert_allclose(run.v[k, run.joint_names.index(name)], value, 0.0, 10 * error)


def test_the_spin_keeps_its_angular_momentum() -> None:
    run = motion("error control")
    dynamics, spin = Simulator(HERE / "governor.yaml").dynamics, run.joint_names.index("spin")
    M = dynamics.mass_matrix(run.q[::100])
    momentum = (M[:, spin] * run.v[::100]).sum(axis=1)
    np.testing.assert_allclose(momentum, momentum[0], rtol=1e-11)
