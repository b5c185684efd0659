# SPDX-License-Identifier: Apache-2.0
"""Changes to a running simulation: payload, friction, and pushes from outside."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics import ArmModel, Dynamics, InvalidInput
from arm_dynamics.arrays import vector
from arm_dynamics.model.arm import Array
from arm_dynamics.scene.schema import validated
from arm_sim.plant.plant import Plant
from arm_sim.recording.energy_account import Audit
from arm_sim.simulator import Simulator
from arm_sim.stepping.factory import Steppers

EXTERNAL = "external"
Change = Callable[[], None]
_CACHED = ("plan", "_linearizer", "_rollouts")


def payload_change(
    simulator: Simulator, index: int, mass: float, com: ArrayLike, inertia: ArrayLike
) -> Change:
    """Prepare another payload; the scene has to declare ``payload`` tunable.

    Args:
        simulator: The simulation.
        index: Which of the scene's payloads.
        mass: In [kg].
        com: Centre of mass in the payload's frame in [m], shape (3,).
        inertia: ixx, ixy, ixz, iyy, iyz, izz about it in [kg m²].

    Returns:
        What puts it in force, quick, to be called between two ticks.

    Raises:
        InvalidInput: If payloads are not tunable or there is none of that index.
        SceneError: If the numbers are no rigid body's.
    """
    _demand(simulator, "payload")
    loads = [load.model_dump() for load in simulator.dynamics.model.scene.payloads]
    if not 0 <= index < len(loads):
        raise InvalidInput(f"payload {index}; the scene has {len(loads)}, counted from 0")
    loads[index] |= {
        "mass": float(mass), "com": tuple(map(float, np.ravel(com))),
        "inertia": tuple(map(float, np.ravel(inertia))),
    }  # fmt: skip
    scene = simulator.dynamics.model.scene
    scene = validated({**scene.model_dump(exclude_unset=True), "payloads": loads})
    rows = [[load.mass, *load.com, *load.inertia] for load in scene.payloads]
    model = ArmModel(scene)
    _with_viscous(model, simulator.dynamics.model.viscous)
    return _change(simulator, "payload", np.array(rows).ravel(), model)


def friction_change(simulator: Simulator, viscous: ArrayLike) -> Change:
    """Prepare other viscous friction; the scene has to declare ``friction`` tunable.

    Args:
        simulator: The simulation.
        viscous: In [N m s/rad] or [N s/m], not negative, shape (n,).

    Returns:
        What puts it in force, quick, to be called between two ticks.

    Raises:
        InvalidInput: If friction is not tunable or a number is not allowed.
    """
    _demand(simulator, "friction")
    values = vector("viscous", viscous, simulator.n)
    if values.ndim != 1 or values.min() < 0.0:
        raise InvalidInput(
            f"viscous = {values}; {simulator.n} numbers of at least zero are wanted"
        )
    model = ArmModel(simulator.dynamics.model.scene)
    _with_viscous(model, values)
    return _change(simulator, "friction", values, model)


def external_change(simulator: Simulator) -> Change:
    """Prepare a simulation for pushes from outside: the parameter ``external`` of shape (n,).

    A simulation that nobody pushes computes nothing for it; the equations are built anew here.

    Returns:
        What puts it in force, quick, to be called between two ticks.
    """
    scene = simulator.model.scene
    if EXTERNAL in scene.tunable:
        return lambda: None
    model = ArmModel(scene.model_copy(update={"tunable": (*scene.tunable, EXTERNAL)}))
    plant = Plant(model)
    steppers = Steppers(plant, simulator.choice, simulator.backend)
    audit = Audit(plant, simulator.dynamics, simulator.choice, simulator.backend)
    audit.prepare()

    def change() -> None:
        before, p = simulator.plant.parameters, simulator.parameters
        values = {name: before.of(name, p) for name in before.names}
        steppers.plain.p[:] = plant.parameters.merged(values, steppers.plain.p)
        simulator.plant, simulator.model, simulator.audit = plant, model, audit
        simulator._use(steppers)
        for name in _CACHED:
            simulator.__dict__.pop(name, None)

    return change


def _with_viscous(model: ArmModel, values: Array) -> None:
    model.friction, model.viscous = replace(model.friction, viscous=values), values


def _demand(simulator: Simulator, name: str) -> None:
    simulator.plant.parameters.merged({name: _current(simulator, name)}, simulator._stepper.p)


def _current(simulator: Simulator, name: str) -> Any:
    found = [item.nominal for item in simulator.plant.parameters.items if item.name == name]
    return found[0] if found else np.zeros(1)


def _change(simulator: Simulator, name: str, values: Array, model: ArmModel) -> Change:
    dynamics = Dynamics(model)
    audit = Audit(simulator.plant, dynamics, simulator.choice, simulator.backend)
    audit.prepare()

    def change() -> None:
        simulator.set_parameter(name, values)
        simulator.dynamics, simulator.audit = dynamics, audit

    return change
