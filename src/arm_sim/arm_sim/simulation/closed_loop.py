# SPDX-License-Identifier: Apache-2.0
"""Simulation and controller in one process, tick by tick: like the nodes, without messages."""

import logging
import os
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from arm_dynamics import ArmModel, Dynamics, load_scene
from arm_dynamics.actuation.command_map import rigid_twin
from arm_dynamics.arrays import Array
from arm_dynamics.attributes import check_arguments, sealed, with_arguments
from arm_dynamics.control.controller import Measured
from arm_dynamics.control.custom import Maker, is_own, load_controller
from arm_dynamics.control.factory import Settings, make_controller, mismatch, overreach
from arm_dynamics.control.switch import Switch
from arm_dynamics.exceptions import UnknownArgument, not_copied
from arm_dynamics.scene.load import SceneSource
from arm_dynamics.trajectory import Limits, Trajectory, Waypoint
from arm_dynamics.trajectory.follower import Follower
from arm_sim.plant.admissible_states import warn_of_degrees
from arm_sim.recording.recording import Recording
from arm_sim.simulation.simulator import Simulator
from arm_sim.state import State

_SETTINGS = {item.name for item in fields(Settings)}

_log = logging.getLogger(__name__)


@sealed
class ClosedLoop:
    """A simulated arm and its controller, in lockstep.

    The same classes do the same work in the same order as in the sim node and the controller node,
    so a run is bit-identical to one of the two nodes in lockstep.

    Example:
        >>> pair = ClosedLoop("panda.yaml")
        >>> pair.follow([Waypoint(2.0, goal)])
        >>> recording = pair.run(3.0)
    """

    _instead = {
        "dt timestep integrator tolerance": "build another ClosedLoop(scene, dt=…, integrator=…)",
        "bandwidth damping_ratio stiffness damping settings controller control": "build another "
        "ClosedLoop(scene, controller, Settings(bandwidth=…))",
        "q v state time": "simulator.set_state(q=…, v=…) or simulator.reset(…)",
        "reference goal trajectory waypoints": "follow([Waypoint(…)])",
    }
    _parts = ("simulator",)

    def __init__(
        self, scene: SceneSource, controller: str | Maker = "computed_torque",
        settings: Settings | None = None, *, controller_scene: SceneSource | None = None,
        acceleration_limit: float = float("inf"), **simulator: Any,
    ) -> None:  # fmt: skip
        """Build the simulator and the controller.

        Args:
            scene: The simulated scene; anything ``load_scene`` accepts.
            controller: Name of the controller, see ``arm_dynamics.control.NAMES``; or a
                user-defined class, also as ``package.module:Class``.
            settings: Settings of the controller.
            controller_scene: The controller's scene; None for the simulated one.
            acceleration_limit: Acceleration limit of trajectories in [rad/s²] or [m/s²].
            **simulator: For ``Simulator``: integrator, dt, tolerance, backend.

        Raises:
            ArmError: If a scene, the controller or a setting cannot be used.
        """
        for name in simulator.keys() & _SETTINGS - {"dt"}:
            instead = f"settings=Settings({name}=…); from arm_dynamics.control import Settings"
            raise UnknownArgument(f"ClosedLoop has no argument '{name}'; {instead}")
        check_arguments(self, Simulator.__init__, simulator)
        self.simulator = Simulator(scene, **simulator)
        if controller_scene is None:  # of which the simulator has warned already
            self._dynamics = Dynamics(ArmModel(rigid_twin(self.simulator.model.scene)))
        else:
            self._dynamics = Dynamics(rigid_twin(load_scene(controller_scene)))
        settings = settings or Settings(dt=self.simulator.dt)
        if isinstance(controller, str) and is_own(controller):
            controller = load_controller(controller)
        self._control = Switch(make_controller(controller, self._dynamics, settings), settings.dt)
        sim, dynamics = self.simulator, self._dynamics
        difference = mismatch(dynamics, settings, sim.joint_names, sim.dt)
        excess = overreach(controller, dynamics, settings, sim.model.scene.delay)
        for message in filter(None, (difference, excess)):
            _log.warning("%s", message)
        limits = Limits.of(dynamics.model, acceleration_limit)
        self._follower = Follower(sim.measured.q, limits)

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        """Refuse to be copied or pickled.

        Raises:
            ArmError: Always; it says what to do instead.
        """
        raise not_copied(self, "build another one of the same scene")

    def __repr__(self) -> str:
        """The simulator."""
        return repr(self.simulator).replace("Simulator", "ClosedLoop", 1)

    @property
    def stamp(self) -> int:
        """Simulated time in [ns]."""
        return round(1e9 * self.simulator.state.time)

    @with_arguments
    def follow(self, waypoints: Sequence[Waypoint], start: int | None = None) -> Trajectory:
        """Follow waypoints from the stamp ``start`` in [ns]; see ``Follower.follow``.

        Returns:
            The motion; a warning is logged if it is slower than requested because of limits.
        """
        motion = self._follower.follow(waypoints, self.stamp, start)
        plant, q = self.simulator.arm.plant, self.simulator.state.q
        for waypoint in waypoints:
            warn_of_degrees(plant, np.asarray(waypoint.q), self.simulator.model.q0, q)
        if motion.stretch > 1.0:
            requested = motion.duration / motion.stretch
            _log.warning(
                "the motion takes %.3g s instead of %.3g s: the joints' velocity and acceleration "
                "limits allow no less", motion.duration, requested,
            )  # fmt: skip
        return motion

    @with_arguments
    def run(self, duration: float) -> Recording:
        """Advance by a duration in [s] and record every tick.

        Raises:
            InvalidInput: If the duration is not allowed.
            SimulationDiverged: If the state becomes non-finite; it has the recording so far.
        """
        return self.simulator.run(duration, self._command)

    def record(self, path: str | os.PathLike[str], duration: float) -> Path:
        """Advance by a duration in [s] and record every tick in a file; see ``Simulator``."""
        return self.simulator.record(path, duration, self._command)

    def _command(self, state: State) -> Array:
        reference = self._follower.reference(round(1e9 * state.time))
        tau = self._control.torque(Measured(state.q, state.v), reference)
        return np.asarray(self._dynamics.command_map(state.q, state.v, tau))
