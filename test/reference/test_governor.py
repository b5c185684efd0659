# SPDX-License-Identifier: Apache-2.0
"""The stiff flyball governor, whose coupler rods are springs, against its three coordinates."""

import json
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arm_sim import Simulator

HERE = Path(__file__).parent
MOTION = json.loads((HERE / "governor.json").read_text())["motion"]
WAYS: dict[str, tuple[dict[str, Any], float]] = {
    "error control": ({"integrator": "dop853", "dt": 1e-2, "tolerance": 1e-10}, 1e-9),
    "implicit": ({"integrator": "implicit", "dt": 1e-3}, 1e-5),
}


@pytest.mark.parametrize("way", WAYS)
def test_the_motion_is_that_of_the_reference(way: str) -> None:
    options, error = WAYS[way]
    sim = Simulator(HERE / "governor.yaml", **options)
    run = sim.run(10.0)
    spin, lift, left, right = (run.joint_names.index(x) for x in ("spin", "lift", "left", "right"))
    for t, (a, s, va, vs, psi) in MOTION.items():
        k, angle = round(float(t) / options["dt"]), a - pi / 6
        found = run.q[k, [spin, lift, left, right]]
        np.testing.assert_allclose(found, [psi, s, angle, angle], 0.0, error)
        np.testing.assert_allclose(run.v[k, [lift, left, right]], [vs, va, va], 0.0, 10 * error)
    if way == "error control":
        M = sim.dynamics.mass_matrix(run.q[::100])
        momentum = (M[:, spin] * run.v[::100]).sum(axis=1)
        np.testing.assert_allclose(momentum, momentum[0], rtol=1e-11)
