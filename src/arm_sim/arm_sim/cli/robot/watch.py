# SPDX-License-Identifier: Apache-2.0
"""``./arm watch``: show a live table of the joints of a running arm."""

from __future__ import annotations

import math
import os
import sys
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

import click

from arm_sim.cli.arguments import Json, Timeout
from arm_sim.cli.command import command
from arm_sim.cli.output import console, table, to_json
from arm_sim.cli.robot.reports import Reports

if TYPE_CHECKING:
    from rich.console import Group

    from arm_sim.cli.robot.listener import Listener

_SILENCE = 0.5  # [s] after which joint states are reported as stopped
_PERIOD = 1.2  # [s] between lines while there are none
_WINDOW = 200  # number of states over which the rate is measured
_CONDITIONS = ("at stops", "held")  # values in the diagnostics that are shown if there are any
_NONE = ("", "none", "no")
_COLUMNS = ("joint", "position\n[rad, m]", "velocity\n[rad/s, m/s]", "effort\n[N m, N]")


@command(
    "./arm watch",
    "./arm watch --once",
    "./arm watch --topic left/joint_states",
    "./arm watch --rate 1 > log.txt",
)
def watch(
    *,
    topic: str = "joint_states",
    once: bool = False,
    rate: Annotated[float, click.FloatRange(0.1, 60.0)] = 5.0,
    as_json: Json = False,
    timeout: Timeout = 5.0,
) -> None:
    """Show position, velocity and effort of the joints of a running robot until Ctrl-C.

    Below them it shows the rate of the joint states, and warnings of the nodes, such as stopped
    commands or joints at their stops. In a pipe it prints one line per update.

    Args:
        topic: Topic of the joint states.
        once: Show them once and exit.
        rate: Updates per second.
        as_json: Print JSON, one line per update.
        timeout: How long to wait for the first joint state, in s.
    """
    from arm_sim.cli.robot.listener import Listener, full

    with Listener() as listener, suppress(KeyboardInterrupt):
        arm = WatchedArm(full(topic))
        arm.join(listener)
        left = timeout
        while left > _PERIOD and not listener.until(lambda: arm.state is not None, _PERIOD):
            left -= _PERIOD
            if not as_json:
                click.echo(f"no joint states on {arm.topic} yet …", err=True)
        if not listener.until(lambda: arm.state is not None, left):
            raise click.ClickException(
                f"no joint states on {arm.topic} (waited {timeout:g} s)\n  start a robot: ./arm "
                f"sim SCENE; --topic selects another topic\n  {listener.where()}"
            )
        listener.until(lambda: arm.measured, 0.3)
        listener.spin_for(_PERIOD if once else 0.0)  # warnings come once a second
        try:
            _show(listener, arm, once, 1.0 / rate, as_json)
        except BrokenPipeError:  # the pipe was closed
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@dataclass
class WatchedArm:
    """The newest joint state, the rate of joint states, and warnings of nodes.

    Attributes:
        topic: Full name of the joint states' topic.
        state: The newest message.
        reports: Diagnostics of the nodes.
        publishers: Returns the nodes that publish the topic.
    """

    topic: str
    state: Any = None
    _times: deque[float] = field(default_factory=lambda: deque(maxlen=_WINDOW))
    reports: Reports = field(default_factory=Reports)
    publishers: Callable[[], list[str]] = list

    def join(self, listener: Listener) -> None:
        """Subscribe to joint states and diagnostics."""
        from arm_dynamics.ros.interfaces import JOINT_STATES

        listener.subscribe(JOINT_STATES, self.topic, self.on_state)
        self.publishers = lambda: listener.publishers(self.topic)
        self.reports.join(listener)

    def on_state(self, message: Any) -> None:
        """Process a joint state."""
        self.state = message
        self._times.append(time.monotonic())

    @property
    def measured(self) -> bool:
        """Whether enough states have arrived to measure their rate."""
        return len(self._times) >= _WINDOW // 4

    @property
    def age(self) -> float:
        """Time since the newest state, in [s]."""
        return time.monotonic() - self._times[-1]

    @property
    def rate(self) -> float:
        """Joint states per second, as far as this process keeps up."""
        passed = self._times[-1] - self._times[0]
        return 0.0 if self.age > _SILENCE or passed <= 0.0 else (len(self._times) - 1) / passed

    def rows(self) -> list[tuple[str, float, float, float]]:
        """Name, position, velocity and effort of each joint; NaN for what the message lacks."""
        state, n = self.state, len(self.state.name)
        columns = (
            list(values) if len(values) == n else [float("nan")] * n
            for values in (state.position, state.velocity, state.effort)
        )
        return list(zip(state.name, *columns, strict=True))

    def remarks(self) -> list[str]:
        """Lines below the table."""
        remarks = list[str]()
        if self.age > _SILENCE:
            remarks.append(f"stale: no joint state for {self.age:.1f} s")
        if len(names := self.publishers()) > 1:
            remarks.append(f"only the newest of the joint states of {', '.join(names)} are shown")
        remarks += self.reports.complaints()
        for key in _CONDITIONS:
            values = self.reports.values(key).items()
            remarks += [f"{name}: {key}: {x}" for name, x in values if x not in _NONE]
        return remarks

    @property
    def stamp(self) -> float:
        """Time of the newest state, in [s]."""
        return float(self.state.header.stamp.sec + 1e-9 * self.state.header.stamp.nanosec)


def _show(listener: Listener, arm: WatchedArm, once: bool, period: float, as_json: bool) -> None:
    if as_json or not (once or sys.stdout.isatty()):
        line = _json if as_json else _line
        click.echo(line(arm))
        while not once:
            listener.spin_for(period)
            click.echo(line(arm))
        return
    if once:
        console().print(_picture(arm))
        return
    from rich.live import Live

    with Live(_picture(arm), console=console(), auto_refresh=False) as live:
        while True:
            listener.spin_for(period)
            live.update(_picture(arm), refresh=True)


def _picture(arm: WatchedArm) -> Group:
    """The table with the lines below it."""
    from rich.console import Group
    from rich.text import Text

    rows = [(name, *map(_steady, values)) for name, *values in arm.rows()]
    about = f" t = {arm.stamp:.3f} s, {arm.rate:.0f} joint states/s"
    remarks = [f" {remark}" for remark in arm.remarks()]
    return Group(table(_COLUMNS, rows), Text(about, "dim"), Text("\n".join(remarks), "yellow"))


def _steady(value: float) -> str:
    """A number with a fixed number of decimals, or a dash for NaN."""
    if math.isnan(value):
        return "-"
    text = f"{value:.5f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def _line(arm: WatchedArm) -> str:
    joints = " ".join(f"{name}={_steady(position)}" for name, position, *_ in arm.rows())
    return "; ".join([f"{arm.stamp:.3f} {joints}", *arm.remarks()])


def _json(arm: WatchedArm) -> str:
    names, *columns = zip(*arm.rows(), strict=True)
    about = {"time": arm.stamp, "rate": arm.rate, "remarks": arm.remarks(), "names": names}
    return to_json(about | dict(zip(("position", "velocity", "effort"), columns, strict=True)))
