# SPDX-License-Identifier: Apache-2.0
"""``./arm get`` and ``./arm set``: parameters of running nodes."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any

import click
import yaml

from arm_sim.cli.arguments import Json, Timeout
from arm_sim.cli.command import command
from arm_sim.cli.output import console, shortened, table, to_json

if TYPE_CHECKING:
    from rcl_interfaces.msg import ParameterDescriptor

# By the numbers of rcl_interfaces/ParameterType; a list that is empty comes as bytes
KINDS = (
    "unset", "bool", "int", "double", "string", "list", "bool[]", "int[]", "double[]", "string[]"
)  # fmt: skip
_DISCOVERY = 3.0  # [s] for two processes to discover each other


@command(
    "./arm get",
    "./arm get controller",
    "./arm get controller bandwidth",
    "./arm get left/sim --json",
)
def get(
    node: str | None = None,
    names: Annotated[tuple[str, ...], "[NAME]…"] = (),
    *,
    as_json: Json = False,
    timeout: Timeout = 5.0,
) -> None:
    """Show parameters of NODE: values, allowed ranges, and descriptions.

    Without NAME it shows all of them, without NODE a list of the nodes.
    """
    if node is None:
        from arm_sim.cli.robot.listener import Listener

        with Listener() as listener:
            listener.until(lambda: bool(listener.nodes()), timeout)
            listener.spin_for(_DISCOVERY)
            nodes = [name for name in listener.nodes() if "/_" not in name]
            place = listener.where()
        if not (nodes or as_json):
            raise click.ClickException(f"no nodes (waited {timeout:g} s)\n  {place}")
        click.echo(to_json(nodes) if as_json else "\n".join(nodes))
        return
    from arm_sim.cli.robot.node_parameters import Parameters

    with Parameters(node, timeout) as parameters:
        if names:
            parameters.require(names)
        selection = list(names or parameters.names())
        values = parameters.get(selection)
        if as_json:
            click.echo(to_json(values))
            return
        descriptions = parameters.describe(selection)
    rows = []
    for name, about in descriptions.items():
        ranges = (*about.floating_point_range, *about.integer_range)
        allowed = [f"{r.from_value:g} to {r.to_value:g}" for r in ranges]
        allowed += [about.additional_constraints, "fixed" if about.read_only else ""]
        rows.append((name, shortened(values[name]), KINDS[about.type],
                     ", ".join(filter(None, allowed)), about.description))  # fmt: skip
    grid = table(("parameter", "value", "type", "allowed", ""), rows, text=range(5))
    grid.columns[-1].no_wrap = False
    console().print(grid)


@command(
    "./arm set controller bandwidth 30",
    "./arm set controller controller joint_impedance damping_ratio 0.7",
    './arm set controller force_direction "[0, 0, -1]"',
    "./arm set left/sim stale_policy gravity",
    name="set",
    ignore_unknown_options=True,
)
def set_(
    node: str, words: Annotated[tuple[str, ...], "NAME VALUE…"], *, timeout: Timeout = 5.0
) -> None:
    """Set parameters of NODE: all of them together, or none.

    Values are written as in YAML: 30, 0.5, true, hold, [1, 2].
    """
    if len(words) % 2:
        raise click.UsageError(f"'{words[-1]}' has no value; pairs of NAME VALUE are expected")
    texts = dict(zip(words[::2], words[1::2], strict=True))
    names = list(texts)
    if 2 * len(names) < len(words):
        raise click.UsageError("a parameter is named twice")
    from arm_sim.cli.robot.node_parameters import Parameters

    with Parameters(node, timeout) as parameters:
        parameters.require(names)
        about, before = parameters.describe(names), parameters.get(names)
        values = {n: _read(n, text, about[n], before[n]) for n, text in texts.items()}
        for name in [name for name in names if about[name].read_only]:
            for allowed in (*about[name].floating_point_range, *about[name].integer_range):
                value, low, high = values[name], allowed.from_value, allowed.to_value
                if not (isinstance(value, int | float) and low <= value <= high):
                    raise click.ClickException(f"{name} is {value}; allowed: {low:g} to {high:g}")
            restart = f"--ros-args -p {name}:={texts[name]}"
            raise click.ClickException(f"{name} is fixed; restart {node} with {restart}")
        parameters.set(values)
        after = parameters.get(names)
    for name in names:
        click.echo(f"{name}: {shortened(before[name])} → {shortened(after[name])}")


def _read(name: str, text: str, about: ParameterDescriptor, before: Any) -> Any:
    """Parse a value, with the parameter's type where that is known."""
    kind = KINDS[about.type]
    if kind == "string" and isinstance(before, str):  # rclpy notes refused types, too
        return text
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        raise click.ClickException(f"{name}: {text!r} is not a value in YAML") from None
    if isinstance(value, str):
        with suppress(ValueError):  # a number that YAML reads as text, such as 1e-3
            value = float(value)
    if not isinstance(value, bool | int | float | str | list):
        raise click.ClickException(f"{name}: {text!r} is not a parameter value; expected {kind}")
    if kind in ("double", "double[]") and type(value) is int:
        return float(value)
    if isinstance(value, list) and {type(x) for x in value} == {int, float}:
        return [float(x) for x in value]
    return value
