# SPDX-License-Identifier: Apache-2.0
"""What the pages use of the ros2 command line, which is on no registry, by rclpy.

Words, defaults and waiting are those of ros2cli (Jazzy): ``topic pub --once`` waits for a
subscriber, ``topic echo`` for a publisher, ``service call`` and ``action send_goal`` for a server.
Exit status 1 means that the command did not succeed.
"""

import os
import re
import signal
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import rclpy
import yaml
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

SRC = Path(__file__).parents[2] / "src"
PATIENCE = 30.0  # [s]
_interrupted: list[bool] = []


def loaded(name: str) -> Any:
    """An interface by its name, such as ``std_srvs/srv/Trigger``."""
    package, folder, word = name.split("/")
    return getattr(import_module(f"{package}.{folder}"), word)


def fill(message: Any, values: dict[str, Any]) -> Any:
    """Set fields of a message as YAML names them; each must exist and be of the field's type."""
    kinds = message.get_fields_and_field_types()
    for key, value in values.items():
        setattr(message, key, _value(kinds[key], getattr(message, key), value))
    return message


def _value(kind: str, inner: Any, value: Any) -> Any:
    if isinstance(value, dict):
        return fill(inner, value)
    element = re.sub(r"^sequence<(.*?)(?:, \d+)?>$|\[\d+\]$", r"\1", kind)
    if isinstance(value, list) and "/" in element:
        package, word = element.split("/")
        return [fill(loaded(f"{package}/msg/{word}")(), one) for one in value]
    if element in {"double", "float"}:
        return [float(x) for x in value] if isinstance(value, list) else float(value)
    return value


def spin(made: Node, seconds: float) -> None:
    """Spin once; Ctrl-C ends it between messages, since rclpy does not expect it within one."""
    rclpy.spin_once(made, timeout_sec=seconds)
    if _interrupted:
        raise KeyboardInterrupt


@contextmanager
def node() -> Iterator[Node]:
    """A node for a moment."""
    signal.signal(signal.SIGINT, lambda *_: _interrupted.append(True))
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    made = rclpy.create_node(f"_ros2cli_{os.getpid()}")
    try:
        yield made
    finally:
        made.destroy_node()
        rclpy.shutdown()


def wait(made: Node, done: Callable[[], Any], what: str) -> None:
    """Spin until something is there."""
    end = time.monotonic() + PATIENCE
    while not done():
        if time.monotonic() > end:
            sys.exit(f"ros2: {what} (waited {PATIENCE:g} s)")
        spin(made, 0.02)


def answer(made: Node, future: Any, what: str) -> Any:
    """What a future will hold."""
    wait(made, future.done, what)
    return future.result()


def run(words: Namespace) -> None:
    """Become an executable of a package, as its ``setup.py`` declares it."""
    text = (SRC / words.package / "setup.py").read_text()
    found = re.search(rf'"{words.executable} = ([\w.]+):(\w+)"', text)
    if not found:
        sys.exit(f"ros2: no executable {words.executable} in {words.package}")
    sys.argv = [words.executable, *words.rest]
    sys.exit(getattr(import_module(found[1]), found[2])())


def service_call(words: Namespace) -> None:
    """Print the response; its ``success`` is the exit status."""
    kind = loaded(words.type)
    with node() as made:
        client = made.create_client(kind, words.name)
        wait(made, client.service_is_ready, f"no service {words.name}")
        request = fill(kind.Request(), yaml.safe_load(words.values or "{}"))
        response = answer(made, client.call_async(request), f"{words.name} does not answer")
        print(f"requester: making request: {request}\n\nresponse:\n{response}")
    result = getattr(response, "result", None)  # of simulation_interfaces
    if not getattr(response, "success", True) or getattr(result, "result", 1) != 1:
        sys.exit(1)


def topic_pub(words: Namespace) -> None:
    """Publish once, when there is a subscriber, or until Ctrl-C."""
    with node() as made:
        message = fill(loaded(words.type)(), yaml.safe_load(words.values or "{}"))
        publisher = made.create_publisher(type(message), words.name, 10)
        wait(made, publisher.get_subscription_count, f"nobody listens to {words.name}")
        while True:
            publisher.publish(message)
            print(f"publishing: {message}", flush=True)
            if words.once:
                publisher.wait_for_all_acked()
                return
            spin(made, 0.0)
            time.sleep(1.0 / words.rate)


def topic_echo(words: Namespace) -> None:
    """Print messages until Ctrl-C."""
    with node() as made:
        wait(made, lambda: made.get_publishers_info_by_topic(words.name), f"no {words.name}")
        about = made.get_publishers_info_by_topic(words.name)[0]
        latched = about.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        quality = QoSProfile(
            depth=5, reliability=ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )  # fmt: skip
        heard: list[Any] = []
        made.create_subscription(loaded(about.topic_type), words.name, heard.append, quality)
        while True:
            wait(made, lambda: heard, f"nothing on {words.name}")
            print(heard.pop(0), "---", sep="\n", flush=True)
            if words.once:
                return


def action_send_goal(words: Namespace) -> None:
    """Print the result; exit status 1 unless the goal succeeded."""
    kind = loaded(words.type)
    with node() as made:
        client = ActionClient(made, kind, words.name)
        wait(made, client.server_is_ready, f"no action {words.name}")
        goal = fill(kind.Goal(), yaml.safe_load(words.values))
        hear = (lambda message: print("Feedback:", message.feedback)) if words.feedback else None
        handle = answer(made, client.send_goal_async(goal, hear), "the goal is not answered")
        if not handle.accepted:
            sys.exit("Goal was rejected.")
        done = answer(made, handle.get_result_async(), "the goal does not end")
        print(f"Result:\n{done.result}\nGoal finished with status: {done.status}")
        client.destroy()
    if done.status != 4:  # action_msgs/GoalStatus.STATUS_SUCCEEDED
        sys.exit(1)


def param(words: Namespace) -> None:
    """Set, get, list or describe parameters of a node."""
    with node() as made:
        client = AsyncParameterClient(made, words.node)
        wait(made, client.services_are_ready, f"no node {words.node}")
        late = f"{words.node} does not answer"
        if words.do == "list":
            print(*answer(made, client.list_parameters(), late).result.names, sep="\n")
        elif words.do == "describe":
            print(answer(made, client.describe_parameters([words.name]), late).descriptors[0])
        elif words.do == "get":
            print(answer(made, client.get_parameters([words.name]), late).values[0])
        else:
            value = rclpy.Parameter(words.name, value=yaml.safe_load(words.value))
            (result,) = answer(made, client.set_parameters([value]), late).results
            if not result.successful:
                sys.exit(f"Setting parameter failed: {result.reason}")
            print("Set parameter successful")


def node_list(_: Namespace) -> None:
    """Print names of nodes that were found in half a second."""
    with node() as made:
        end = time.monotonic() + 0.5
        wait(made, lambda: time.monotonic() > end, "")
        names = made.get_node_names_and_namespaces()
        print(*sorted(f"{space.rstrip('/')}/{name}" for name, space in names), sep="\n")


def understood() -> ArgumentParser:
    """The known words."""
    parser = ArgumentParser("ros2", allow_abbrev=False)
    groups = parser.add_subparsers(required=True)

    def add(group: Any, name: str, do: Callable[[Namespace], None], *names: str) -> ArgumentParser:
        made: ArgumentParser = group.add_parser(name, allow_abbrev=False)
        made.set_defaults(run=do)
        for each in names:
            made.add_argument(each.rstrip("?"), nargs="?" if each.endswith("?") else None)
        return made

    add(groups, "run", run, "package", "executable").add_argument("rest", nargs="...")
    add(groups.add_parser("service").add_subparsers(), "call", service_call, "name", "type",
        "values?")  # fmt: skip
    topic = groups.add_parser("topic").add_subparsers()
    pub = add(topic, "pub", topic_pub, "name", "type", "values?")
    pub.add_argument("-1", "--once", action="store_true")
    pub.add_argument("-r", "--rate", type=float, default=1.0)
    add(topic, "echo", topic_echo, "name").add_argument("--once", action="store_true")
    goal = add(groups.add_parser("action").add_subparsers(), "send_goal", action_send_goal,
               "name", "type", "values")  # fmt: skip
    goal.add_argument("-f", "--feedback", action="store_true")
    params = groups.add_parser("param").add_subparsers(dest="do")
    for do, names in {"set": "node name value", "get": "node name", "describe": "node name",
                      "list": "node"}.items():  # fmt: skip
        add(params, do, param, *names.split())
    add(groups.add_parser("node").add_subparsers(), "list", node_list)
    return parser


def main(words: list[str]) -> None:
    """Do what a line says."""
    chosen = understood().parse_args(words)
    chosen.run(chosen)
