# SPDX-License-Identifier: Apache-2.0
"""What a scene does not use is not computed, and the plan states it."""

from time import perf_counter_ns
from typing import Any

import pytest

import models
from arm_sim import Simulator

PANDA = models.scene("panda").model_dump(exclude_unset=True)
STILL = {"friction": {"viscous": 0.0, "coulomb": 0.0}}


def simulator(**changes: Any) -> Simulator:
    return Simulator({**PANDA, **changes}, integrator="rk4", backend="vm")


@pytest.fixture(scope="module")
def whole() -> Simulator:
    return simulator()


FEWER: dict[str, tuple[dict[str, Any], str]] = {
    "gravity off": ({"gravity": [0, 0, 0]}, "gravity"),
    "friction off": ({"joints": {"*": STILL}}, "viscous"),
}


@pytest.mark.parametrize(("changes", "part"), FEWER.values(), ids=FEWER)
def test_what_is_off_is_skipped_and_told(
    whole: Simulator, changes: dict[str, Any], part: str
) -> None:
    plan = simulator(**changes).plan
    assert plan.operations < whole.plan.operations
    assert plan.evaluation < whole.plan.evaluation
    for told, on in ((whole.plan, True), (plan, False)):
        lines = {line.split()[0]: line for line in str(told).splitlines() if part in line}
        assert ("computed" in lines) == on and ("skipped" in lines) == (not on)


NOTHING: dict[str, dict[str, Any]] = {
    "armature, springs of zero": {
        "springs": [], "joints": {"*": {"armature": 0.0, "spring": {"stiffness": 0.0}}}
    },
    "payload of zero": {"payloads": [{"frame": "panda_link7", "mass": 0.0}]},
}  # fmt: skip


@pytest.mark.parametrize("changes", NOTHING.values(), ids=NOTHING)
def test_what_says_nothing_costs_nothing(whole: Simulator, changes: dict[str, Any]) -> None:
    """Not one operation more."""
    assert simulator(**changes).plan.operations == whole.plan.operations


def test_the_time_of_a_tick_is_within_that_of_measuring_it() -> None:
    plan, began = simulator().plan, perf_counter_ns()
    assert 0.0 < plan.nanoseconds < perf_counter_ns() - began


def test_a_contact_costs_no_operation_of_a_step_while_it_is_apart(whole: Simulator) -> None:
    table = {"type": "contact", "frame": "panda_hand", "plane": {"point": [0, 0, -1]}}
    above = Simulator({**PANDA, "constraints": [table]}, integrator="rk4")
    assert above.plan.apart <= 1.05 * whole.plan.operations < above.plan.operations
    assert f"({above.plan.apart} in free motion)" in str(above.plan)


def test_the_pandas_equations_are_short(whole: Simulator) -> None:
    """Articulated bodies with the robot's constants folded in take 2036 operations; moving inertia
    to parents must save a quarter of that and more, friction included.
    """
    assert whole.plan.evaluation < 0.75 * 2036
