# SPDX-License-Identifier: Apache-2.0
"""Exudyn: its kinematic tree in joint coordinates, stepped by its explicit solvers in C++."""

from functools import partial

import exudyn
import numpy as np
from exudyn.itemInterface import NodeGenericODE2, ObjectKinematicTree

from benchmarks.peers.base import TICK, Contestant, Vector, decades, halvings
from benchmarks.robots.models import Robot

METHODS = {
    "Euler": exudyn.DynamicSolverType.ExplicitEuler,
    "RK4": exudyn.DynamicSolverType.RK44,
    "DOPRI5": exudyn.DynamicSolverType.DOPRI5,
}
"""Its Euler takes the new velocities for the positions."""
AXES = {
    "JointModelRX": exudyn.JointType.RevoluteX,
    "JointModelRY": exudyn.JointType.RevoluteY,
    "JointModelRZ": exudyn.JointType.RevoluteZ,
}
TOLERANCES = decades(-3, -12)


def contestants() -> list[Contestant]:
    """A first-order step, the usual one of fourth order, and error control."""
    note = "one SolveDynamic a tick from Python in closed loop"
    first, fourth = halvings(8e-3, 1.2e-4), halvings(8e-3, 2.4e-4)
    ticks = halvings(TICK, 2.5e-4)
    rows = [("Euler", "step", first, ticks), ("RK4", "step", fourth, ticks),
            ("DOPRI5", "tolerance", TOLERANCES, TOLERANCES[::3])]  # fmt: skip
    return [
        Contestant("Exudyn", method, knob, settings, held, partial(ExudynTrial, method), note)
        for method, knob, settings, held in rows
    ]


class ExudynTrial:
    """A system with one tree; everything that writes files or prints is off."""

    def __init__(self, method: str, robot: Robot, setting: float) -> None:
        """Build the tree from the robot's joints and inertias."""
        self.system = exudyn.SystemContainer().AddSystem()
        self.robot, self.method = robot, METHODS[method]
        still = [0.0] * robot.n
        self.node = self.system.AddNode(
            NodeGenericODE2(
                referenceCoordinates=still, initialCoordinates=still,
                initialCoordinates_t=still, numberOfODE2Coordinates=robot.n,
            )
        )  # fmt: skip
        self.tree = self.system.AddObject(_tree(robot, self.node))
        self.system.Assemble()
        self.settings = exudyn.SimulationSettings()
        solution, time = self.settings.solutionSettings, self.settings.timeIntegration
        solution.writeSolutionToFile = solution.writeInitialValues = False
        self.settings.displayStatistics = self.settings.displayComputationTime = False
        time.verboseMode = 0
        self.step = setting if method != "DOPRI5" else 0.0
        if not self.step:
            time.relativeTolerance = time.absoluteTolerance = setting

    def reset(self, q: Vector, v: Vector) -> None:
        states = exudyn.ConfigurationType.Initial
        self.system.systemData.SetODE2Coordinates(list(q), states)
        self.system.systemData.SetODE2Coordinates_t(list(v), states)

    def advance(self, duration: float) -> None:
        time = self.settings.timeIntegration
        time.startTime, time.endTime = 0.0, duration
        time.numberOfSteps = round(duration / self.step) if self.step else 1
        time.automaticStepSize = not self.step
        exudyn.SolveDynamic(
            self.system, self.settings, solverType=self.method, updateInitialValues=True,
            storeSolver=False, showHints=False, showCausingItems=False, autoAssemble=False,
        )  # fmt: skip

    def replay(self, torques: Vector) -> None:
        for torque in torques:
            self.system.SetObjectParameter(self.tree, "jointForceVector", list(torque))
            self.advance(TICK)
        self.system.SetObjectParameter(self.tree, "jointForceVector", [0.0] * self.robot.n)

    def state(self) -> tuple[Vector, Vector]:
        data, states = self.system.systemData, exudyn.ConfigurationType.Initial
        return data.GetODE2Coordinates(states), data.GetODE2Coordinates_t(states)

    def acceleration(self, q: Vector, v: Vector, tau: Vector) -> Vector:
        self.reset(q, v)
        self.system.SetObjectParameter(self.tree, "jointForceVector", list(tau))
        solver = exudyn.MainSolverImplicitSecondOrder()
        solver.InitializeSolver(self.system, self.settings)
        solver.ComputeMassMatrix(self.system)
        solver.ComputeODE2RHS(self.system)
        mass, force = solver.GetSystemMassMatrix(), solver.GetSystemResidual()[: self.robot.n]
        self.system.SetObjectParameter(self.tree, "jointForceVector", [0.0] * self.robot.n)
        return np.linalg.solve(mass, force)


def _tree(robot: Robot, node: object) -> ObjectKinematicTree:
    model, links = robot.pin, range(1, robot.pin.njoints)
    placements = [model.jointPlacements[i] for i in links]
    inertias = [model.inertias[i] for i in links]
    return ObjectKinematicTree(
        nodeNumber=node,
        gravity=list(model.gravity.linear),
        jointTypes=[AXES[model.joints[i].shortname()] for i in links],
        linkParents=[int(model.parents[i]) - 1 for i in links],
        jointTransformations=exudyn.Matrix3DList([p.rotation for p in placements]),
        jointOffsets=exudyn.Vector3DList([p.translation for p in placements]),
        linkInertiasCOM=exudyn.Matrix3DList([inertia.inertia for inertia in inertias]),
        linkCOMs=exudyn.Vector3DList([inertia.lever for inertia in inertias]),
        linkMasses=[inertia.mass for inertia in inertias],
        jointForceVector=[0.0] * robot.n,
    )
