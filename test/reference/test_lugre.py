# SPDX-License-Identifier: Apache-2.0
"""LuGre friction at 1 kHz against SciPy's Radau method: soft and stiff bristles, light and heavy
wheels, sticking, sliding, coasting to rest and reversing.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples import sampled

from arm_sim import Simulator
from models.rotor import rotor
from tolerances import LUGRE

KNOWN = json.loads(Path(__file__).with_name("lugre.json").read_text())
DATA, COURSES = KNOWN["wheels"], KNOWN["courses"]


def simulator(wheel: dict[str, Any], **options: Any) -> Simulator:
    law = {key: wheel[key] for key in ("sigma0", "sigma1", "sigma1_velocity") if wheel[key]}
    falls = ("stribeck_velocity",) if wheel["static"] > wheel["coulomb"] else ()
    keys = ("viscous", "coulomb", "static", *falls)
    scene = rotor(wheel["J"], **{key: wheel[key] for key in keys}, lugre=law)
    return Simulator(scene, dt=1e-3, **options)


def torques(course: str) -> np.ndarray:
    return np.concatenate([np.full(round(1e3 * t), u) for t, u in COURSES[course][1]])[:, None]


def named(case: dict[str, Any]) -> str:
    return f"{case['wheel']['sigma0']:g}-{case['wheel']['J']}"


@pytest.mark.parametrize("case", sampled(DATA, 6), ids=named)
def test_half_a_second(case: dict[str, Any]) -> None:
    sim = simulator(case["wheel"])
    for course, (v0, _) in COURSES.items():
        sim.reset(v=[v0])
        run = sim.run(0.5, torques(course))
        assert abs(run.q[-1, 0] - case["angle"][course]) < LUGRE, course


@pytest.mark.parametrize(
    "options", [{"tolerance": 1e-8}, {"integrator": "rk4"}, {"backend": "vm"}], ids=str
)
def test_whatever_the_caller_says(options: dict[str, Any]) -> None:
    """A tolerance is kept; a method that diverges with bristles is replaced (see the plan)."""
    case = DATA[0]
    sim = simulator(case["wheel"], **options)
    assert sim.plan.integrator == "implicit" and "LuGre" in sim.plan.reason
    run = sim.run(0.5, torques("reverse"))
    assert abs(run.q[-1, 0] - case["angle"]["reverse"]) < LUGRE
