# SPDX-License-Identifier: Apache-2.0
"""The parameters of a running node."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import click
from rcl_interfaces import srv
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.parameter import Parameter, parameter_value_to_python

from arm_dynamics.exceptions import NoAnswer, did_you_mean, known_names
from arm_dynamics.ros.common.caller import Caller
from arm_dynamics.ros.interfaces import Service
from arm_sim.cli.robot.listener import full


class Parameters(Caller):
    """The parameters of a node; use it in a ``with`` statement.

    Args:
        node: Its name.
        timeout: How long to wait for it in [s].
    """

    def __init__(self, node: str, timeout: float) -> None:
        super().__init__(timeout)
        self._name = full(node)

    def names(self) -> list[str]:
        """Names of all parameters."""
        return sorted(self._call("ListParameters").result.names)

    def get(self, names: Sequence[str]) -> dict[str, Any]:
        """Their values by name."""
        answer = self._call("GetParameters", names=list(names))
        return dict(zip(names, map(parameter_value_to_python, answer.values), strict=True))

    def describe(self, names: Sequence[str]) -> dict[str, ParameterDescriptor]:
        """Their descriptions by name."""
        answer = self._call("DescribeParameters", names=list(names))
        return dict(zip(names, answer.descriptors, strict=True))

    def set(self, values: Mapping[str, Any]) -> None:
        """Set all of them, or none.

        Raises:
            click.ClickException: If the node refuses, with its reason.
        """
        messages = [Parameter(n, value=v).to_parameter_msg() for n, v in values.items()]
        answer = self._call("SetParametersAtomically", parameters=messages)
        if not answer.result.successful:
            raise click.ClickException(f"refused: {answer.result.reason}")

    def require(self, names: Sequence[str]) -> None:
        """Fail with what is allowed if one does not exist."""
        existing = self.names()
        for name in names:
            if name not in existing:
                hint = did_you_mean(name, existing) or ";"
                allowed = f"{hint} allowed: {known_names(existing, 100)}"
                raise click.ClickException(f"{self._name} has no parameter '{name}'{allowed}")

    def _call(self, kind: str, **fields: Any) -> Any:
        name = re.sub("(?<=[a-z])([A-Z])", r"_\1", kind).lower()
        service = Service(f"~/{name}", getattr(srv, kind))
        try:
            return self.ask(self._name, service, service.type.Request(**fields))
        except NoAnswer as error:
            raise click.ClickException(f"{error}\n  --timeout waits longer") from None
