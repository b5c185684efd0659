# SPDX-License-Identifier: Apache-2.0
"""The life of a process with one node: its start, what ends it, and its exit status."""

import gc
import logging
import signal
import sys
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from arm_dynamics.exceptions import ArmError, InvalidInput, did_you_mean, known_names, plain
from arm_dynamics.logs import heard_by
from arm_dynamics.ros.common.command_line import asks_for_help, reason, split_words, usage
from arm_dynamics.ros.common.executor import spin
from arm_dynamics.ros.common.threads.scheduling import arrange_middleware_threads
from arm_dynamics.ros.common.transport import avoid_shared_memory

_FREEZE = "freeze_garbage"  # a parameter of nodes that keep deadlines


def execute(
    kind: type[Node], params: type, args: Sequence[str] | None = None, **options: Any
) -> int:
    """Run a node as an executable: ``NAME [SCENE] [--ros-args …]``, or print its ``--help``.

    Args:
        kind: The node's class.
        params: The dataclass of its parameters.
        args: Command line without the program's name; None for that of the process.
        **options: For the constructor of the node.

    Returns:
        The exit status, see ``run``.
    """
    words = tuple(sys.argv[1:] if args is None else args)
    if asks_for_help(words):
        print(usage(kind, params))
        return 0
    try:
        scene, rest = split_words(words)
    except InvalidInput as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    overrides = [Parameter("scene", value=scene)] if scene else []
    return run(
        lambda **others: kind(parameter_overrides=overrides, **options, **others), list(rest)
    )


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
    make_node: Callable[..., Node], args: list[str] | None = None,
    is_done: Callable[[], bool] = lambda: False,
) -> int:  # fmt: skip
    """Run one node in this process: start, spin until SIGINT, SIGTERM or ``is_done``, clean up.

    The signals interrupt what builds the node, compilers included. Later they only request the
    end, so that the node is destroyed while ROS still works.

    Returns:
        0 after a clean end, also before the node was built; 2 when it could not start, with the
        reason on stderr.
    """
    signals: list[int] = []  # received
    sys.setswitchinterval(5e-5)  # [s] for which other threads may block the loop, instead of 5e-3

    def interrupt(number: int, _: Any) -> None:
        signals.append(number)
        _handle_signals(lambda later, _: signals.append(later))
        raise KeyboardInterrupt

    _handle_signals(interrupt)
    context = Context()
    node: Any = None
    try:
        _start_ros(context, args)
        node = make_node(context=context)
        _handle_signals(lambda number, _: signals.append(number))
        _warn_of_unknown(node)
        arrange_middleware_threads()
        if node.has_parameter(_FREEZE) and node.get_parameter(_FREEZE).value:
            gc.collect()
            gc.freeze()
        with heard_by(NodeHandler(node)):
            spin(node, lambda: bool(signals) or is_done())
    except BaseException as error:
        if signals and (node is None or isinstance(error, KeyboardInterrupt)):
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


def _start_ros(context: Context, args: list[str] | None) -> None:
    avoid_shared_memory()
    try:
        rclpy.init(args=args, context=context, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise InvalidInput(f"ROS cannot start: {reason(error)}") from error


def _handle_signals(handler: Callable[[int, Any], object]) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handler)


def _warn_of_unknown(node: Node) -> None:
    """Warn of parameters that the node does not have, which ROS ignores.

    Those with dots may be declared later: for joints that are not known yet.
    """
    overrides = [name for name in node._parameter_overrides if "." not in name]  # no public API
    declared = [name for name in node._parameters if "." not in name]
    for name in overrides:
        if name not in declared:
            node.get_logger().warning(
                f"this node has no parameter '{plain(name, 80)}', which is ignored"
                f"{did_you_mean(name, declared) or ';'} allowed: {known_names(declared, 100)}"
            )
