# SPDX-License-Identifier: Apache-2.0
"""The real-time loop, mostly with a simulated clock; durations, round trips; how old commands are,
and when orders act in ticks by the clock.
"""

import threading
import time
from ctypes import addressof, byref
from typing import Any

import numpy as np
import pytest
from harness import Ros
from polled import each
from sim_by_hand import NAMES, by_hand, command, commands_to_come

from arm_sim.ros.node_library import library
from arm_sim.ros.timing.histogram import Histogram
from arm_sim.ros.timing.realtime_loop import Due, RealtimeLoop
from arm_sim.ros.timing.round_trip import RoundTrip

pytestmark = pytest.mark.ros


def run(loop: RealtimeLoop, ticks: int) -> None:
    """At least so many ticks."""
    loop.start()
    while loop.report().ticks < ticks:
        time.sleep(1e-3)
    loop.stop()


def test_ticks_at_its_rate() -> None:
    ticks: list[tuple[int, int]] = []
    note = lambda: ticks.append((loop.current.value, time.monotonic_ns()))  # noqa: E731
    loop = RealtimeLoop(each(note), 1e-3, longest_lag=60.0)
    began = time.monotonic_ns()
    run(loop, 200)
    report, (due, at) = loop.report(), np.array(ticks).T
    assert report.ticks == len(ticks)
    assert due[0] >= began and (np.diff(due) == 1_000_000).all()
    assert (at >= due).all()
    assert report.rate == pytest.approx(report.ticks / report.elapsed)
    assert 0.0 <= report.lateness.p50 <= report.lateness.p99 <= report.lateness.max


class Clock:
    """Time that passes only when somebody sleeps."""

    def __init__(self) -> None:
        self.now = 10**9

    def monotonic_ns(self) -> int:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += round(1e9 * seconds)


def late_once(
    period: int, long: int, count: int, **options: Any
) -> tuple[RealtimeLoop, list[float]]:
    """A loop whose tenth tick takes long; it, and when its ticks began, all times in [ms]."""
    clock, began = Clock(), list[float]()
    start = clock.now

    def tick() -> None:
        began.append((clock.now - start) / 1e6)
        clock.sleep(1e-3 * long if len(began) == 10 else 0.0)
        if len(began) == count:
            loop.stop()

    loop = RealtimeLoop(each(tick, clock), 1e-3 * period, clock=clock, **options)
    loop.start()
    while len(began) < count:
        time.sleep(1e-3)
    loop.stop()
    return loop, began


def test_makes_up_for_a_long_tick_without_hurry() -> None:
    loop, began = late_once(2, 50, 100, spacing=0.5)
    on_time = [2.0 * k for k in range(100)]
    assert began == on_time[:10] + [max(68.0 + k, on_time[10 + k]) for k in range(90)]
    report = loop.report()
    assert (report.ticks, report.missed, report.dropped) == (100, 46, 0)
    assert report.lateness.max == pytest.approx(48e-3)
    assert report.elapsed == pytest.approx(198e-3)
    assert report.rate == pytest.approx(100 / 198e-3)


def test_gives_up_deadlines_when_too_far_behind() -> None:
    """At most 50 ms behind: of 98 ms, 24 deadlines are dropped."""
    loop, began = late_once(2, 100, 40, longest_lag=0.05, spacing=0.2)
    assert loop.report().dropped == 24
    assert began[9:12] == pytest.approx([18.0, 118.0, 118.4])
    assert np.diff(began[10:]) == pytest.approx(np.full(29, 0.4))


@pytest.mark.parametrize(("overrun", "next_one"), [("skip", 80.0), ("slow_down", 81.0)])
def test_the_next_tick_is_on_the_grid_or_a_period_after_the_late_one(
    overrun: str, next_one: float
) -> None:
    """Late by less than a period, or by just one, it leaves nothing out."""
    grid = [4.0 * k for k in range(20)]
    loop, began = late_once(4, 41, 20, overrun=overrun)
    assert began == grid[:10] + [77.0] + [next_one + 4.0 * k for k in range(9)]
    assert (loop.report().missed, loop.report().dropped) == (1, 9)
    for long in (7, 8):
        loop, began = late_once(4, long, 20, overrun=overrun)
        assert began == [*grid[:10], 36.0 + long, *grid[11:]]
        assert (loop.report().missed, loop.report().dropped) == (0, 0)


def test_its_thread_prepares_and_ends_with_the_last_tick() -> None:
    names = list[str]()
    note = lambda: names.append(threading.current_thread().name)  # noqa: E731
    loop = RealtimeLoop(each(lambda: time.sleep(0.02)), 1e-3, prepare=note)
    loop.stop()  # before it has started
    run(loop, 2)
    ticks = loop.report().ticks
    time.sleep(0.03)
    assert loop.report().ticks == ticks
    assert names == ["realtime_loop"]
    assert all(thread.name != "realtime_loop" for thread in threading.enumerate())
    loop = RealtimeLoop(each(lambda: loop.stop()), 1e-3)
    run(loop, 1)
    assert loop.report().ticks == 1


def test_histogram_is_exact_to_the_microsecond(rng: np.random.Generator) -> None:
    values = rng.integers(0, 15_000_000, 4000)
    histogram = Histogram()
    for value in values:
        library().histogram_count(byref(histogram), int(value))
    summary = histogram.percentiles()
    assert summary.count == 4000
    assert summary.p50 == pytest.approx(1e-9 * np.percentile(values, 50), abs=1e-5)
    assert summary.p99 == pytest.approx(1e-9 * np.percentile(values, 99), abs=1e-5)
    assert summary.max == 1e-9 * values.max()


def test_a_duration_lies_between_the_edges_of_its_bar() -> None:
    """Which is a microsecond wide below 20 ms; the last one also has what is beyond it."""
    for duration in (0.0200005, 0.1, 1000.0):
        histogram = Histogram()
        assert histogram.bars() == ()
        library().histogram_count(byref(histogram), round(1e9 * duration))
        ((edge, count),) = histogram.bars()
        assert count == 1
        assert edge / 2 ** (1 / 32) <= duration * (1 + 1e-9) <= edge * (1 + 2e-9)
    histogram = Histogram()
    for nanoseconds in (0, 999, 1000, 19_999_999, 10**13):
        library().histogram_count(byref(histogram), nanoseconds)
    edges, counts = zip(*histogram.bars(), strict=True)
    assert edges == pytest.approx((1e-6, 2e-6, 20e-3, 0.02 * 2**16))
    assert counts == (2, 1, 1, 1)


def test_the_first_answer_to_a_state_counts() -> None:
    trip = RoundTrip()
    began = time.time_ns()
    for stamp in range(300):
        library().trip_register_state(byref(trip), stamp)
    assert trip.newest == 299
    now = time.time_ns()
    trip.register_answer(299, now)
    trip.register_answer(299, now + 10**12)  # once more
    trip.register_answer(300, now + 10**12)  # to no state
    trip.register_answer(0, now + 10**12)  # to one that is forgotten
    assert trip.histogram.percentiles().count == 1
    assert trip.histogram.percentiles().max <= 1e-9 * (now - began)
    trip.reset()
    assert trip.histogram.percentiles().count == 0
    trip.register_answer(44, now)  # the oldest that is remembered
    assert trip.histogram.percentiles().count == 1


def test_an_answer_acts_until_the_next_one_comes() -> None:
    """In the time of the states, whether the loop catches up or a partner does not answer."""
    trip, ms = RoundTrip(), 1_000_000
    for stamp in range(ms, 102 * ms, ms):
        library().trip_register_state(byref(trip), stamp)
        if stamp // ms in (1, 2, 42):
            trip.register_answer(stamp, 0)
    trip.register_answer(100 * ms, 0)
    assert trip.take_oldest() == pytest.approx(0.059), "that of 42 ms, when there was one of 101"
    assert trip.take_oldest() == 0.0
    trip.forget()
    trip.register_answer(101 * ms, 0)
    trip.register_answer(1, 0)  # of another clock
    library().trip_register_state(byref(trip), 202 * ms)
    trip.register_answer(202 * ms, 0)
    assert trip.take_oldest() == 0.0


class Clocked:
    """A node by hand, whose ticks are made by the clock while messages wait."""

    def __init__(self, ros: Ros, **due: int) -> None:
        self.node = by_hand(ros, command_timeout=5e-3)
        self.lateness = Histogram()
        self.due = Due(lateness=addressof(self.lateness), **due)
        self.commands = commands_to_come(self.node)

    def ticks(self, count: int) -> None:
        """As many ticks, in one call."""
        engine, ended = self.node.engine, self.node.simulator.arm.step_count + count

        def end() -> None:
            self.due.ended = self.node.simulator.arm.step_count == ended

        engine.on.tick[:], self.due.ended = [end], 0
        engine.run(library().ticks_by_the_clock, byref(self.due))
        assert not engine.failure


def test_commands_age_in_part_while_ticks_are_made_up_for(ros: Ros) -> None:
    """Long behind, ticks of a second follow at once: they take next to no time."""
    clocked = Clocked(
        ros, deadline=time.monotonic_ns() - 1000 * 10**9, period=10**9, longest_lag=10_000 * 10**9
    )
    engine = clocked.node.engine
    clocked.commands.append(command(name=NAMES, effort=[0.1, 0.1]))
    heard = engine.arbiter.now
    clocked.ticks(50)
    assert 1.0 <= engine.commands.age < 2.0, "the first one counts in full"
    assert 1.0 <= engine.arbiter.now - heard < 2.0


def test_an_order_waits_for_no_more_than_the_tick_under_way(ros: Ros) -> None:
    clocked, served = Clocked(ros), list[int]()
    queue, arm = clocked.node.engine.queue, clocked.node.simulator.arm
    queue.is_served = True
    clocked.ticks(3)
    queue.post(lambda: served.append(arm.step_count))
    clocked.ticks(3)
    assert served == [3] and arm.step_count == 6
