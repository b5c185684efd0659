# SPDX-License-Identifier: Apache-2.0
"""Changes to a running simulation: payload, friction, and external torques.

A change is prepared in advance, which takes time; the simulator then applies the result between
two ticks. Models, plants and compiled scenes are immutable: a change creates new ones.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array
from arm_dynamics.scene.schema import validated
from arm_sim.inputs import check_row
from arm_sim.simulation.simulator import Simulator

# Applies a prepared change: fast, to be called between two ticks
Change = Callable[[], None]


def payload_change(
    simulator: Simulator, index: int, mass: float, com: ArrayLike, inertia: ArrayLike
) -> Change:
    """Prepare another payload; the scene must declare ``payload`` tunable.

    Args:
        simulator: The simulation.
        index: Index of the payload in the scene.
        mass: Mass in [kg].
        com: Centre of mass in the payload's frame in [m], shape (3,).
        inertia: ixx, ixy, ixz, iyy, iyz, izz about it in [kg m²].

    Raises:
        InvalidInput: If payloads are not tunable or there is none of that index.
        SceneError: If the numbers are not those of a rigid body.
    """
    _require_tunable(simulator, "payload")
    model = simulator.dynamics.model
    loads = [load.model_dump() for load in model.scene.payloads]
    if not 0 <= index < len(loads):
        raise InvalidInput(f"payload {index}; the scene has {len(loads)}, counted from 0")
    loads[index] |= {
        "mass": float(mass), "com": tuple(map(float, np.ravel(com))),
        "inertia": tuple(map(float, np.ravel(inertia))),
    }  # fmt: skip
    scene = validated({**model.scene.model_dump(exclude_unset=True), "payloads": loads})
    rows = [[load.mass, *load.com, *load.inertia] for load in scene.payloads]
    return _parameter_change(simulator, "payload", np.array(rows).ravel())


def friction_change(simulator: Simulator, viscous: ArrayLike) -> Change:
    """Prepare other viscous friction; the scene must declare ``friction`` tunable.

    Args:
        simulator: The simulation.
        viscous: Coefficients in [N m s/rad] or [N s/m], not negative, shape (n,).

    Raises:
        InvalidInput: If friction is not tunable or a number is not allowed.
    """
    _require_tunable(simulator, "friction")
    values = check_row("viscous", viscous, simulator.n)
    return _parameter_change(simulator, "friction", values)


def external_change(simulator: Simulator) -> Change:
    """Prepare a simulation for external torques: the parameter ``external`` of shape (n,).

    A simulation without them computes nothing for them; the equations are rebuilt here.
    """
    arm = simulator.arm
    compiled = arm.compiled.with_external_torques()
    if compiled is arm.compiled:
        return lambda: None
    compiled.energy_account.prepare()
    if arm.compiled.has_servo:
        compiled.servo  # noqa: B018 - builds what the loop should not have to wait for
    return lambda: arm.use(compiled)


def _require_tunable(simulator: Simulator, name: str) -> None:
    """Reject a quantity that is not tunable."""
    parameters, p = simulator.arm.plant.parameters, simulator.arm.parameters
    parameters.merged({name: parameters.of(name, p)}, p)


def _parameter_change(simulator: Simulator, name: str, value: Array) -> Change:
    compiled, p = simulator.arm.compiled, simulator.arm.parameters
    compiled.present.without_external(compiled.plant.parameters.merged({name: value}, p))
    compiled.energy_account.prepare()
    return lambda: simulator.set_parameter(name, value)
