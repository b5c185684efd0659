# SPDX-License-Identifier: Apache-2.0
"""A client's place in the ROS graph, from where it reaches a dynamics node and a sim node."""

from __future__ import annotations

from importlib import import_module
from types import TracebackType
from typing import Any, Self

from arm_dynamics.client.values import agreed


class Connection:
    """Reaches a dynamics node and a sim node; closed at the end of a ``with`` statement."""

    def __init__(
        self,
        dynamics: str = "dynamics",
        sim: str = "sim",
        timeout: float = 5.0,
        domain: int | None = None,
    ) -> None:
        """Join the ROS graph.

        Args:
            dynamics: Name of the dynamics node, with its namespace if it has one.
            sim: Name of the sim node, likewise.
            timeout: In [s].
            domain: ROS domain; None for that of the environment.
        """
        self._services: Any = import_module("arm_dynamics.ros.interfaces")
        self._caller: Any = import_module("arm_dynamics.ros.common.caller").Caller(timeout, domain)
        self._dynamics, self._sim = dynamics, sim

    def close(self) -> None:
        """Leave the ROS graph; calling it again does no harm."""
        self._caller.close()

    def __enter__(self) -> Self:
        """Use it in a ``with`` statement."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the ROS graph."""
        self.close()

    def _asked(self, service: Any, **fields: Any) -> Any:
        """Ask the dynamics node; its answer, or ``Refused``."""
        return agreed(self._answered(self._dynamics, service, fields))

    def _ordered(self, service: Any, **fields: Any) -> Any:
        """Order the sim node; its answer, or ``Refused``."""
        repeatable = service is not self._services.STEP
        return agreed(self._answered(self._sim, service, fields, repeatable))

    def _answered(
        self, node: str, service: Any, fields: dict[str, Any], repeatable: bool = True
    ) -> Any:
        """What a node answers, be it a refusal."""
        return self._caller.ask(node, service, service.type.Request(**fields), repeatable)
