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
from arm_sim.plant.symbols import Symbols, dense_function

# Default bandwidth ω in [rad/s]; lower where a transmission would oscillate, or ticks are longer
# than this fraction of 1/ω.
BANDWIDTH, TICK_FRACTION = 100.0, 0.2
# Largest bandwidth relative to the natural frequency of a link on its transmission with the motor
# held.
TRANSMISSION_FRACTION = 0.5
# Speed in [rad/s] or [m/s] from which dry friction is fully compensated; below, proportionally,
# which prevents chatter when holding.
FRICTION_SPEED = 1e-2
# Smallest fraction of the desired acceleration, however weak the drives.
MIN_FRACTION = 1e-2
# Margin to a limit, such that rounding does not saturate the drive.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Gains:
    """Gains of the servos, each of shape (n,).

    The position loop sets the speed v_d + ``position`` (q_d - q); the velocity loop sets the
    acceleration, ``velocity`` times the speed error, or the torque, ``damping`` times it.

    Attributes:
        position: Gain of the position loop in [1/s].
        velocity: Gain of the velocity loop in [1/s], zero for joints with a given stiffness.
        damping: Torque gain in [N m s/rad] or [N s/m], zero for the others.
    """

    position: Array
    velocity: Array
    damping: Array

    @classmethod
    def of(cls, model: ArmModel, compliance: Array, dt: float) -> Gains:
        """Gains of the scene's ``servo`` keys.

        Args:
            model: The arm, with rigid transmissions.
            compliance: Compliance of the actual transmissions, see ``flexibility``, shape (n,).
            dt: Time in [s] for which a command is held.
        """
        servos = [model.scene.joint(name).servo for name in model.joint_names]
        inertia = _inertia(model)
        damping_ratio = np.array([servo.damping_ratio for servo in servos])
        defaults = _default_bandwidth(inertia, compliance, dt).tolist()
        bandwidth = [s.bandwidth or default for s, default in zip(servos, defaults, strict=True)]
        kp, kd = held_gains(np.array(bandwidth), damping_ratio, model.n, dt)
        stiffness = np.array([servo.stiffness or np.nan for servo in servos])
        damping = 2.0 * damping_ratio * np.sqrt(stiffness * inertia)
        for i, servo in enumerate(servos):
            if servo.damping is not None:
                damping[i] = servo.damping
        stiff = ~np.isnan(stiffness)
        return cls(
            np.where(stiff, stiffness / damping, kp / kd),
            np.where(stiff, 0.0, kd),
            np.where(stiff, damping, 0.0),
        )


@one_at_a_time
def _inertia(model: ArmModel) -> Array:
    """Joint inertias at the initial position, diag M(q₀) in [kg m²] or [kg], shape (n,)."""
    s = Symbols(model, Parameters(model))
    M = ca.Function("M", [s.q, s.p], [ca.diag(rigid_body.mass_matrix(s.tree, s.q))])
    return np.array(M(model.q0, Parameters(model).nominal)).ravel()


def _default_bandwidth(inertia: Array, compliance: Array, dt: float) -> Array:
    """Default bandwidths in [rad/s], shape (n,)."""
    highest = min(BANDWIDTH, TICK_FRACTION / dt)
    if not compliance.any():
        return np.full(len(inertia), highest)
    smallest = TRANSMISSION_FRACTION**2 / highest**2
    period = np.sqrt(np.maximum(compliance * inertia, smallest))  # over 2 pi
    return np.minimum(highest, TRANSMISSION_FRACTION / period)


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
        feed-forward effort, which is applied alone where neither is tracked.
    """
    model, n = plant.model, plant.model.n
    rigid = rigid_model(model)
    gains, s = Gains.of(rigid, flexibility(model), dt), Symbols(rigid, plant.parameters)
    x, r = ca.SX.sym("x", plant.nx), ca.SX.sym("r", 5 * n)
    q, v = _encoders(plant, x)
    tracks_velocity, tracks_position, q_d, v_d, effort = ca.vertsplit(r, n)
    inverse = partial(spring.frictionless, rigid.springs, s.tree, gravity=s.gravity)
    zero = ca.SX(n, 1)
    twist = constant(flexibility(model)) * inverse(q, zero, zero)
    set_speed = v_d + tracks_position * constant(gains.position) * (q_d - (q - twist))
    limit = constant(np.minimum(model.velocity_limit, np.finfo(float).max))
    set_speed = within(set_speed, -limit, limit)
    speed_error = tracks_velocity * (set_speed - v)
    direction = within(set_speed / FRICTION_SPEED, -1.0, 1.0)
    friction, commands = SteadyFriction.of(rigid), CommandMap(rigid)

    def command_for(a: ca.SX) -> ca.SX:
        tau = held_torque(inverse, friction, (q, v, a), direction, dt)
        return ca.SX(commands(q, v, tau + constant(gains.damping) * speed_error))

    bias = command_for(zero)
    acceleration = command_for(constant(gains.velocity) * speed_error) - bias
    base, extra = bias + commands.compensation(q), tracks_velocity * acceleration
    fraction = _unsaturated_fraction(base, extra, model)
    command = bias + fraction * acceleration + effort
    acts = [ca.if_else(tracks_velocity[i] > 0, command[i], effort[i]) for i in range(n)]
    return dense_function("servo", [x, r, s.p], ca.vertcat(*acts))


def _unsaturated_fraction(bias: ca.SX, acceleration: ca.SX, model: ArmModel) -> ca.SX:
    """Largest fraction of the commands of an acceleration, at most 1, that saturates no drive.

    If each drive were clipped separately, saturated drives would disturb the other joints.

    Args:
        bias: Commands without the acceleration.
        acceleration: Commands for it, to be added.
        model: The arm.
    """
    fraction = ca.SX(1)
    for i in np.flatnonzero(np.isfinite(model.standing_limit)).tolist():
        limit = ca.sign(acceleration[i]) * (1.0 - ROUNDING) * model.standing_limit[i]
        share = (limit - bias[i]) / acceleration[i]
        fraction = ca.fmin(fraction, ca.if_else(acceleration[i] == 0, 1, share))
    return ca.fmax(MIN_FRACTION, fraction)


def rigid_model(model: ArmModel) -> ArmModel:
    """The arm with rigid transmissions, by which the servos compute their torques."""
    twin = rigid_twin(model.scene)
    return model if twin is model.scene else ArmModel(twin)


def flexibility(model: ArmModel) -> Array:
    """Twist per torque of the joints' transmissions in [rad/(N m)] or [m/N], shape (n,)."""
    couplings = (drive.coupling if drive else None for drive in model.drives)
    return np.array([1.0 / c.stiffness if c and c.stiffness else 0.0 for c in couplings])


def _encoders(plant: Plant, x: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Positions and velocities measured by the servos, reflected to the joints."""
    n = plant.model.n
    q, v = ca.SX(x[:n]), ca.SX(x[n : 2 * n])
    for measured, kind in ((q, StateKind.MOTOR_POSITION), (v, StateKind.MOTOR_VELOCITY)):
        places, joints = plant.laws.places(kind)
        measured[joints.tolist()] = x[places.tolist()]
    return q, v
