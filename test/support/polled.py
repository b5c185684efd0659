# SPDX-License-Identifier: Apache-2.0
"""Commands from a function or a list, in place of the middleware; loops that tick in Python."""

import time
from collections import deque
from collections.abc import Callable, Iterable
from ctypes import CFUNCTYPE, byref, c_int64, c_void_p, cast
from typing import Any

from arm_dynamics.ros.joint_state import FAILED, NONE
from arm_sim.ros.inputs.inputs import Inputs
from arm_sim.ros.inputs.polled_commands import MOST_MESSAGES
from arm_sim.ros.node_library import library
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.ros.timing.realtime_loop import Due


def polled(engine: TickEngine, read: Callable[[], object]) -> None:
    """Call ``read`` before each tick, when messages would be taken."""
    ticks = engine.ticks
    ticks.taken_by_test = CFUNCTYPE(c_int64, c_void_p, c_void_p)(lambda *_: FAILED)
    ticks.take, ticks.most_messages = cast(ticks.taken_by_test, c_void_p).value, 1
    ticks.answer(read=read)


def offered(
    inputs: Inputs, engine: TickEngine, messages: Iterable[bytes] = (), arrival: int = 0
) -> deque[bytes]:
    """Let C take these messages, and those that are added later; they arrive then, in [ns]."""
    waiting, ticks, reader = deque(messages), engine.ticks, inputs.reader.efforts

    def take(*_: object) -> int:
        if not waiting:
            return NONE
        raw = waiting.popleft()
        outcome = reader._read(raw, len(raw))
        reader._state.arrival = arrival
        reader._state.raw, reader._state.length = cast(raw, c_void_p).value, len(raw)
        ticks.kept_by_test = raw
        return int(outcome)

    ticks.taken_by_test = CFUNCTYPE(c_int64, c_void_p, c_void_p)(take)
    ticks.take = cast(ticks.taken_by_test, c_void_p).value
    ticks.most_messages, ticks.reader = MOST_MESSAGES, reader.addresses[1]
    return waiting


def each(tick: Callable[[], object], clock: Any = time) -> Callable[[Due], None]:
    """Waits for a tick by a clock, begins it, and calls a function."""

    def run(due: Due) -> None:
        begin, now = library().due_next_start(byref(due)), clock.monotonic_ns()
        if now < begin:
            clock.sleep(1e-9 * (begin - now))
        library().due_begin_tick(byref(due), clock.monotonic_ns())
        tick()

    return run
