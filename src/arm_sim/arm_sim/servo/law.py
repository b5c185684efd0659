# SPDX-License-Identifier: Apache-2.0
"""The servo controller as an expression, and its gains from the scene."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.actuation import StateKind
from arm_dynamics.actuation.command_map import CommandMap, rigid_twin
from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.control.computed_torque import held_torque
from arm_dynamics.control.pole_placement import held_gains
from arm_dynamics.equations import rigid_body, spring
from arm_dynamics.equations.elementary import within
from arm_dynamics.equations.tree import constant
from arm_sim.plant.parameters import Parameters
from arm_sim.plant.plant import Plant
from arm_sim.plant.symbols import Symbols

# Default bandwidth ω in [rad/s]; lower where ticks are longer than a fifth of 1/ω, or a
# transmission would oscillate.
BANDWIDTH, OF_A_TICK = 100.0, 0.2
# Largest bandwidth relative to the natural frequency of a link on its transmission with the motor
# held.
OF_A_TRANSMISSION = 0.5
# Speed in [rad/s] or [m/s] from which dry friction is fully compensated; below, proportionally,
# which prevents chatter when holding.
SLOW = 1e-2
# Smallest fraction of the desired acceleration, however weak the drives.
LEAST = 1e-2
# Margin to a limit, such that rounding does not saturate the drive.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Gains:
    """Gains of the servos, each of shape (n,).

    The position loop sets the speed v_d + ratio (q_d - q); the velocity loop sets the
    acceleration, ``rate`` times the speed error, or the torque, ``damping`` times it.

    Attributes:
        ratio: Gain of the position loop in [1/s].
        rate: Gain of the velocity loop in [1/s], zero for joints with a given stiffness.
        damping: Torque gain in [N m s/rad] or [N s/m], zero for the others.
    """

    ratio: Array
    rate: Array
    damping: Array

    @classmethod
    def of(cls, model: ArmModel, soft: Array, dt: float) -> Gains:
        """Gains of the scene's ``servo`` keys.

        Args:
            model: The arm, with rigid transmissions.
            soft: Compliance of the actual transmissions, see ``flexibility``, shape (n,).
            dt: Time in [s] for which a command is held.
        """
        chosen = [model.scene.joint(name).servo for name in model.joint_names]
        ratio = np.array([servo.damping_ratio for servo in chosen])
        given = np.array([servo.bandwidth or np.nan for servo in chosen])
        bandwidth = np.where(np.isnan(given), default_bandwidth(model, soft, dt), given)
        kp, kd = held_gains(bandwidth, ratio, model.n, dt)
        stiffness = np.array([servo.stiffness or np.nan for servo in chosen])
        critical = 2.0 * ratio * np.sqrt(stiffness * inertia(model))
        damping = np.where([servo.damping is None for servo in chosen], critical, [
            servo.damping or 0.0 for servo in chosen
        ])  # fmt: skip
        stiff = ~np.isnan(stiffness)
        return cls(
            np.where(stiff, stiffness / damping, kp / kd),
            np.where(stiff, 0.0, kd),
            np.where(stiff, damping, 0.0),
        )


@one_at_a_time
def inertia(model: ArmModel) -> Array:
    """Joint inertias at the initial position, diag M(q₀) in [kg m²] or [kg], shape (n,)."""
    s = Symbols(model, Parameters(model))
    M = ca.Function("M", [s.q, s.p], [ca.diag(rigid_body.mass_matrix(s.tree, s.q))])
    return np.array(M(model.q0, Parameters(model).nominal)).ravel()


def default_bandwidth(model: ArmModel, soft: Array, dt: float) -> Array:
    """Default bandwidths in [rad/s], shape (n,)."""
    most = min(BANDWIDTH, OF_A_TICK / dt)
    if not soft.any():
        return np.full(model.n, most)
    swinging = np.sqrt(np.maximum(soft * inertia(model), OF_A_TRANSMISSION**2 / most**2))
    return np.minimum(most, OF_A_TRANSMISSION / swinging)


def servo_law(plant: Plant, dt: float) -> ca.Function:
    """The servos of an arm.

    Each joint has a cascade of a position and a velocity loop, as in industrial drives, with the
    set speed within the joint's limit; the accelerations are converted to torques of the whole
    arm, τ = M a + C v + G + F, so joints are decoupled and holding has no steady-state error
    (computed torque: Craig, Introduction to Robotics, section 10.4; for the middle of the tick and
    with gains for a torque that is held, see ``ComputedTorque``). A joint with a given stiffness
    gets its torque in addition to gravity compensation. Where a drive would saturate, the
    accelerations of all joints are reduced by one factor.

    Behind a flexible transmission a servo controls the motor position, as encoders measure it, and
    adds the twist due to gravity: feedback of the link position through a spring would be unstable
    (Tomei, "A simple PD controller for robots with elastic joints", IEEE Trans. Automatic Control
    36(10), 1991).

    Args:
        plant: The arm; tunable payloads and gravity are inputs.
        dt: Time in [s] for which a command is held.

    Returns:
        CasADi function ``servo`` (x, r, p) -> commands of shape (n,), with r the rows of
        ``Setpoints``: 1 or 0 for joints that track a velocity and a position; q_d, v_d and the
        added effort, which is applied alone where neither is tracked.
    """
    model, n = plant.model, plant.model.n
    rigid = rigid_model(model)
    gains, s = Gains.of(rigid, flexibility(model), dt), Symbols(rigid, plant.parameters)
    x, r = ca.SX.sym("x", plant.nx), ca.SX.sym("r", 5 * n)
    q, v = _encoders(plant, x)
    moves, leads, q_d, v_d, added = ca.vertsplit(r, n)
    inverse = partial(spring.frictionless, rigid.springs, s.tree, gravity=s.gravity)
    still = ca.SX(n, 1)
    twist = constant(flexibility(model)) * inverse(q, still, still)
    wanted = v_d + leads * constant(gains.ratio) * (q_d - (q - twist))
    limit = constant(np.minimum(model.velocity_limit, np.finfo(float).max))
    wanted = within(wanted, -limit, limit)
    missing = moves * (wanted - v)
    direction = within(wanted / SLOW, -1.0, 1.0)
    friction, commands = SteadyFriction.of(rigid), CommandMap(rigid)

    def command_for(a: ca.SX) -> ca.SX:
        tau = held_torque(inverse, friction, (q, v, a), direction, dt)
        return ca.SX(commands(q, v, tau + constant(gains.damping) * missing))

    standing = command_for(still)
    quickening = command_for(constant(gains.rate) * missing) - standing
    acting = standing + commands.compensation(q)
    command = standing + _possible(acting, moves * quickening, model) * quickening + added
    acts = [ca.if_else(moves[i] > 0, command[i], added[i]) for i in range(n)]
    return ca.Function("servo", [x, r, s.p], [ca.densify(ca.vertcat(*acts))], {"cse": True})


def _possible(acting: ca.SX, quickening: ca.SX, model: ArmModel) -> ca.SX:
    """Largest fraction of an acceleration, at most 1, for which no drive saturates.

    If each drive were clipped separately, saturated drives would disturb the other joints.
    """
    part = ca.SX(1)
    for i in np.flatnonzero(np.isfinite(model.standing_limit)).tolist():
        left = ca.sign(quickening[i]) * (1.0 - ROUNDING) * model.standing_limit[i] - acting[i]
        part = ca.fmin(part, ca.if_else(quickening[i] == 0, 1, left / quickening[i]))
    return ca.fmax(LEAST, part)


def rigid_model(model: ArmModel) -> ArmModel:
    """The arm with rigid transmissions, by which the servos compute their torques."""
    twin = rigid_twin(model.scene)
    return model if twin is model.scene else ArmModel(twin)


def flexibility(model: ArmModel) -> Array:
    """Twist per torque of the joints' transmissions in [rad/(N m)] or [m/N], shape (n,)."""
    soft = (drive.coupling if drive else None for drive in model.drives)
    return np.array([1.0 / each.stiffness if each and each.stiffness else 0.0 for each in soft])


def _encoders(plant: Plant, x: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Positions and velocities measured by the servos, reflected to the joints."""
    n, states = plant.model.n, plant.laws.states
    q, v = ca.SX(x[:n]), ca.SX(x[n : 2 * n])
    for k, state in enumerate(states, 2 * n):
        if state.kind is StateKind.MOTOR_POSITION:
            q[state.joint] = x[k]
        if state.kind is StateKind.MOTOR_VELOCITY:
            v[state.joint] = x[k]
    return q, v
