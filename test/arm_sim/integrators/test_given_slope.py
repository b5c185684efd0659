# SPDX-License-Identifier: Apache-2.0
"""Steps in scenes with events begin with the slope that the choice of modes has computed."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, load_scene
from arm_sim.integrators import METHODS, build_step
from arm_sim.plant.plant import Plant
from arm_sim.stepping.events import Modes
from tolerances import ALGEBRA, STAGE_AT_END, assert_close

TOUCH = {"type": "contact", "frame": "link3", "point": [0.3, 0, 0], "friction": 0.5,
         "plane": {"point": [0, 0, 0.2], "normal": [0, 0, 1]}}  # fmt: skip
SCENE: dict[str, Any] = {
    "robot": {"urdf": str(models.FOLDER / "planar_3r.urdf")},
    "joints": {"*": {"friction": {"coulomb": 0.5, "viscous": 0.1}, "limits": {"stop": False}}},
    "constraints": [TOUCH],
}
H = 1e-3
EXACT = ("dopri5", "dop853", "implicit", "semi_implicit_euler")
NEAR = ("heun", "rk4", "nystrom4")


@pytest.fixture(scope="module")
def plant() -> Plant:
    return Plant(ArmModel(load_scene(SCENE)))


def built(plant: Plant, name: str, loads: ca.Function | None) -> ca.Function:
    method, n = METHODS[name], plant.model.n
    scale = plant.laws.scale if method.adaptive else None
    return build_step(method, plant.rhs, n, dense=True, loads=loads, scale=scale)


@pytest.mark.parametrize("name", METHODS)
def test_the_same_step(plant: Plant, name: str, rng: np.random.Generator) -> None:
    """To the bit, with the loads at its end where a stage is there."""
    loads = plant.events["loads"]
    x, u = rng.normal(0.0, 0.5, plant.nx), rng.normal(0.0, 1.0, plant.model.n)
    modes = Modes(plant, plant.parameters.nominal)
    modes.direction[:] = 1.0, 0.0, -1.0
    modes.contact["closed"] = modes.contact["sticks"] = 1.0
    x[plant.model.n + 1] = 0.0
    first = plant.rhs(x, u, modes.p)
    np.testing.assert_array_equal(loads(x, u, modes.p)[-1], first)
    plain = [np.array(y) for y in built(plant, name, None)(x, u, modes.p, H)]
    given = [np.array(y) for y in built(plant, name, loads)(x, u, modes.p, H, first)]
    places = [*range(3 if METHODS[name].adaptive else 1), -2, -1]
    more = given[len(places) :]
    for one, other in zip(given, [plain[place] for place in places], strict=False):
        np.testing.assert_array_equal(one, other)
    assert len(more) == 2 * (name in EXACT + NEAR)
    expected = loads(plain[0], u, modes.p)[:2]
    for near, exact in zip(more, expected, strict=False):
        assert_close(near, np.array(exact), ALGEBRA if name in EXACT else STAGE_AT_END)
