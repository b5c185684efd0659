# SPDX-License-Identifier: Apache-2.0
"""The services of simulation_interfaces that apply to a single arm."""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from arm_dynamics.logs import Throttled
from arm_dynamics.ros.common.convert import to_time
from arm_sim.ros.sim_params import SimParams
from arm_sim.ros.standard import results
from arm_sim.ros.standard.entities import Entities, Entity
from arm_sim.ros.standard.results import Refusal, service_callback
from arm_sim.ros.standard.simulate_steps import SimulateSteps
from arm_sim.ros.tick_engine import TickEngine

STOPPED, PLAYING, PAUSED = 0, 1, 2  # SimulationState.msg
_STATES = {STOPPED: "stopped", PLAYING: "playing", PAUSED: "paused"}
TIME, STATE, ALL = 1, 2, 255  # ResetSimulation.srv

# Interfaces required for a feature, and the feature's name in SimulatorFeatures.msg.
FEATURES = {
    "get_entities": ("ENTITY_TAGS", "ENTITY_CATEGORIES"),
    "get_entity_state": ("ENTITY_STATE_GETTING",),
    "get_entity_info": ("ENTITY_INFO_GETTING",),
    "reset_simulation": ("SIMULATION_RESET", "SIMULATION_RESET_TIME", "SIMULATION_RESET_STATE"),
    "get_simulation_state": ("SIMULATION_STATE_GETTING",),
    "set_simulation_state": ("SIMULATION_STATE_SETTING", "SIMULATION_STATE_PAUSE"),
    "step_simulation": ("STEP_SIMULATION_SINGLE", "STEP_SIMULATION_MULTIPLE"),
    "simulate_steps": ("STEP_SIMULATION_ACTION",),
    "get_current_world": ("WORLD_INFO_GETTING",),
}


class StandardServices:
    """Answers the standard services, and the action.

    Attributes:
        offered: Names of the offered services; empty without the package.
    """

    def __init__(
        self, node: Node, engine: TickEngine, params: SimParams, stamp: Callable[[], int]
    ) -> None:
        """Offer the services of the installed package, under ``~/``.

        ``stamp`` returns the stamp of the current state in [ns], in the ticking thread.
        """
        self._engine, self._scene, self._stamp = engine, params.scene, stamp
        self.offered: list[str] = []
        self._steps: SimulateSteps | None = None
        self._entities = Entities(engine.simulator)
        if params.standard_services:
            self._offer(node)

    def _offer(self, node: Node) -> None:
        """Offer the services of the package, and the action, where it is installed."""
        try:
            from simulation_interfaces import action, srv
        except ImportError:
            return
        log = Throttled(node.get_logger())
        node.create_service(srv.GetSimulatorFeatures, "~/get_simulator_features", self._features)
        for name in (*FEATURES, "get_entities_states"):
            answer = getattr(self, f"_{name}", None)  # not of the action
            kind = getattr(srv, name.title().replace("_", ""), None)
            if answer and kind is not None:
                node.create_service(kind, f"~/{name}", service_callback(answer, log))
                self.offered.append(name)
        if hasattr(action, "SimulateSteps"):
            self._steps = SimulateSteps(node, self._engine, action.SimulateSteps)
            self.offered.append("simulate_steps")
        self.offered.append("get_simulator_features")

    def close(self) -> None:
        """End the action; call before the node is destroyed."""
        if self._steps is not None:
            self._steps.close()

    # --- the simulation ------------------------------------------------------------------------

    def _features(self, request: Any, response: Any) -> Any:
        """List the supported features."""
        offer = response.features
        names = [name for service in self.offered for name in FEATURES.get(service, ())]
        offer.features = sorted(getattr(offer, name) for name in names if hasattr(offer, name))
        offer.custom_info = (
            "one robot arm; entities are the robot and its links, as robot/link; their "
            "accelerations are left zero"
        )
        return response

    def _state(self) -> int:
        if not self._engine.paused:
            return PLAYING
        return PAUSED if self._engine.simulator.arm.step_count else STOPPED

    def _get_simulation_state(self, request: Any, response: Any) -> None:
        """Whether the simulation is running."""
        response.state.state = self._engine.queue.run(self._state)

    def _set_simulation_state(self, request: Any, response: Any) -> None:
        """Run, pause, or stop (pause and reset)."""
        self._engine.queue.run(lambda: self._enter(request.state.state))

    def _enter(self, target: int) -> None:
        """Enter a state of the simulation, if that is allowed from the present one."""
        engine, present = self._engine, self._state()
        if target not in _STATES:
            allowed = ", ".join(f"{code} ({name})" for code, name in _STATES.items())
            raise Refusal(results.UNSUPPORTED, f"state {target}; allowed: {allowed}")
        if target == present:
            raise Refusal(results.ALREADY_THERE, f"the simulation is {_STATES[target]} already")
        if (present, target) == (STOPPED, PAUSED):
            raise Refusal(results.INCORRECT_TRANSITION, "a stopped simulation can only be played")
        engine.pause(target != PLAYING)
        if target == STOPPED:
            engine.reset()

    def _reset_simulation(self, request: Any, response: Any) -> None:
        """Reset time, state, or both; a running simulation continues to run."""
        scope = request.scope or ALL
        if not scope & (TIME | STATE):
            allowed = "a sum of 1 (time) and 2 (state), or 0 (all)"
            raise Refusal(results.UNSUPPORTED, f"scope {scope}; allowed: {allowed}")
        self._engine.queue.run(lambda: self._reset(scope & (TIME | STATE)))

    def _reset(self, scope: int) -> None:
        """Reset time, state, or both."""
        engine, simulator = self._engine, self._engine.simulator
        if scope == TIME | STATE:
            engine.reset()
        elif scope == TIME:
            n, x = simulator.n, simulator.arm.x.copy()
            engine.reset(x[:n], x[n : 2 * n], x[2 * n :])
        else:
            model = simulator.model
            engine.change(lambda: simulator.set_state(model.q0, model.v0))

    def _step_simulation(self, request: Any, response: Any) -> None:
        """Advance by whole ticks while paused."""
        self._engine.queue.run(lambda: self._engine.step(request.steps))

    def _get_current_world(self, request: Any, response: Any) -> None:
        """The scene by its name, or else the description of its robot."""
        model, world = self._engine.simulator.model, response.world
        world.name = model.whole.name
        world.description = "the scene of one robot arm"
        world.world_resource.uri = self._scene
        if not self._scene:
            world.world_resource.resource_string = model.scene.description

    # --- entities ------------------------------------------------------------------------------

    def _get_entities(self, request: Any, response: Any) -> None:
        """Names of entities."""
        response.entities = [entity.name for entity in self._entities.matching(request.filters)]

    def _get_entity_info(self, request: Any, response: Any) -> None:
        """Description of an entity."""
        entity, info = self._entities.named(request.entity), response.info
        info.category.category, info.description = entity.category, entity.description
        info.tags = list(entity.tags)

    def _get_entity_state(self, request: Any, response: Any) -> None:
        """Pose and velocity of an entity."""
        entity = self._entities.named(request.entity)
        self._fill(response.state, entity, self._update())

    def _get_entities_states(self, request: Any, response: Any) -> None:
        """Names, poses and velocities of entities."""
        from simulation_interfaces.msg import EntityState

        entities, stamp = self._entities.matching(request.filters), self._update()
        response.entities = [entity.name for entity in entities]
        response.states = [self._fill(EntityState(), entity, stamp) for entity in entities]

    def _update(self) -> int:
        """Update the entities to the current state; return its stamp in [ns]."""
        arm = self._engine.simulator.arm
        stamp, x = self._engine.queue.run(lambda: (self._stamp(), arm.x.copy()))
        self._entities.update_kinematics(x[: arm.n], x[arm.n : 2 * arm.n])
        return int(stamp)

    def _fill(self, message: Any, entity: Entity, stamp: int) -> Any:
        message.header.stamp, message.header.frame_id = to_time(stamp), "world"
        at, turn = message.pose.position, message.pose.orientation
        at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w = self._entities.pose(entity)
        v, w = message.twist.linear, message.twist.angular
        v.x, v.y, v.z, w.x, w.y, w.z = self._entities.twist(entity)
        return message
