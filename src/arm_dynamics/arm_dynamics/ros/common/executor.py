# SPDX-License-Identifier: Apache-2.0
"""The fastest executor available, and its timers."""

import time
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

_PROBE_TIMEOUT = 0.5  # [s]
_SPIN_TIMEOUT = 0.25  # [s] between checks whether to end, without events


def make_executor(node: Node) -> Executor:
    """Give a node the events executor if it dispatches, else the single-threaded one.

    The events executor takes a tenth of the processor time, but its ``spin`` dispatches nothing in
    some releases; drive either by ``spin_once``.
    """
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        pass
    else:
        events = EventsExecutor(context=node.context)
        events.add_node(node)
        if _dispatches(events, node):
            return events
        events.remove_node(node)
        events.shutdown()
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    return executor


def _dispatches(executor: Executor, node: Node) -> bool:
    """Test whether a timer of the node is called."""
    calls: list[bool] = []
    timer = steady_timer(node, 0.001, lambda: calls.append(True))
    end = time.monotonic() + _PROBE_TIMEOUT
    try:
        # More than once: a pending request is handled first.
        while not calls and (left := end - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=left)
    finally:
        node.destroy_timer(timer)
    return bool(calls)


def spin(node: Node, is_done: Callable[[], bool]) -> None:
    """Run a node's callbacks until ``is_done``, or until its context is shut down."""
    executor = make_executor(node)
    try:
        while node.context.ok() and not is_done():
            executor.spin_once(timeout_sec=_SPIN_TIMEOUT)
    except ExternalShutdownException:
        pass
    finally:
        executor.remove_node(node)  # before the objects of its callbacks are gone
        executor.shutdown()


def steady_timer(node: Node, period: float, callback: Callable[[], None]) -> Any:
    """A timer on the steady clock, period in [s]; ROS timers stop when simulated time does."""
    return node.create_timer(period, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))
