# SPDX-License-Identifier: Apache-2.0
"""Threads build expressions in turn, whatever of the suite they build; CasADi would crash."""

from pathlib import Path
from threading import Event, Thread
from time import sleep

import casadi as ca
import pytest

from arm_dynamics import Dynamics
from arm_dynamics.codegen.kernel import Kernel
from arm_dynamics.codegen.one_at_a_time import is_building, one_at_a_time
from arm_dynamics.control import compiled_law, make_controller
from arm_sim import Simulator


def test_a_thread_waits_for_another_that_builds() -> None:
    begun, end, done = Event(), Event(), Event()

    @one_at_a_time
    def build_for_long() -> None:
        begun.set()
        end.wait(30.0)

    def build() -> None:
        Simulator("double_pendulum")
        done.set()

    first, second = Thread(target=build_for_long), Thread(target=build)
    first.start()
    assert begun.wait(10.0)
    second.start()
    waited = not done.wait(0.1)
    end.set()
    second.join(60.0)
    first.join(10.0)
    assert waited and done.is_set()


def test_a_thread_builds_while_another_waits_for_the_compiler(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first thread's compiler waits for a file that comes when the second has built."""
    built, compiler, found = tmp_path / "built", tmp_path / "cc", list[bool]()
    compiler.write_text(f"""#!/bin/sh
case $1 in --version) exec cc $1;; esac
touch {tmp_path}/waits
timeout 30 sh -c 'until [ -e {built} ]; do sleep 0.01; done'
exec cc "$@"
""")
    compiler.chmod(0o755)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("CC", str(compiler))

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
    arm, sim = Dynamics("double_pendulum"), Simulator("double_pendulum")
    control = make_controller("computed_torque", arm)
    lookups = [
        lambda: compiled_law.build(control.law, arm.model),
        lambda: sim.arm.compiled.derivatives.linearizer(),
    ]
    built = [lookup() for lookup in lookups]
    thread.start()
    assert begun.wait(10.0)
    found = [lookup() for lookup in lookups]  # would wait for half a minute
    still_building = thread.is_alive()
    end.set()
    thread.join(10.0)
    assert still_building
    assert [id(each) for each in found] == [id(each) for each in built]
