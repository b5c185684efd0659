# SPDX-License-Identifier: Apache-2.0
"""What nodes report of themselves in their diagnostics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from arm_sim.cli.robot.listener import Listener

WARNING, ERROR = b"\1", b"\2"  # levels of DiagnosticStatus.msg, which is imported late


class Reports:
    """The newest diagnostics of all nodes."""

    def __init__(self) -> None:
        self._complaints: dict[str, tuple[bytes, str]] = {}
        self._values: dict[str, dict[str, str]] = {}

    def join(self, listener: Listener) -> None:
        """Subscribe to the diagnostics."""
        from arm_dynamics.ros.interfaces import DIAGNOSTICS

        listener.subscribe(DIAGNOSTICS, DIAGNOSTICS.name, self.on_diagnostics)

    def on_diagnostics(self, message: Any) -> None:
        """Process the diagnostics of a node."""
        for status in message.status:
            self._complaints[status.name] = status.level, status.message
            self._values[status.name] = {pair.key: pair.value for pair in status.values}

    def complaints(self, least: bytes = WARNING) -> list[str]:
        """Warnings and errors, or only these, each with the part of the node that has it."""
        reports = sorted(self._complaints.items())
        return [f"{name}: {message}" for name, (level, message) in reports if level >= least]

    def values(self, key: str) -> dict[str, str]:
        """The value of this name by part of a node, where there is one."""
        return {name: x[key] for name, x in sorted(self._values.items()) if key in x}
