# SPDX-License-Identifier: Apache-2.0
"""The standard services of simulators, where the package ``simulation_interfaces`` is installed.

Definitions: github.com/ros-simulation/simulation_interfaces, version 1.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from arm_sim.ros.services import SimServices
    from arm_sim.ros.sim_node import SimNode

STOPPED, PLAYING, PAUSED = 0, 1, 2  # SimulationState
UNSUPPORTED, OK, FAILED = 0, 1, 4  # Result
FEATURES = (
    "SIMULATION_RESET", "SIMULATION_RESET_TIME", "SIMULATION_RESET_STATE",
    "SIMULATION_STATE_GETTING", "SIMULATION_STATE_SETTING", "SIMULATION_STATE_PAUSE",
    "STEP_SIMULATION_SINGLE", "STEP_SIMULATION_MULTIPLE",
)  # fmt: skip


class StandardServices:
    """Answers the standard services by our own ones."""

    def __init__(self, node: SimNode, own: SimServices) -> None:
        """Offer those that are installed, under ``~/``."""
        self._node, self._own = node, own
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
        """Say what is supported."""
        del request  # empty
        known = response.features
        known.features = [getattr(known, name) for name in FEATURES if hasattr(known, name)]
        return response

    def on_get_state(self, request: Any, response: Any) -> Any:
        """Say whether time goes on."""
        del request  # empty
        at_start = STOPPED if self._node.simulator.step_count == 0 else PAUSED
        response.state.state = at_start if self._node.paused else PLAYING
        response.result.result = OK
        return response

    def on_set_state(self, request: Any, response: Any) -> Any:
        """Go on, pause, or stop, which is to pause and go back to the start."""
        wanted = request.state.state
        if wanted not in (STOPPED, PLAYING, PAUSED):
            response.result.result = UNSUPPORTED
            response.result.error_message = f"state {wanted}; allowed are 0, 1 and 2"
            return response
        done = self._own.on_pause(SimpleNamespace(data=wanted != PLAYING), SimpleNamespace())
        if done.success and wanted == STOPPED:
            done = self._own.on_reset(None, SimpleNamespace())
        return _told(done, response)

    def on_reset(self, request: Any, response: Any) -> Any:
        """Go back to the start, whatever the scope: there is one arm and its time."""
        del request
        return _told(self._own.on_reset(None, SimpleNamespace()), response)

    def on_step(self, request: Any, response: Any) -> Any:
        """Advance by whole ticks while paused."""
        return _told(self._own.on_step(request, SimpleNamespace()), response)


def _told(done: Any, response: Any) -> Any:
    response.result.result = OK if done.success else FAILED
    response.result.error_message = "" if done.success else done.message
    return response
