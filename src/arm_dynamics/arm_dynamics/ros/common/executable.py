# SPDX-License-Identifier: Apache-2.0
"""Executables of the nodes: their command line, and the life of a process with one node."""

import gc
import inspect
import logging
import re
import signal
import sys
from collections.abc import Callable, Sequence
from textwrap import fill
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from arm_dynamics.exceptions import ArmError, InvalidInput, did_you_mean, known_names, plain
from arm_dynamics.logs import heard_by
from arm_dynamics.ros.common.executor import spin
from arm_dynamics.ros.common.params import listed
from arm_dynamics.ros.common.threads.scheduling import arrange_middleware_threads
from arm_dynamics.ros.common.transport import avoid_shared_memory

_ROS = "--ros-args"
_HELP = {"-h", "--help"}
_WIDTH = 98  # columns of the help
_FREEZE = "freeze_garbage"  # a parameter of nodes that keep deadlines
Words = tuple[str, ...]


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
    if _HELP & set(words[: _count_before_ros(words)]):
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


def split_words(words: Words) -> tuple[str | None, Words]:
    """Separate the scene from ROS arguments.

    Raises:
        InvalidInput: If a word is neither.
    """
    count = _count_before_ros(words)
    before = words[:count]
    for i, word in enumerate(before):
        if i or word.startswith("-") or ":=" in word:
            rule = next((plain(word, 80) for word in before if ":=" in word), "NAME:=VALUE")
            flag = "-r" if rule.startswith("__") or "-r" in before else "-p"
            rule = re.sub("^__ns:=(?!/)", "__ns:=/", rule)
            raise InvalidInput(
                f"'{plain(word, 80)}' is neither the scene nor behind {_ROS}; allowed: SCENE, "
                f"then for example {_ROS} {flag} {rule}"
            )
    return (before[0] if before else None), words[count:]


def _count_before_ros(words: Words) -> int:
    """Number of words before the ROS arguments."""
    return words.index(_ROS) if _ROS in words else len(words)


def usage(kind: type[Node], params: type) -> str:
    """Usage, description and parameters with their defaults."""
    name = kind.__name__.removesuffix("Node").lower()
    about = (inspect.getdoc(kind) or "").split("\n\nAttributes:")[0]
    lines = [
        f"usage: {name} [SCENE] [{_ROS} -p NAME:=VALUE … -r __ns:=/NAMESPACE …]",
        "",
        about,
        "",
        "SCENE is the name of a bundled scene such as panda, a scene file, a URDF, or a "
        "package:// URI;",
        "it sets the parameter 'scene'.",
        "",
        "parameters, with their defaults:",
    ]
    for parameter, default, descriptor in listed(params):
        allowed = f" [{', '.join(descriptor['choices'])}]" if descriptor.get("choices") else ""
        lines.append(f"  {parameter} = {default!r}")
        text = fill(descriptor["description"] + allowed, _WIDTH - 6)
        lines += [f"      {line}" for line in text.split("\n")]
    return "\n".join(lines)


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
    done: Callable[[], bool] = lambda: False,
) -> int:  # fmt: skip
    """Run one node in this process: start, spin until SIGINT, SIGTERM or ``done``, clean up.

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
            spin(node, lambda: bool(signals) or done())
    except BaseException as error:
        if signals and node is None:
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
        raise InvalidInput(f"ROS cannot start: {_reason(error)}") from error


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
