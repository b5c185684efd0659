# SPDX-License-Identifier: Apache-2.0
"""Methods that are unstable at their step: told when they are chosen, and where that begins."""

from typing import Any

import numpy as np
import pytest
from samples import covering

from arm_sim import Simulator
from arm_sim.integrators import METHODS
from arm_sim.integrators.linear_response import LinearResponse
from arm_sim.integrators.stability import GROWTH_TOLERANCE, longest_step
from models.rotor import rotor

EXPLICIT = [name for name in METHODS if name != "implicit"]


def decay(rate: float) -> dict[str, Any]:
    """A wheel that its friction stops at a rate in [1/s]."""
    return rotor(0.1, viscous=0.1 * rate)


def swing(rate: float) -> dict[str, Any]:
    """A wheel on a spring that swings at a rate in [rad/s]."""
    scene = rotor(0.1)
    scene["joints"]["axle"]["spring"] = {"stiffness": 0.1 * rate**2}
    return scene


def grows(scene: dict[str, Any], method: str) -> bool:
    """Whether a step of 1 ms, which is linear here, multiplies a mode by more than 1."""
    sim, rows = Simulator(scene, integrator=method, dt=1e-3), []
    for start in np.eye(2):
        sim.reset(start[:1], start[1:])
        end = sim.step([0.0])
        rows.append([*end.q, *end.v])
    return bool(abs(np.linalg.eigvals(rows)).max() > 1.0 + GROWTH_TOLERANCE)


def interval(name: str, J: list[list[float]]) -> float:
    """Largest stable step of x' = J x, for rates of 1/s."""
    J_ = np.array(J)
    return longest_step(METHODS[name], LinearResponse(J_, {"": J_[1:]}, initial=True), 100.0)


@pytest.mark.parametrize(("name", "scene"), covering(EXPLICIT, [decay, swing]))
def test_what_is_told_begins_where_steps_grow(
    name: str, scene: Any, caplog: pytest.LogCaptureFixture
) -> None:
    rate = 1e3 * interval(name, [[0, 1], [0, -1]] if scene is decay else [[0, 1], [-1, 0]])
    inside, outside = scene(0.99 * rate), scene(1.01 * rate)
    assert not grows(inside, name)
    assert "unstable" not in caplog.text
    assert grows(outside, name)
    text = f"integrator = '{name}' is unstable at dt = 0.001 s"
    assert text in caplog.text and f"in {1 / (1.01 * rate):.2g} s ('axle')" in caplog.text


def test_a_stiff_joint_is_named_with_its_time_and_what_would_do(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A wheel of 0.045 kg m² with 400 N m s/rad: 0.11 ms, and RK4 bears 2.79 of them."""
    scene = rotor(0.045, viscous=400.0)
    sim = Simulator(scene, integrator="rk4", dt=1e-3)
    told = "unstable at dt = 0.001 s: friction stops a joint in 0.00011 s ('axle'); dt up to 0.000"
    assert told in caplog.text and told in str(sim.plan)
    assert sim.choice.method.name == "rk4"
    caplog.clear()
    for options in ({"integrator": "rk4", "dt": 3.1e-4}, {"integrator": "implicit"}):
        assert "unstable" not in str(Simulator(scene, **options).plan)  # type: ignore[arg-type]
    assert not caplog.records


def test_what_falls_or_topples_by_itself_is_no_fault_of_the_method(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A spring that pushes over its dead centre: the arm is unstable, not the method."""
    arm = {**rotor(0.1), "springs": [{"frames": ["wheel", "world"], "stiffness": 1e3,
           "points": [[0.1, 0, 0], [0.2, 0, 0]], "rest_length": 0.5}]}  # fmt: skip
    sim = Simulator(arm, integrator="rk4")
    assert abs(np.linalg.eigvals(sim.linearize(sim.state, [0.0])[0])).max() > 1.02
    assert not caplog.records
