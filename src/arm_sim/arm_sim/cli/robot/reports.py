# SPDX-License-Identifier: Apache-2.0
"""What nodes report of themselves in their diagnostics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from arm_sim.cli.robot.listener import Listener


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

    @property
    def complaints(self) -> list[str]:
        """Warnings and errors, each with the part of the node that has it."""
        return self._of_level(b"\1")

    @property
    def errors(self) -> list[str]:
        """The errors among them."""
        return self._of_level(b"\2")

    def _of_level(self, least: bytes) -> list[str]:
        reports = sorted(self._complaints.items())
        return [f"{name}: {message}" for name, (level, message) in reports if level >= least]

    def values(self, key: str) -> dict[str, str]:
        """The value of this name by part of a node, where there is one."""
        parts = sorted(self._values.items())
        return {name: values[key] for name, values in parts if key in values}
