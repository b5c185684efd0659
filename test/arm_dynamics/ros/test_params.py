# SPDX-License-Identifier: Apache-2.0
"""Parameters: described, bounded, and changed together or not at all."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import pytest
from harness import Ros, change
from rclpy.node import Node
from rclpy.parameter import Parameter

from arm_dynamics import InvalidInput
from arm_dynamics.ros.common.params import declare, listed, parameter, watch
from arm_dynamics.ros.controller.action_goal import follow_params
from arm_dynamics.ros.controller.controller_params import ControllerParams
from arm_dynamics.ros.dynamics_node.node import DynamicsParams
from arm_sim.ros.sim_params import SimParams

pytestmark = pytest.mark.ros


@dataclass(frozen=True)
class Some:
    """One of each kind."""

    number: float = parameter(1.0, "a number", low=0.0, high=2.0, read_only=False)
    count: int = parameter(3, "a count", low=1, high=9, read_only=False)
    color: str = parameter("red", "a text", choices=("red", "green"), read_only=False)
    gains: list[float] = parameter([1.0], "numbers", read_only=False)
    fixed: bool = parameter(True, "a switch")


class Holder(Node):
    """Holds ``Some`` and refuses the number 1.5."""

    def __init__(self, **node_kwargs: Any) -> None:
        super().__init__("holder", **node_kwargs)
        self.params = declare(self, Some)
        watch(self, self.params, self.apply)

    def apply(self, params: Some) -> None:
        if params.number == 1.5:
            raise InvalidInput("1.5 will not do")
        self.params = params


def test_a_whole_number_will_do_for_a_number_and_one_number_for_a_list(ros: Ros) -> None:
    holder = ros.add(Holder, gains=2, number=2, fixed=False)
    assert holder.params == Some(number=2.0, gains=[2.0], fixed=False)
    for gains in (3, 3.0, [3]):
        assert change(holder, number=1, color="green", gains=gains).successful
        assert holder.params == Some(1.0, 3, "green", [3], fixed=False)
        assert type(holder.params.number) is float
    assert not change(holder, number=True).successful


BAD_CHANGES = [
    ({"number": 1.5}, "1.5 will not do"),
    ({"number": 3.0}, "number"),
    ({"gains": [True]}, "parameter 'gains' is [True]; numbers are expected"),
    ({"gains": None}, "parameter 'gains' has no value; a parameter cannot be removed"),
    ({"color": "blue"}, "allowed: one of red, green"),
    ({"fixed": False}, "read-only"),
    ({"gains": "abc", "number": "much"}, "Wrong parameter type"),  # rclpy's own words
]


def test_bad_changes_are_refused_as_a_whole(ros: Ros) -> None:
    for bad, complaint in BAD_CHANGES:
        holder = ros.add(Holder)
        result = change(holder, **{"gains": [7.0], **bad})
        assert not result.successful
        assert complaint in result.reason
        assert holder.params == Some()
        gains, described = holder.get_parameter("gains"), holder.describe_parameter("gains")
        assert list(gains.value) == [1.0] and described.type == gains.type_.value


def wrong(default: Any, about: Mapping[str, Any]) -> Iterator[tuple[Any, str]]:
    """Values that a parameter may not have, and what is said to be allowed."""
    if "low" in about:
        low, high, kind = about["low"], about["high"], type(default)
        for value in (low - 1, 1.1 * high + 1):
            yield kind(value), f"allowed: {low:.10g} to {high:.10g}"
    if about.get("choices"):
        yield "neither", f"allowed: one of {about['choices'][0]}"
    if isinstance(default, bool):
        yield 3, "allowed: true or false"
    elif isinstance(default, float | int):
        yield "much", "allowed: a "
    elif isinstance(default, str):
        yield 3, "allowed: text"


@pytest.mark.parametrize(
    "kind", [SimParams, DynamicsParams, ControllerParams, follow_params(["elbow"])]
)
def test_each_parameter_of_the_nodes_is_described_and_refused_by_name(ros: Ros, kind: Any) -> None:
    tried, node = 0, ros.add(Node, "described")
    own = set(node.list_parameters([], 0).names)
    declare(node, kind)
    for name in set(node.list_parameters([], 0).names) - own:
        assert node.describe_parameter(name).description, name
    for name, default, about in listed(kind):
        default = [default] if about.get("each_joint") else default
        for value, allowed in wrong(default, about):
            bounded = Node(
                "bounded", context=ros.context, start_parameter_services=False,
                parameter_overrides=[Parameter(name, value=value)],
            )  # fmt: skip
            with pytest.raises(InvalidInput) as caught:
                declare(bounded, kind)
            bounded.destroy_node()
            said = f"'{name}' is {value!r}" in str(caught.value)
            assert said and allowed in str(caught.value), str(caught.value)
            tried += 1
    assert tried > 3
