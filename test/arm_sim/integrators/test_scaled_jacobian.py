# SPDX-License-Identifier: Apache-2.0
"""The implicit method for long arms: the scaled Jacobian gives the step of the plain one."""

from typing import Any

import numpy as np
import pytest

from arm_dynamics import ArmModel, load_scene
from arm_sim.integrators import METHODS, build_step
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import scaled_jacobian
from models.large import mobile, snake
from models.touching import contact
from tolerances import INVERSE_PAIR, assert_close

DRY = {"viscous": 20.0, "coulomb": 0.3}
BRISTLES = {"viscous": 0.2, "coulomb": 0.3, "lugre": {"sigma0": 1e4, "sigma1": 20.0}}
RUBBER = {"lower": -0.9, "upper": 0.8, "stop": {"stiffness": 1e3, "damping": 5.0}}
JOINTS: dict[str, dict[str, Any]] = {
    "viscous": {"friction": {"viscous": 20.0}},
    "bristles": {"friction": BRISTLES},
    "compliant stops": {"friction": DRY, "limits": RUBBER},
}


@pytest.fixture(params=["bristles", "compliant stops"])
def plant(request: pytest.FixtureRequest, rng: np.random.Generator) -> Plant:
    scene: dict[str, Any] = {
        "robot": {"urdf": mobile(rng, 18)},
        "joints": {"*": JOINTS[request.param]},
        "tunable": ["payload", "external"],
        "payloads": [{"frame": "link9", "mass": 0.5}],
    }
    return Plant(ArmModel(load_scene(scene)))


def arguments(plant: Plant, rng: np.random.Generator) -> list[np.ndarray]:
    q, v, u = rng.uniform(-1.0, 1.0, (3, plant.model.n))
    sizes = plant.layout.directions, plant.layout.pressed
    direction, pressed = (rng.integers(-1, 2, k) for k in sizes)
    v[direction == 0 if direction.size else []] = 0.0
    modes = np.concatenate([plant.parameters.nominal, direction, pressed])
    return [np.concatenate([q, v, plant.laws.initial(q, v)]), u, modes]


@pytest.mark.parametrize("plant", ["viscous"], indirect=True)
def test_gives_the_same_step(plant: Plant, rng: np.random.Generator) -> None:
    given, method, n = arguments(plant, rng), METHODS["implicit"], plant.model.n
    plain, sparse = (
        np.array(build_step(method, plant.rhs, n, None, scaled)(*given, 1e-3))
        for scaled in (None, lambda: scaled_jacobian(plant))
    )
    assert_close(sparse, plain, INVERSE_PAIR)


def test_short_arms_and_those_that_more_holds_have_none(rng: np.random.Generator) -> None:
    floor = contact("link18", plane={"point": [0.0, 0.0, -9.0]})
    touching = {"robot": {"urdf": mobile(rng, 18)}, "constraints": [floor]}
    assert scaled_jacobian(Plant(ArmModel(load_scene(touching)))) is None
    assert scaled_jacobian(Plant(ArmModel(load_scene(snake(rng, 16))))) is None
