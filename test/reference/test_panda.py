# SPDX-License-Identifier: Apache-2.0
"""The Panda let go, against Newton's and Euler's equations solved with 26 digits; its wrist
reaches 40 rad/s within the second.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import models

DATA = json.loads(Path(__file__).with_name("panda.json").read_text())["motion"]
# Allowed error of every joint in [rad].
OPTIONS: list[tuple[dict[str, Any], float]] = [
    ({"integrator": "rk4", "dt": 1e-3}, 5e-6),
    ({"tolerance": 1e-9, "dt": 1e-3}, 1e-8),
    ({"tolerance": 1e-9, "dt": 0.25}, 1e-8),
]


@pytest.mark.parametrize(("options", "allowed"), OPTIONS, ids=str)
@pytest.mark.parametrize("t", DATA)
def test_free_motion(t: str, options: dict[str, Any], allowed: float) -> None:
    q = models.simulator("panda_free", **options).run(float(t)).q[-1]
    wanted = [float(x) for x in DATA[t]["q"]]
    np.testing.assert_allclose(q, wanted, rtol=0.0, atol=allowed)
