# SPDX-License-Identifier: Apache-2.0
"""Drake: a continuous MultibodyPlant under its error-controlled integrators."""

from functools import partial

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from benchmarks.peers.base import TICK, Contestant, Vector, decades
from benchmarks.robots.models import Robot

METHODS = {"RK3": "runge_kutta3", "RK5": "runge_kutta5"}


def contestants() -> list[Contestant]:
    """The explicit error-controlled pairs; RK3 is the default of its Simulator."""
    reach = {"RK3": decades(-2, -9), "RK5": decades(-2, -12)}
    held = {"RK3": decades(-3, -7), "RK5": decades(-3, -7)}
    note = "one AdvanceTo a tick from Python in closed loop"
    return [
        Contestant(
            "Drake", name, "tolerance", reach[name], held[name], partial(DrakeTrial, name), note
        )
        for name in METHODS
    ]


class DrakeTrial:
    """A Simulator of one plant; the torque enters as a generalized force."""

    def __init__(self, method: str, robot: Robot, accuracy: float) -> None:
        plant = MultibodyPlant(time_step=0.0)
        Parser(plant).AddModelsFromString(robot.urdf, "urdf")
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("link0"))
        plant.Finalize()
        self.plant = plant
        self.simulator = Simulator(plant)
        self.context = self.simulator.get_mutable_context()
        self.port = plant.get_applied_generalized_force_input_port()
        self.torque = self.port.FixValue(self.context, np.zeros(robot.n))
        config = SimulatorConfig(
            integration_scheme=METHODS[method], max_step_size=0.1, accuracy=accuracy
        )
        ApplySimulatorConfig(config, self.simulator)

    def reset(self, q: Vector, v: Vector) -> None:
        self.context.SetTime(0.0)
        self._set(q, v, np.zeros_like(q))
        self.simulator.Initialize()

    def advance(self, duration: float) -> None:
        self.simulator.AdvanceTo(self.context.get_time() + duration)

    def replay(self, torques: Vector) -> None:
        first = round(self.context.get_time() / TICK)
        for k, tau in enumerate(torques, first + 1):
            self.torque.GetMutableData().set_value(tau)
            self.simulator.AdvanceTo(k * TICK)

    def state(self) -> tuple[Vector, Vector]:
        plant, context = self.plant, self.context
        return plant.GetPositions(context).copy(), plant.GetVelocities(context).copy()

    def acceleration(self, q: Vector, v: Vector, tau: Vector) -> Vector:
        self._set(q, v, tau)
        change = self.plant.EvalTimeDerivatives(self.context)
        return change.get_generalized_velocity().CopyToVector()

    def _set(self, q: Vector, v: Vector, tau: Vector) -> None:
        self.torque.GetMutableData().set_value(tau)
        self.plant.SetPositions(self.context, q)
        self.plant.SetVelocities(self.context, v)
