# SPDX-License-Identifier: Apache-2.0
"""Services of the sim node, executed between two ticks."""

from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.node import Node

from arm_dynamics import InvalidInput
from arm_dynamics.logs import Throttled
from arm_dynamics.ros import interfaces
from arm_dynamics.ros.common.endpoints import answering
from arm_dynamics.ros.interfaces import Service
from arm_dynamics.scene.urdf.joint_names import NamedJoints
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.simulation.runtime_changes import friction_change, payload_change

Action = Callable[[], Any]
_REACH = 1.0  # [rad] or [m]: largest motion of a joint in a tick


class SimServices:
    """Answers requests to a simulation; an invalid one changes nothing.

    A service prepares lengthy work in the calling thread, and returns the action to run between
    two ticks.
    """

    def __init__(self, node: Node, engine: TickEngine, reset_counters: Action) -> None:
        """Offer the services; ``reset_counters`` is run between ticks."""
        self._engine, self._log = engine, Throttled(node.get_logger())
        self._orders: dict[Service, Callable[[Any, Any], Action]] = {
            interfaces.RESET: lambda *_: engine.reset,
            interfaces.PAUSE: lambda request, _: partial(engine.pause, request.data),
            interfaces.STEP: self._step,
            interfaces.SET_JOINT_STATE: lambda request, _: partial(self._set_joint_state, request),
            interfaces.SET_PAYLOAD: self._set_payload,
            interfaces.SET_FRICTION: self._set_friction,
            interfaces.RESET_COUNTERS: lambda *_: reset_counters,
        }
        for service in self._orders:
            node.create_service(service.type, service.name, partial(self.answer, service))

    def answer(self, service: Service, request: Any = None, response: Any = None) -> Any:
        """The response to a request, by default an empty one."""
        request, response = request or service.type.Request(), response or service.type.Response()
        with answering(response, self._log):
            self._engine.queue.run(self._orders[service](request, response))
        return response

    def _step(self, request: Any, response: Any) -> Action:
        """Advance by whole ticks while the simulation is paused."""

        def action() -> None:
            try:
                self._engine.step(request.steps)
            finally:
                response.time = self._engine.simulator.state.time

        return action

    def _set_joint_state(self, request: Any) -> None:
        """Set positions (default: unchanged) and velocities (default: zero) of named joints."""
        simulator = self._engine.simulator
        named = NamedJoints(request.joint_names, simulator.joint_names)
        q, v = simulator.state.q, simulator.state.v.copy()
        v[named.joints] = 0.0
        if request.position:
            q = named.spread("position", "position", request.position, q)
        if request.velocity:
            v = named.spread("velocity", "velocity", request.velocity, v)
        limit = _REACH / simulator.dt  # beyond it the next tick would fail
        units = simulator.model.units("rad", "m")
        for name, unit, speed in zip(simulator.joint_names, units, v.tolist(), strict=True):
            if abs(speed) > limit:
                raise InvalidInput(
                    f"velocity of joint '{name}' is {speed:.6g}; allowed: up to {limit:g} "
                    f"{unit}/s, {_REACH:g} {unit} in a time step"
                )
        self._engine.change(lambda: simulator.set_state(q, v))

    def _set_payload(self, request: Any, _: Any) -> Action:
        load = request.index, request.mass, request.com, request.inertia
        return partial(self._engine.change, payload_change(self._engine.simulator, *load))

    def _set_friction(self, request: Any, _: Any) -> Action:
        """Change viscous friction; joints that are not named keep theirs."""
        simulator = self._engine.simulator
        named = NamedJoints(request.joint_names, simulator.joint_names)
        present = simulator.dynamics.model.viscous
        viscous = named.spread("viscous", "viscous", request.viscous, present)
        return partial(self._engine.change, friction_change(simulator, viscous))
