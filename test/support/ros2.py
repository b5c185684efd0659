# SPDX-License-Identifier: Apache-2.0
"""What the pages use of the ros2 command line, which is on no registry, in the domain of a test.

As in ros2cli (Jazzy), ``topic pub`` waits for a subscriber, ``topic echo`` for a publisher,
``service call`` and ``action send_goal`` for a server.
"""

import re
from importlib import import_module
from typing import Any

import yaml
from goal_client import SUCCEEDED, Client
from harness import Ros
from rcl_interfaces.srv import ListParameters, SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data


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


def do(ros: Ros, words: list[str]) -> str:
    """Do what a line says, once, which must succeed; returns what came of it."""
    match [word for word in words if word not in ("-1", "--once", "-f", "--feedback")]:
        case ["service", "call", name, kind, *values]:
            request = fill(loaded(kind).Request(), yaml.safe_load("".join(values) or "{}"))
            response = ros.call(loaded(kind), name, request)
            result = getattr(response, "result", None)  # of simulation_interfaces
            assert getattr(response, "success", True), response
            assert getattr(result, "result", 1) == 1, response
            return str(response)
        case ["topic", "pub", *_, name, kind, values]:
            message = fill(loaded(kind)(), yaml.safe_load(values))
            ros.publisher(type(message), name).publish(message)
            return ""
        case ["topic", "echo", name]:
            ros.spin_until(lambda: ros.peer.count_publishers(name))
            (about, *_) = ros.peer.get_publishers_info_by_topic(name)
            heard = ros.listen(loaded(about.topic_type), name, qos_profile_sensor_data)
            ros.spin_until(lambda: heard)
            return str(heard[0])
        case ["action", "send_goal", name, kind, values]:
            return _sent(ros, name, loaded(kind), yaml.safe_load(values))
        case ["param", "set", node, name, value]:
            parameter = Parameter(name, value=yaml.safe_load(value)).to_parameter_msg()
            request = SetParameters.Request(parameters=[parameter])
            (result,) = ros.call(SetParameters, f"{node}/set_parameters", request).results
            assert result.successful, result.reason
            return ""
        case ["param", "list", node]:
            request = ListParameters.Request()
            return str(ros.call(ListParameters, f"{node}/list_parameters", request))
        case ["node", "list"]:
            return str(ros.peer.get_node_names())
    raise AssertionError(f"no part of this stand-in: ros2 {' '.join(words)}")


def _sent(ros: Ros, name: str, kind: Any, values: dict[str, Any]) -> str:
    """Send a goal, which must succeed; returns its result."""
    client = Client(ros, name, kind)
    status, result = client.result(client.send(fill(kind.Goal(), values)))
    client.close()
    assert status == SUCCEEDED
    return str(result)
