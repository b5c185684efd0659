# SPDX-License-Identifier: Apache-2.0
"""From a reference or command to the effective command: controller, if any, then limits."""

from collections.abc import Callable

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel, Dynamics
from arm_dynamics.actuation.command_map import CommandMap, gravity_compensated
from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.control.compiled_law import command_function
from arm_dynamics.control.computed_torque import ComputedTorque
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.trajectory.reference import Reference
from arm_sim.plant.plant import Plant
from arm_sim.plant.symbols import dense_function


@frozen
class CompiledControl:
    """A controller in compiled code, evaluated once a tick at the state at its beginning.

    Attributes:
        law: CasADi function (x, r) -> command of shape (n,), with x = (q, v).
        reference: Rows r of references for times of shape (k,) in [s].
    """

    law: ca.Function
    reference: Callable[[Array], Array]


def computed_torque(
    model: ArmModel, sample: Callable[[float], Reference], bandwidth: float | Array = 20.0,
    damping_ratio: float | Array = 1.0, dt: float = 1e-3,
) -> CompiledControl:  # fmt: skip
    """Computed torque as ``arm_dynamics.control.ComputedTorque``, compiled into the simulator.

    Args:
        model: The controller's model; it may differ from the plant's, to study model errors.
        sample: Reference at a time, such as ``Trajectory.sample``.
        bandwidth: ω in [rad/s], a number or shape (n,).
        damping_ratio: ζ, a number or shape (n,).
        dt: Time in [s] for which a torque is held, 0 for none.

    Returns:
        A controller for ``Simulator.run``; it returns commands of the model's drives.

    Raises:
        InvalidInput: If a gain or dt is not allowed.
    """
    if not isinstance(model, ArmModel):
        raise InvalidInput(f"model = {model!r}; an ArmModel is expected, such as dynamics.model")
    law = ComputedTorque(Dynamics(model), bandwidth, damping_ratio, dt)
    numbers = np.concatenate(law.tuning)

    def reference_rows(times: Array) -> Array:
        motion = np.array([_row(sample(t)) for t in times]).reshape(len(times), 3 * model.n)
        return np.hstack([motion, np.tile(numbers, (len(times), 1))])

    return CompiledControl(command_function(law, model), reference_rows)


@one_at_a_time
def actuation(
    plant: Plant, control: CompiledControl | None = None, *, compensated: bool = True
) -> ca.Function:
    """Compose controller, the arm's own gravity compensation, if any, and limits.

    Args:
        plant: The plant, for its limits.
        control: A controller, or None if commands are given directly.
        compensated: Whether that compensation must be added to commands.

    Returns:
        CasADi function ``actuate`` (x, r) -> effective command, shape (n,): a torque, or the
        command of the joint's drive.
    """
    n = plant.model.n
    x = ca.SX.sym("x", plant.nx)
    r = ca.SX.sym("r", control.law.size1_in(1) if control else n)
    command = control.law(x[: 2 * n], r) if control else r
    if compensated and gravity_compensated(plant.model.scene):
        command = command + CommandMap(plant.model).compensation(x[:n])
    limit = plant.model.command_limit
    bounded = [
        ca.fmax(-limit[i], ca.fmin(limit[i], command[i])) if np.isfinite(limit[i]) else command[i]
        for i in range(n)
    ]
    return ca.Function("actuate", [x, r], [ca.vertcat(*bounded)], {"cse": True})


def actuation_slopes(plant: Plant) -> ca.Function:
    """CasADi function ``acting`` (x, r) -> effective command, and its derivatives by x and r."""
    actuate = actuation(plant)
    x, r = (ca.SX.sym(name, actuate.size1_in(i)) for i, name in enumerate("xr"))
    u = actuate(x, r)
    return dense_function("acting", [x, r], u, ca.jacobian(u, x), ca.jacobian(u, r))


def _row(reference: Reference) -> Array:
    if reference.tau is not None:
        raise InvalidInput("the motion has torques; allowed: a motion without them")
    return np.concatenate([reference.q, reference.v, reference.a])
