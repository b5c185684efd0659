# SPDX-License-Identifier: Apache-2.0
"""Threads build expressions in turn, whatever of the suite they build; CasADi would crash."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event, Thread

import numpy as np
import pytest

from arm_dynamics import Dynamics
from arm_dynamics.actuation.command_map import CommandMap
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.control import compiled_law, make_controller, preparation
from arm_dynamics.dynamics.point_answers import INVERSE, compiled_answer
from arm_dynamics.dynamics.rigid import MANY
from arm_dynamics.task_space import compiled as task_space
from arm_sim import Simulator

ARM = Dynamics("double_pendulum")
COMPENSATED = Dynamics(
    ARM.model.scene.model_dump(exclude_unset=True) | {"commands": {"gravity_compensated": True}}
)
SIM = Simulator("double_pendulum")
BUILDS: dict[str, Callable[[], object]] = {
    "simulator": lambda: Simulator("double_pendulum"),
    "controller": lambda: preparation(make_controller("computed_torque", Dynamics(ARM.model)))(),
    "service": lambda: compiled_answer(INVERSE, ARM),
    "batches": lambda: ARM.inverse(*np.zeros((3, MANY, 2))),
    "task space": lambda: task_space.build(ARM.model, "lower", ("x",)),
    "commands": lambda: CommandMap(COMPENSATED.model),
    "servo": lambda: SIM.arm.compiled.servo,
    "plan": lambda: SIM.plan,
    "derivatives": lambda: SIM.arm.compiled.derivatives.linearizer(),
    "rollouts": lambda: SIM.arm.compiled.rollouts,
}


@pytest.mark.parametrize("name", BUILDS)
def test_a_thread_waits_for_another_that_builds(name: str) -> None:
    begun, end, done = Event(), Event(), list[str]()

    @one_at_a_time
    def build_for_long() -> None:
        begun.set()
        end.wait(30.0)

    def build() -> None:
        BUILDS[name]()
        done.append(name)

    first, second = Thread(target=build_for_long), Thread(target=build)
    first.start()
    assert begun.wait(10.0)
    second.start()
    second.join(0.1)
    waited = not done
    end.set()
    second.join(60.0)
    first.join(10.0)
    assert waited
    assert done == [name]


def test_a_thread_may_build_within_a_build() -> None:
    assert one_at_a_time(one_at_a_time(lambda: 1))() == 1


def test_what_is_built_is_found_while_another_thread_builds() -> None:
    begun, end = Event(), Event()
    thread = Thread(target=one_at_a_time(lambda: (begun.set(), end.wait(30.0))))
    control = make_controller("computed_torque", ARM)
    lookups = [
        lambda: compiled_law.build(control.law, ARM.model),
        lambda: task_space.build(ARM.model, "lower", ("x",)),
        lambda: SIM.arm.compiled.derivatives.linearizer(),
    ]
    built = [lookup() for lookup in lookups]
    thread.start()
    assert begun.wait(10.0)
    found = [lookup() for lookup in lookups]  # would wait for half a minute
    still_building = not end.is_set() and thread.is_alive()
    end.set()
    thread.join(10.0)
    assert still_building
    assert [id(each) for each in found] == [id(each) for each in built]
