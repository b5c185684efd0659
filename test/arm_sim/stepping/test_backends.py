# SPDX-License-Identifier: Apache-2.0
"""CasADi's virtual machine and compiled code give the same results."""

from typing import Any

import numpy as np
import pytest
from samples import covering

import models
from tolerances import BACKENDS, assert_close

OPTIONS: list[dict[str, Any]] = [
    {"integrator": "euler"},
    {"integrator": "semi_implicit_euler"},
    {"integrator": "rk4"},
    {"integrator": "nystrom4"},
    {"tolerance": 1e-8},
]
TICKS = 20


@pytest.mark.parametrize(
    ("name", "options"), covering(["panda", "gripper", "scara", "two_arms"], OPTIONS), ids=str
)
def test_the_same_motion(name: str, options: dict[str, Any], rng: np.random.Generator) -> None:
    native = models.simulator(name, stops=False, backend="native", **options)
    virtual = models.simulator(name, stops=False, backend="vm", **options)
    torque = rng.normal(0.0, 2.0, (TICKS, native.n))
    runs = [sim.run(TICKS * sim.dt, torque) for sim in (native, virtual)]
    assert_close(runs[1].q, runs[0].q, BACKENDS)
    assert_close(runs[1].v, runs[0].v, BACKENDS)
    np.testing.assert_array_equal(runs[1].tau, runs[0].tau)
    assert (runs[0].local_error[-1] > 0.0) == ("tolerance" in options)
    np.testing.assert_allclose(runs[1].local_error, runs[0].local_error, rtol=1e-6, atol=1e-18)


def test_the_plan_names_the_backend() -> None:
    assert "virtual machine" in str(models.simulator("gantry", backend="vm").plan)
    assert "virtual machine" not in str(models.simulator("gantry", backend="native").plan)
