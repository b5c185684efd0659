# SPDX-License-Identifier: Apache-2.0
"""What a scene does not use is not computed, and the plan states it."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics.codegen.kernel import generate
from arm_sim import Simulator

PANDA = models.scene("panda").model_dump(exclude_unset=True)
STILL = {"friction": {"viscous": 0.0, "coulomb": 0.0}}


def simulator(**changes: Any) -> Simulator:
    return Simulator({**PANDA, **changes}, integrator="rk4", backend="vm")


@pytest.fixture(scope="module")
def whole() -> Simulator:
    return simulator()


def code(sim: Simulator) -> str:
    return generate([sim.arm.plant.mechanics.acceleration])


FEWER: dict[str, dict[str, Any]] = {
    "gravity off": {"gravity": [0, 0, 0]},
    "friction off": {"joints": {"*": STILL}},
    "one joint locked": {
        "robot": {**PANDA["robot"], "lock": [*PANDA["robot"]["lock"], "panda_joint7"]}
    },
}


@pytest.mark.parametrize("changes", FEWER.values(), ids=FEWER)
def test_fewer_operations(whole: Simulator, changes: dict[str, Any]) -> None:
    plan = simulator(**changes).plan
    assert plan.operations < whole.plan.operations
    assert plan.evaluation < whole.plan.evaluation


NOTHING: dict[str, dict[str, Any]] = {
    "armature of zero": {"joints": {"*": {"armature": 0.0}}},
    "payload of zero": {"payloads": [{"frame": "panda_link7", "mass": 0.0}]},
    "other start": {"initial": {"position": {"panda_joint1": 1.0}}},
    "other limits": {"joints": {"*": {"limits": {"velocity": 1.0}}}},
}


@pytest.mark.parametrize("changes", NOTHING.values(), ids=NOTHING)
def test_what_says_nothing_costs_nothing(whole: Simulator, changes: dict[str, Any]) -> None:
    """Not one operation more."""
    assert simulator(**changes).plan.operations == whole.plan.operations


def test_a_contact_costs_no_operation_of_a_step_while_it_is_apart(whole: Simulator) -> None:
    table = {"type": "contact", "frame": "panda_hand", "plane": {"point": [0, 0, -1]}}
    above = Simulator({**PANDA, "constraints": [table]}, integrator="rk4")
    assert above.plan.apart <= 1.05 * whole.plan.operations < above.plan.operations
    assert f"({above.plan.apart} in free motion)" in str(above.plan)


def test_constraints_are_told_with_the_freedom_that_they_leave() -> None:
    told = [str(Simulator(name).plan) for name in ("four_bar", "parallel_gripper")]
    assert "constraints: 2 rows, 1 degree of freedom" in told[0]
    assert "constraints: 5 rows, 2 degrees of freedom" in told[1]


def test_the_pandas_equations_are_short(whole: Simulator) -> None:
    """Articulated bodies with the robot's constants folded in take 2036 operations; moving inertia
    to parents must save a quarter of that and more, friction included.
    """
    assert whole.plan.evaluation < 0.75 * 2036


def test_slides_alone_need_no_sines() -> None:
    assert "sin" not in code(models.simulator("gantry")).replace("casadi_sincos", "")


def lines(sim: Simulator, word: str) -> list[str]:
    return [line for line in str(sim.plan).splitlines() if line.startswith(word)]


@pytest.mark.parametrize(
    ("changes", "part"),
    [({"gravity": [0, 0, 0]}, "gravity"), ({"joints": {"*": STILL}}, "viscous")],
    ids=["gravity", "friction"],
)
def test_says_what_is_skipped(whole: Simulator, changes: dict[str, Any], part: str) -> None:
    assert any(part in line for line in lines(whole, "computed"))
    sim = simulator(**changes)
    assert any(part in line for line in lines(sim, "skipped"))
    assert not any(part in line for line in lines(sim, "computed"))


def test_measured_time_is_positive_and_harmless(whole: Simulator) -> None:
    before = whole.state
    assert 0.0 < whole.plan.nanoseconds < 1e9
    assert whole.state is before


def test_unused_features_do_not_change_the_motion() -> None:
    """A scene that spells out every default moves to the bit like one that says nothing."""
    urdf = str(models.SCENES / "ur10.yaml")
    bare = Simulator(urdf)
    spelled = models.scene("ur10").model_dump(exclude_unset=True)
    spelled |= {"gravity": [0, 0, -9.81], "payloads": [], "joints": {"*": {"armature": 0.0}}}
    runs = [sim.run(0.05, np.ones(6)) for sim in (bare, Simulator(spelled))]
    np.testing.assert_array_equal(runs[0].q, runs[1].q)
