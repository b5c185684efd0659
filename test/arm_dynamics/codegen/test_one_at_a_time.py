# SPDX-License-Identifier: Apache-2.0
"""Threads build expressions in turn, whatever of the suite they build; CasADi would crash."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from threading import Event, Thread
from time import sleep

import casadi as ca
import numpy as np
import pytest

from arm_dynamics import Dynamics
from arm_dynamics.actuation.command_map import CommandMap
from arm_dynamics.codegen.kernel import Kernel
from arm_dynamics.codegen.one_at_a_time import is_building, one_at_a_time
from arm_dynamics.control import compiled_law, make_controller, preparation
from arm_dynamics.ros.dynamics.compiled_services import code_of
from arm_dynamics.terms.evaluator import MANY
from arm_dynamics.terms.table import INVERSE
from arm_sim import Simulator

ARM = Dynamics("double_pendulum")
COMPENSATED = Dynamics(
    ARM.model.scene.model_dump(exclude_unset=True) | {"commands": {"gravity_compensated": True}}
)


@cache
def sim() -> Simulator:
    return Simulator("double_pendulum")


BUILDS: dict[str, Callable[[], object]] = {
    "simulator": lambda: Simulator("double_pendulum"),
    "controller": lambda: preparation(make_controller("computed_torque", Dynamics(ARM.model)))(),
    "service": lambda: code_of((INVERSE,), ARM),
    "batches": lambda: ARM.inverse(*np.zeros((3, MANY, 2))),
    "commands": lambda: CommandMap(COMPENSATED.model), "servo": lambda: sim().arm.compiled.servo,
    "plan": lambda: sim().plan, "derivatives": lambda: sim().arm.compiled.derivatives.linearizer(),
    "rollouts": lambda: sim().arm.compiled.rollouts,
}  # fmt: skip


@pytest.mark.parametrize("name", BUILDS)
def test_a_thread_waits_for_another_that_builds(name: str) -> None:
    begun, end, done = Event(), Event(), list[str]()
    sim()  # so that not it, but what is asked of it, waits

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


def compile_after(command: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile after a command of the shell, with an empty cache."""
    compiler = folder / "cc"
    compiler.write_text(
        f'#!/bin/sh\ncase $1 in --version) exec cc $1;; esac\n{command}\nexec cc "$@"\n'
    )
    compiler.chmod(0o755)
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    monkeypatch.setenv("CC", str(compiler))


def test_a_thread_builds_while_another_waits_for_the_compiler(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first thread's compiler waits for a file that comes when the second has built."""
    built = tmp_path / "built"
    wait = f"timeout 30 sh -c 'until [ -e {built} ]; do sleep 0.01; done'"
    compile_after(f"touch {tmp_path}/waits; {wait}", tmp_path, monkeypatch)
    found = list[bool]()

    @one_at_a_time
    def compile_slowly() -> None:
        x = ca.SX.sym("x")
        Kernel([ca.Function("g", [x], [x + 2.0])], "native")
        found.append(is_building())

    @one_at_a_time
    def build() -> None:
        Kernel([ca.Function("h", [ca.SX.sym("x")], [ca.SX(1.0)])], "vm")
        built.touch()

    threads = Thread(target=compile_slowly), Thread(target=build)
    threads[0].start()
    while not (tmp_path / "waits").exists():
        assert threads[0].is_alive()
        sleep(0.01)
    threads[1].start()
    threads[1].join(20.0)
    came = built.exists()
    built.touch()
    threads[0].join(60.0)
    assert came
    assert found == [True]  # it is the first thread's turn again after its compiler


def test_what_is_built_is_found_while_another_thread_builds() -> None:
    begun, end = Event(), Event()
    thread = Thread(target=one_at_a_time(lambda: (begun.set(), end.wait(30.0))))
    control = make_controller("computed_torque", ARM)
    lookups = [
        lambda: compiled_law.build(control.law, ARM.model),
        lambda: sim().arm.compiled.derivatives.linearizer(),
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
