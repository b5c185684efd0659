# SPDX-License-Identifier: Apache-2.0
"""Tunable quantities: impossible values are refused by name, for one arm and for many."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_sim import Simulator

BALL = [0.01, 0, 0, 0.01, 0, 0.01]
LOAD = {"frame": "tip", "mass": 1.0, "com": [0.0, 0.0, 0.1], "inertia": BALL}
GOOD = [1.0, 0.0, 0.0, 0.1, *BALL]
SIDED = {"viscous": {"positive": 0.6, "negative": 0.2}}


@pytest.fixture(scope="module")
def sim() -> Simulator:
    return Simulator({
        "robot": {"urdf": str(models.SCENES / "two_link.urdf")},
        "joints": {"shoulder": {"friction": SIDED | {"coulomb": 0.3}}},
        "payloads": [LOAD, LOAD],
        "constraints": [
            {"type": "plane", "frames": ["tip", "world"], "switchable": True, "active": False}
        ],
        "tunable": ["gravity", "payload", "friction", "coulomb", "external"],
    })  # fmt: skip


def second(**changed: Any) -> list[float]:
    """Two payloads, the second one other than the first."""
    row = list(GOOD)
    for key, value in changed.items():
        row[{"mass": 0, "ixx": 4, "ixy": 5, "izz": 9}[key]] = value
    return [*GOOD, *row]


BAD = {
    "mass": ("payload", second(mass=-0.5), "payload 1: mass = -0.5 kg: at least zero"),
    "across": ("payload", second(ixy=0.02), "payload 1: .*negative in any direction"),
    "no body": ("payload", second(izz=0.03), "payload 1: no body .* 0.01, 0.01, 0.03"),
    "friction": ("friction", [0.5, -0.1], r"friction\[1\] = -0.1 at joint 'elbow'; at least 0 is"),
    "friction one way": (
        "friction",
        [0.19, 0.0],
        r"friction\[0\] = 0.19 at joint 'shoulder'; at least 0.2 \(half the difference",
    ),
    "dry friction": ("coulomb", [-0.1, 0.0], r"coulomb\[0\] = -0.1 at joint 'shoulder'; at"),
    "no dry friction": ("coulomb", [0.1, 0.2], r"coulomb\[1\] = 0.2 at joint 'elbow'; 0, since"),
    "half a constraint": ("constraints", [0.5], r"constraints\[0\] = 0.5; allowed: 1 .* and 0"),
}


@pytest.mark.parametrize(("name", "value", "said"), BAD.values(), ids=BAD)
def test_what_no_arm_can_have_is_refused(
    sim: Simulator, name: str, value: list[float], said: str
) -> None:
    """Of one arm, and of one of many, which is named."""
    before, some = sim.arm.parameters, np.zeros((2, 2))
    with pytest.raises(InvalidInput, match=f"^{said}"):
        sim.set_parameter(name, value)
    np.testing.assert_array_equal(sim.arm.parameters, before)
    rows = [sim.arm.plant.parameters.of(name, before), np.array(value)]
    said = said.replace("payload 1", "payload 1 of arm 1").replace(r"\] =", r"\] of arm 1 =")
    with pytest.raises(InvalidInput, match=f"^{said}"):
        sim.rollout(some, some, some, 1, parameters={name: rows})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("payload", [0.0] * 20),
        ("payload", second(izz=0.02)),
        ("friction", [0.2, 0.0]),
    ],
)
def test_what_is_just_possible_is_taken(sim: Simulator, name: str, value: list[float]) -> None:
    before = sim.arm.plant.parameters.of(name, sim.arm.parameters)
    sim.set_parameter(name, value)
    np.testing.assert_array_equal(sim.arm.plant.parameters.of(name, sim.arm.parameters), value)
    sim.set_parameter(name, before)
