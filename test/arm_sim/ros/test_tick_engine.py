# SPDX-License-Identifier: Apache-2.0
"""The tick engine without ROS: commands, requests, wrenches, energy, and its queue."""

import gc
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from threading import Event, Thread, current_thread
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from polled import polled

import models
from arm_dynamics import InvalidInput
from arm_dynamics.task_space import TaskSpace
from arm_sim import Simulator
from arm_sim.ros.node_library import library
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.ros.tick_queue import TickQueue
from arm_sim.servo import JointCommand

TAU = (1.5, -0.5)
BOTH = frozenset({0, 1})


def engine(
    wrench_timeout: float = 0.1, reference: str = "local", method: str | None = None, **more: Any
) -> TickEngine:
    """A two-link arm; its simulator is its own, for what changes the model."""
    simulator = Simulator(models.scene("two_link"), method)
    return TickEngine(simulator, wrench_timeout=wrench_timeout, wrench_reference=reference, **more)


def ticks(made: TickEngine, count: int) -> None:
    for _ in range(count):
        made.tick()


def acting(made: TickEngine) -> list[float]:
    made.tick()
    return made.simulator.effort.tolist()


def test_stamps_are_whole_milliseconds() -> None:
    """From the counter and rounded: cutting off digits is wrong first at tick 1025."""
    made = engine()
    for count in range(1, 1100):
        made.tick()
        assert made.stamp == count * 1_000_000


@pytest.mark.parametrize(("timeout", "acts"), [(1e-5, 1), (2e-3, 2), (2.6e-3, 3)])
def test_a_command_acts_for_its_timeout_and_for_a_tick_at_least(timeout: float, acts: int) -> None:
    made = engine()
    made.configure(timeout, "zero")
    made.commands.put(TAU)
    assert [acting(made) == [*TAU] for _ in range(5)] == [k < acts for k in range(5)]


@pytest.mark.parametrize("late", [2, 900])
def test_commands_that_have_arrived_are_in_time_though_they_are_read_late(late: int) -> None:
    """As many ticks as the middleware, for want of a processor, does not hand anything over."""
    made, told = engine(), list[bool]()
    made.configure(0.003, "zero")
    made.on.staleness.append(lambda: told.append(made.commands.stale))
    arrives = iter(range(1, 10**6))

    def all_read() -> bool:
        return made.simulator.arm.step_count % (late + 1) == 0

    polled(made, lambda: all_read() and made.commands.put((float(next(arrives)), 0.5)))
    made.arriving = lambda: not all_read()
    assert all(acting(made)[1] == 0.5 for _ in range(3 * (late + 1)))
    assert told == []
    assert made.commands.extended == 3 * max(late + 1 - 3, 0)


def test_commands_that_stop_are_stale_though_the_middleware_is_busy() -> None:
    """For a second: it may be busy with other messages."""
    made = engine()
    made.configure(0.003, "zero")
    made.arriving = lambda: True
    made.commands.put(TAU)
    acts = [acting(made) == [*TAU] for _ in range(1010)]
    assert acts == [k < 1003 for k in range(1010)]
    assert made.commands.stale_count == 1
    made.commands.put((0.25, 0.5))
    assert acting(made) == [0.25, 0.5]


def test_what_arrives_while_the_middleware_is_looked_at_is_read() -> None:
    made, waiting = engine(), [TAU]
    made.configure(0.003, "zero")

    def look() -> bool:
        waiting.append((0.25, 0.5))
        return False  # it sleeps again: everything can be read

    def read() -> None:
        while waiting:
            made.commands.put(waiting.pop(0))

    made.arriving = look
    polled(made, read)
    assert [acting(made) for _ in range(4)] == [[*TAU]] * 3 + [[0.25, 0.5]]
    assert made.commands.stale_count == made.commands.extended == 0


@pytest.mark.parametrize(("timeout", "patience"), [(0.005, 1000), (3.0, 3000)])
def test_a_silent_source_keeps_its_joints_for_a_second_or_the_timeout(
    timeout: float, patience: int
) -> None:
    made = engine(paused=True)
    made.configure(timeout, "zero")
    for _ in range(20):
        made.arbiter.admit("one", BOTH)
    ticks(made, patience)
    with pytest.raises(InvalidInput, match="'two' is refused"):
        made.arbiter.admit("two", BOTH)
    made.tick()
    made.arbiter.admit("two", BOTH)


def test_reset_goes_back_and_forgets_commands_sources_and_wrenches() -> None:
    made = engine(wrench_timeout=10.0)
    made.configure(0.0, "hold")
    for _ in range(20):
        made.arbiter.admit("one", BOTH)
    made.commands.put(TAU)
    made.push("tip", [0.0, 0.0, 9.0, 0.0, 0.0, 0.0])
    ticks(made, 5)
    assert made.arbiter.sources == ("one",)
    made.reset()
    assert made.arbiter.sources == ()
    made.arbiter.admit("two", BOTH)  # nothing is kept for the stream of before
    assert made.wrenches.active == ()
    assert made.simulator.arm.step_count == 0
    ticks(made, 5)
    free = models.simulator("two_link")
    for _ in range(5):
        free.step([0.0, 0.0])
    np.testing.assert_array_equal(made.simulator.state.q, free.state.q)


def test_steps_do_not_age_the_command_and_need_a_pause_where_something_else_ticks() -> None:
    made = engine(self_running=True)
    made.configure(0.002, "zero")
    with pytest.raises(InvalidInput, match="allowed only while it is paused"):
        made.step(1)
    made.pause(True)
    polled(made, lambda: made.commands.put(TAU))
    made.step(50)
    assert made.simulator.arm.step_count == 50
    assert made.simulator.effort.tolist() == [*TAU]
    polled(made, lambda: None)
    made.pause(False)
    assert [acting(made) == [*TAU] for _ in range(3)] == [True, True, False]
    by_hand = engine()
    by_hand.step(3)
    assert by_hand.simulator.arm.step_count == 3


@pytest.mark.parametrize(("policy", "begun"), [("brake", 1), ("servo", 1), ("gravity", 0)])
def test_servos_that_may_have_to_stop_the_arm_are_built_while_it_moves(
    policy: str, begun: int
) -> None:
    started = list[Any]()
    background = SimpleNamespace(
        busy=False, deliver=lambda: None, start=lambda job, then: started.append(job)
    )
    made = engine(background=background)
    made.configure(0.0, policy)
    made.commands.put(TAU)
    ticks(made, 3)
    assert len(started) == begun
    assert made.simulator.effort.tolist() == [*TAU]
    made.commands.put(JointCommand(position=[0.0, 0.0]))
    made.tick()
    assert not made.simulator.state.v.any(), "brakes hold it until they are built"


def test_releasing_time_forgets_the_failure_and_stopping_it_does_not() -> None:
    made = engine()
    polled(made, lambda: 1 / 0)
    made.run(library().ticks_tick)
    assert made.paused
    assert "ZeroDivisionError" in made.failure
    made.pause(True)
    assert made.failure
    made.pause(False)
    assert not made.failure


UP, ALONG = np.array([0.0, 0.0, 5.0, 0.0, 1.0, 0.0]), np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.5])


@pytest.mark.parametrize("axes", ["local", "local_world_aligned"])
def test_wrenches_of_different_frames_add_up_and_the_newest_on_a_frame_counts(axes: str) -> None:
    """As torques by the transposed Jacobian, which are no motor's."""
    made, sim = engine(wrench_timeout=0.005, reference=axes), models.simulator("two_link")
    jacobians = {f: TaskSpace(sim.dynamics, f, axes).jacobian for f in ("tip", "forearm")}
    for tick in range(12):
        if tick == 2:
            made.push("tip", ALONG)
            made.push("tip", UP)
            made.push("forearm", ALONG)
            assert set(made.wrenches.active) == {"tip", "forearm"}
        if tick == 5:
            made.push("tip", ALONG)
        tau, q = np.zeros(2), sim.state.q
        if 2 <= tick < 10:
            tau += jacobians["tip"](q).T @ (UP if tick < 5 else ALONG)
        if 2 <= tick < 7:
            tau += jacobians["forearm"](q).T @ ALONG
        made.tick()
        sim.step(tau)
    assert made.wrenches.active == ()
    np.testing.assert_allclose(made.simulator.state.q, sim.state.q, rtol=0.0, atol=1e-12)
    assert not made.simulator.effort.any()


@contextmanager
def asked(queue: TickQueue, action: Callable[[], Any]) -> Iterator[Future[Any]]:
    """What another thread is answered that lets an action be run."""
    queue.is_served = True
    with ThreadPoolExecutor(1) as pool:
        yield pool.submit(queue.run, action)


def test_the_thread_that_ticks_runs_what_others_ask_for() -> None:
    """And what is raised there is raised where it was asked for."""
    made, error = engine(), TimeoutError("no answer")
    failing = Mock(side_effect=error)
    with asked(made.queue, current_thread) as thread, asked(made.queue, failing) as other:
        while not (thread.done() and other.done()):
            made.tick()
    assert thread.result() is current_thread()
    assert other.exception() is error


def test_what_was_not_run_in_time_is_never_run() -> None:
    queue, done = TickQueue(timeout=0.05), list[int]()
    with asked(queue, lambda: done.append(1)) as answer:
        with pytest.raises(InvalidInput, match="did not respond in 0.05 s"):
            answer.result()
        queue.serve()
    assert done == []


def test_what_is_being_run_is_not_said_to_be_discarded() -> None:
    queue, begun, end = TickQueue(timeout=0.2), Event(), Event()
    with asked(queue, lambda: begun.set() or end.wait()) as answer:
        serving = Thread(target=lambda: [queue.serve() for _ in iter(begun.is_set, True)])
        serving.start()
        with pytest.raises(InvalidInput, match="after 0.2 s it is still being done"):
            answer.result()
        end.set()
        serving.join()


def test_a_refused_order_leaves_no_memory_to_the_garbage_collector() -> None:
    queue, held = TickQueue(), list[weakref.ref[Any]]()

    def refused() -> None:
        large = np.zeros(10)
        held.append(weakref.ref(large))
        raise InvalidInput(f"{large} is refused")

    def ask() -> None:
        with suppress(InvalidInput):
            queue.run(refused)

    queue.is_served = True
    gc.disable()
    try:
        thread = Thread(target=ask)
        thread.start()
        while thread.is_alive():
            queue.serve()
        assert held[0]() is None
    finally:
        gc.enable()
