# SPDX-License-Identifier: Apache-2.0
"""Parameters: described, bounded, and changed together or not at all."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import pytest
from harness import Ros
from rclpy.node import Node
from rclpy.parameter import Parameter

from arm_dynamics import InvalidInput
from arm_dynamics.ros.common.params import (
    ControllerParams,
    DynamicsParams,
    declare,
    parameter,
    watch,
)
from arm_sim.ros.params import SimParams

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
        watch(self, lambda: self.params, self.apply)

    def apply(self, params: Some) -> None:
        if params.number == 1.5:
            raise InvalidInput("1.5 will not do")
        self.params = params

    def change(self, **values: Any) -> Any:
        return self.set_parameters_atomically(
            [Parameter(name, value=value) for name, value in values.items()]
        )


def test_values_come_from_whoever_starts_the_node(ros: Ros) -> None:
    holder = ros.add(Holder, number=0.5, gains=[1.0, 2.0], fixed=False)
    assert holder.params == Some(number=0.5, gains=[1.0, 2.0], fixed=False)


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"number": 3.0}, "'number'"),
        ({"number": "much"}, "'number'"),
        ({"count": 0}, "'count'"),
        ({"color": "blue"}, "'color' is 'blue'; allowed is one of red, green"),
    ],
)
def test_bad_values_at_start_are_refused(ros: Ros, values: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InvalidInput, match=complaint):
        ros.add(Holder, **values)


def test_changes_take_effect(ros: Ros) -> None:
    holder = ros.add(Holder)
    assert holder.change(number=0.25, color="green", gains=[3.0]).successful
    assert holder.params == Some(number=0.25, color="green", gains=[3.0])


@pytest.mark.parametrize("value", [2, 2.0, [2], [2.0]])
def test_one_number_will_do_for_a_list(ros: Ros, value: Any) -> None:
    assert ros.add(Holder, gains=value).params.gains == [2]
    other = ros.add(Holder)
    assert other.change(gains=value).successful
    assert other.params.gains == [2]


@pytest.mark.parametrize("name", ["gains", "number"])
def test_parameters_cannot_be_taken_away(ros: Ros, name: str) -> None:
    holder = ros.add(Holder)
    assert not holder.set_parameters([Parameter(name)])[0].successful
    assert holder.params == Some()


@pytest.mark.parametrize(
    ("bad", "complaint"),
    [
        ({"number": 1.5}, "1.5 will not do"),
        ({"number": 3.0}, "number"),
        ({"color": "blue"}, "allowed is one of red, green"),
        ({"count": 0}, "count"),
        ({"fixed": False}, "read-only"),
        ({"number": "much"}, "expected 'Type.DOUBLE'"),
    ],
)
def test_bad_changes_are_refused_as_a_whole(ros: Ros, bad: dict[str, Any], complaint: str) -> None:
    holder = ros.add(Holder)
    result = holder.change(gains=[7.0], **bad)
    assert not result.successful
    assert complaint in result.reason
    assert holder.params == Some()
    assert list(holder.get_parameter("gains").value) == [1.0]


@pytest.mark.parametrize("kind", [DynamicsParams, ControllerParams, SimParams])
def test_every_parameter_of_the_nodes_is_described(kind: Any) -> None:
    for item in fields(kind):
        assert item.metadata["descriptor"].description
