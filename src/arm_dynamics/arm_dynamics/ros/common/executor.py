# SPDX-License-Identifier: Apache-2.0
"""The fastest executor available, and the life cycle of a process with one node."""

from __future__ import annotations

import logging
import re
import signal
import sys
import time
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from arm_dynamics.exceptions import ArmError, InvalidInput, choices, plain
from arm_dynamics.logs import Throttled, heard_by
from arm_dynamics.ros.common.background import take_short_turns
from arm_dynamics.ros.common.privileges import arrange_middleware_threads, freeze_garbage
from arm_dynamics.ros.common.transport import avoid_shared_memory
from arm_dynamics.ros.interfaces import Topic

FREEZE = "freeze_garbage"  # a parameter of nodes that keep deadlines
_PROBE_TIMEOUT = 0.5  # [s]
_SPIN_TIMEOUT = 0.25  # [s] between checks whether to end, without events


def make_executor(node: Node) -> Executor:
    """Give a node the events executor if it dispatches, else the single-threaded one.

    The events executor takes a tenth of the processor time, but its ``spin`` dispatches nothing in
    some releases; drive either by ``spin_once``.

    Args:
        node: The node to be spun; it is added.
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
    called: list[bool] = []
    timer = steady_timer(node, 0.001, lambda: called.append(True))
    end = time.monotonic() + _PROBE_TIMEOUT
    try:
        # More than once: a pending request is handled first.
        while not called and (left := end - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=left)
    finally:
        node.destroy_timer(timer)
    return bool(called)


def spin(node: Node, done: Callable[[], bool]) -> None:
    """Run a node's callbacks until ``done``, or until its context is shut down."""
    executor = make_executor(node)
    try:
        while node.context.ok() and not done():
            executor.spin_once(timeout_sec=_SPIN_TIMEOUT)
    except ExternalShutdownException:
        pass
    finally:
        executor.remove_node(node)  # before the objects of its callbacks are gone
        executor.shutdown()


def steady_timer(node: Node, period: float, callback: Callable[[], None]) -> Any:
    """A timer on the steady clock, period in [s]; ROS timers stop when simulated time does."""
    return node.create_timer(period, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))


def guarded(node: Node, callback: Callable[[Any], Any]) -> Callable[[Any], None]:
    """A callback for messages whose exceptions are logged and do not end the node."""
    log = Throttled(node.get_logger())

    def called(message: Any) -> None:
        try:
            callback(message)
        except Exception as error:
            log.error(plain(f"a message was ignored after an unexpected failure: {error!r}"))

    return called


def subscribe(node: Node, topic: Topic, callback: Callable[[Any], Any], raw: bool = False) -> Any:
    """Subscribe by a callback that is ``guarded``."""
    called = guarded(node, callback)
    return node.create_subscription(topic.type, topic.name, called, topic.subscribe, raw=raw)


class NodeHandler(logging.Handler):
    """Passes log records to a node's logger, as information or as warnings."""

    def __init__(self, node: Node) -> None:
        super().__init__(logging.INFO)
        self._log = node.get_logger()

    def emit(self, record: logging.LogRecord) -> None:
        """Log a record; ROS needs a separate line of code for each severity."""
        if record.levelno >= logging.WARNING:
            self._log.warning(record.getMessage())
        else:
            self._log.info(record.getMessage())


def run(
    make_node: Callable[..., Node],
    args: list[str] | None = None,
    done: Callable[[], bool] = lambda: False,
) -> int:
    """Run one node in this process: start, spin until SIGINT or SIGTERM, clean up.

    The signals interrupt what builds the node, compilers included. Later they only request the
    end, so that the node is destroyed while ROS still works.

    Args:
        make_node: The node's class, called with ``context=``.
        args: ROS command line; None for that of the process.
        done: Called periodically; returns whether to end.

    Returns:
        0 after a clean end, also before the node was built; 2 when it could not start, with the
        reason on stderr.
    """
    asked: list[int] = []
    take_short_turns()

    def interrupt(number: int, _: Any) -> None:
        asked.append(number)
        _handle_signals(lambda received, _: asked.append(received))
        raise KeyboardInterrupt

    _handle_signals(interrupt)
    context = Context()
    node: Any = None
    try:
        avoid_shared_memory()
        try:
            off = SignalHandlerOptions.NO
            rclpy.init(args=args, context=context, signal_handler_options=off)
        except RuntimeError as error:
            raise InvalidInput(f"ROS cannot start: {_reason(error)}") from error
        node = make_node(context=context)
        _handle_signals(lambda received, _: asked.append(received))
        _warn_of_unknown(node)
        arrange_middleware_threads()
        if node.has_parameter(FREEZE) and node.get_parameter(FREEZE).value:
            freeze_garbage()
        with heard_by(NodeHandler(node)):
            spin(node, lambda: bool(asked) or done())
    except BaseException as error:
        if asked and node is None:
            return 0
        if not isinstance(error, ArmError | OSError):
            raise
        print(f"error: {error}", file=sys.stderr)
        return 2
    finally:
        if node is not None:
            node.destroy_node()
        context.try_shutdown()
    return 0


def _handle_signals(handler: Callable[[int, Any], object]) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handler)


def _warn_of_unknown(node: Node) -> None:
    """Warn of parameters that the node does not have, which ROS ignores.

    Those with dots may be declared later: for joints that are not known yet.
    """
    given = [name for name in node._parameter_overrides if "." not in name]  # no public API
    known = [name for name in node._parameters if "." not in name]
    for name in given:
        if name not in known:
            node.get_logger().warning(
                f"this node has no parameter '{plain(name, 80)}', which is ignored; "
                f"allowed: {choices(name, known, 100)}"
            )


def _reason(error: RuntimeError) -> str:
    """The error message of ROS without references to its source lines."""
    text = str(error).split(", at /")[0]
    rule = re.search(r"(?:override|remap) rule: ('.*?')\.|^\[(.*)\]$", text)
    if rule is None:
        return text
    return (
        f"{rule[1] or rule[2]} is no ROS argument; expected -p NAME:=VALUE, such as -p dt:=0.001, "
        "or -r NAME:=NEW, such as -r __ns:=/left"
    )
