# SPDX-License-Identifier: Apache-2.0
"""``./arm get`` and ``./arm set``: parameters of running nodes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import click
import yaml

from arm_dynamics.exceptions import choices
from arm_sim.cli.output import console, examples, table

if TYPE_CHECKING:
    from rcl_interfaces.msg import ParameterDescriptor

_KINDS = {
    1: "bool", 2: "int", 3: "double", 4: "string", 5: "list", 6: "bool[]", 7: "int[]",
    8: "double[]", 9: "string[]",
}  # fmt: skip  # numbers of rcl_interfaces/ParameterType; a list that is empty comes as bytes
_TEXT, _DOUBLE = 4, 3
_MEETING = 3.0  # [s] for the discovery of two processes


class Parameters:
    """The parameters of a node; use it in a ``with`` statement."""

    def __init__(self, node: str, timeout: float) -> None:
        """Take the node's name, and how long to wait for it in [s]."""
        from arm_dynamics.ros.common.caller import Caller

        self._node, self._caller = node, Caller(timeout)

    def __enter__(self) -> Self:
        """Use it in a ``with`` statement."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the graph."""
        self._caller.close()

    def names(self) -> list[str]:
        """Names of all parameters."""
        from rcl_interfaces.srv import ListParameters

        answer = self._ask("~/list_parameters", ListParameters)
        return sorted(answer.result.names)

    def get(self, names: Sequence[str]) -> dict[str, Any]:
        """Their values by name."""
        from rcl_interfaces.srv import GetParameters
        from rclpy.parameter import parameter_value_to_python

        answer = self._ask("~/get_parameters", GetParameters, names=list(names))
        values = map(parameter_value_to_python, answer.values)
        return dict(zip(names, map(_plain, values), strict=True))

    def describe(self, names: Sequence[str]) -> dict[str, ParameterDescriptor]:
        """Their descriptions by name."""
        from rcl_interfaces.srv import DescribeParameters

        answer = self._ask("~/describe_parameters", DescribeParameters, names=list(names))
        return dict(zip(names, answer.descriptors, strict=True))

    def set(self, values: Mapping[str, Any]) -> None:
        """Set all of them, or none.

        Raises:
            click.ClickException: If the node refuses, with its reason.
        """
        from rcl_interfaces.srv import SetParametersAtomically
        from rclpy.parameter import Parameter

        messages = [Parameter(n, value=v).to_parameter_msg() for n, v in values.items()]
        answer = self._ask(
            "~/set_parameters_atomically", SetParametersAtomically, parameters=messages
        )
        if not answer.result.successful:
            raise click.ClickException(f"refused: {answer.result.reason}")

    def require(self, names: Sequence[str]) -> None:
        """Fail with what is allowed if one does not exist."""
        known = self.names()
        for name in names:
            if name not in known:
                raise click.ClickException(
                    f"{self._node} has no parameter '{name}'; allowed: {choices(name, known, 100)}"
                )

    def _ask(self, service: str, kind: Any, **fields: Any) -> Any:
        from arm_dynamics.exceptions import NoAnswer
        from arm_dynamics.ros.interfaces import Service

        try:
            return self._caller.ask(self._node, Service(service, kind), kind.Request(**fields))
        except NoAnswer as error:
            raise click.ClickException(f"{error}\n  --timeout waits longer") from None


def _plain(value: Any) -> Any:
    """A value for JSON; an empty list has no type and arrives as bytes."""
    return list(value) if isinstance(value, Sequence) and not isinstance(value, str) else value


_timeout = click.option(
    "--timeout", default=5.0, show_default=True, type=click.FloatRange(0.1),
    help="How long to wait for the node, in s.",
)  # fmt: skip


@click.command(
    epilog=examples(
        "./arm get", "./arm get controller", "./arm get controller bandwidth",
        "./arm get left/sim --json",
    )
)  # fmt: skip
@click.argument("node", required=False)
@click.argument("names", metavar="[NAME]…", nargs=-1)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@_timeout
def get(node: str | None, names: tuple[str, ...], as_json: bool, timeout: float) -> None:
    """Show parameters of NODE: values, allowed ranges, and descriptions.

    Without NAME it shows all of them, without NODE a list of the nodes.
    """
    if node is None:
        _list_nodes(timeout, as_json)
        return
    with Parameters("/" + node.strip("/"), timeout) as parameters:
        if names:
            parameters.require(names)
        chosen = list(names or parameters.names())
        values = parameters.get(chosen)
        if as_json:
            click.echo(json.dumps(values))
            return
        about = parameters.describe(chosen)
    rows = [
        (name, _written(values[name]), _kind(about[name]), _allowed(about[name]),
         about[name].description)
        for name in chosen
    ]  # fmt: skip
    made = table(("parameter", "value", "type", "allowed", ""), rows, text=range(5))
    made.columns[-1].no_wrap = False
    console().print(made)


@click.command(
    "set",
    context_settings={"ignore_unknown_options": True},
    epilog=examples(
        "./arm set controller bandwidth 30",
        "./arm set controller controller joint_impedance damping_ratio 0.7",
        './arm set controller force_direction "[0, 0, -1]"',
        "./arm set left/sim stale_policy gravity",
    ),
)
@click.argument("node")
@click.argument("words", metavar="NAME VALUE…", nargs=-1, required=True)
@_timeout
def set_(node: str, words: tuple[str, ...], timeout: float) -> None:
    """Set parameters of NODE: all of them together, or none.

    Values are written as in YAML: 30, 0.5, true, hold, [1, 2].
    """
    if len(words) % 2:
        raise click.UsageError(f"'{words[-1]}' has no value; pairs of NAME VALUE are expected")
    wanted = dict(zip(words[::2], words[1::2], strict=True))
    if 2 * len(wanted) < len(words):
        raise click.UsageError("a parameter is named twice")
    with Parameters("/" + node.strip("/"), timeout) as parameters:
        parameters.require(list(wanted))
        about = parameters.describe(list(wanted))
        before = parameters.get(list(wanted))
        parameters.set({n: _read(n, text, about[n], before[n]) for n, text in wanted.items()})
        after = parameters.get(list(wanted))
    for name in wanted:
        click.echo(f"{name}: {_written(before[name])} → {_written(after[name])}")


def _read(name: str, text: str, about: ParameterDescriptor, before: Any) -> Any:
    """Parse a value, with the parameter's type where that is known."""
    if about.type == _TEXT and isinstance(before, str):  # rclpy notes refused types, too
        return text
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        raise click.ClickException(f"{name}: {text!r} is not a value in YAML") from None
    if isinstance(value, str):
        value = _number(value)
    if about.type == _DOUBLE and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, bool | int | float | str | list):
        raise click.ClickException(
            f"{name}: {text!r} is not a parameter value; expected {_kind(about)}"
        )
    if isinstance(value, list) and {type(x) for x in value} == {int, float}:
        return [float(x) for x in value]
    return value


def _number(text: str) -> Any:
    """A number that YAML reads as text, such as 1e-3."""
    try:
        return float(text)
    except ValueError:
        return text


def _kind(about: ParameterDescriptor) -> str:
    return _KINDS.get(about.type, "unset")


def _allowed(about: ParameterDescriptor) -> str:
    """Range, choices, or that the parameter is read-only."""
    parts = [
        f"{r.from_value:g} to {r.to_value:g}"
        for r in (*about.floating_point_range, *about.integer_range)
    ]
    parts += [about.additional_constraints] if about.additional_constraints else []
    parts += ["fixed"] if about.read_only else []
    return ", ".join(parts)


def _written(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False) if not isinstance(value, str) else value
    return text if len(text) <= 60 else text[:59] + "…"


def _list_nodes(timeout: float, as_json: bool) -> None:
    """List the nodes, after enough time for discovery."""
    from arm_sim.cli.robot.listener import Listener

    with Listener() as listener:
        listener.until(lambda: bool(listener.nodes()), timeout)
        listener.until(lambda: False, _MEETING)
        seen = [name for name in listener.nodes() if "/_" not in name]
        where = listener.where()
    if as_json:
        click.echo(json.dumps(seen))
    elif seen:
        click.echo("\n".join(seen))
    else:
        raise click.ClickException(f"no nodes (waited {timeout:g} s)\n  {where}")
