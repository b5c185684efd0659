# SPDX-License-Identifier: Apache-2.0
"""The standard services of simulators, where the package ``simulation_interfaces`` is installed.

Definitions: github.com/ros-simulation/simulation_interfaces, version 1.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from rclpy.node import Node

from arm_dynamics.ros.common.convert import answering
from arm_sim.ros.tick_engine import TickEngine

STOPPED, PLAYING, PAUSED = 0, 1, 2  # SimulationState
UNSUPPORTED, OK, FAILED = 0, 1, 4  # Result
FEATURES = (
    "SIMULATION_RESET", "SIMULATION_RESET_TIME", "SIMULATION_RESET_STATE",
    "SIMULATION_STATE_GETTING", "SIMULATION_STATE_SETTING", "SIMULATION_STATE_PAUSE",
    "STEP_SIMULATION_SINGLE", "STEP_SIMULATION_MULTIPLE"
)  # fmt: skip


class StandardServices:
    """Answers the standard services.

    Attributes:
        offered: Names of those that are installed.
    """

    def __init__(self, node: Node, engine: TickEngine) -> None:
        """Offer those that are installed, under ``~/``."""
        self._engine, self._log = engine, node.get_logger()
        self.offered: list[str] = []
        try:
            from simulation_interfaces import srv as found
        except ImportError:
            return
        for kind, name, answer in (
            ("GetSimulatorFeatures", "get_simulator_features", self.on_features),
            ("GetSimulationState", "get_simulation_state", self.on_get_state),
            ("SetSimulationState", "set_simulation_state", self.on_set_state),
            ("ResetSimulation", "reset_simulation", self.on_reset),
            ("StepSimulation", "step_simulation", self.on_step),
        ):
            if hasattr(found, kind):
                node.create_service(getattr(found, kind), f"~/{name}", answer)
                self.offered.append(name)

    def on_features(self, request: Any, response: Any) -> Any:
        """Name what is supported."""
        del request  # empty
        known = response.features
        known.features = [getattr(known, name) for name in FEATURES if hasattr(known, name)]
        return response

    def on_get_state(self, request: Any, response: Any) -> Any:
        """Tell whether time goes on."""
        del request  # empty
        at_start = STOPPED if self._engine.simulator.step_count == 0 else PAUSED
        response.state.state = at_start if self._engine.paused else PLAYING
        response.result.result = OK
        return response

    def on_set_state(self, request: Any, response: Any) -> Any:
        """Go on, pause, or stop, which is to pause and go back to the start."""
        target = request.state.state
        if target not in (STOPPED, PLAYING, PAUSED):
            response.result.result = UNSUPPORTED
            response.result.error_message = f"state {target}; allowed are 0, 1 and 2"
            return response

        def enter() -> None:
            self._engine.pause(target != PLAYING)
            if target == STOPPED:
                self._engine.reset()

        return self._between_ticks(response, enter)

    def on_reset(self, request: Any, response: Any) -> Any:
        """Go back to the start, whatever the scope: there is one arm and its time."""
        del request
        return self._between_ticks(response, self._engine.reset)

    def on_step(self, request: Any, response: Any) -> Any:
        """Advance by whole ticks while paused."""
        return self._between_ticks(response, lambda: self._engine.step(request.steps))

    def _between_ticks(self, response: Any, action: Callable[[], None]) -> Any:
        done = SimpleNamespace(message="")
        with answering(done, self._log):
            self._engine.queue.run(action)
        response.result.result = OK if done.success else FAILED
        response.result.error_message = done.message
        return response
