# SPDX-License-Identifier: Apache-2.0
"""The drives of an arm: motors, gears and transmissions between the commands and the links."""

from dataclasses import replace
from itertools import chain

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.actuation.internal_state import Flow, InternalState, StateKind, total
from arm_dynamics.arrays import Array
from arm_dynamics.equations import motor, transmission
from arm_dynamics.equations.elementary import Quantity, within
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.drive import JointDrive
from arm_dynamics.scene.drive import Transmission, Wave

_NO_STATE = ca.SX(0, 1)


def states_of(drive: JointDrive, joint: int, name: str, turning: bool) -> list[InternalState]:
    """States of a drive at the joint of an index and a name, which turns or slides."""
    unit = "rad" if turning else "m"
    states: list[tuple[StateKind, str, float]] = []
    if drive.has_current:
        scale = min(1.0, 1.0 / abs(drive.torque_constant))
        states.append((StateKind.CURRENT, "motor current [A]", scale))
    if drive.coupling:
        position, velocity = StateKind.MOTOR_POSITION, StateKind.MOTOR_VELOCITY
        states.append((position, f"motor position at the joint [{unit}]", 1.0))
        states.append((velocity, f"motor velocity at the joint [{unit}/s]", 1.0))
        if drive.coupling.hysteresis:
            states.append((StateKind.HYSTERESIS, "transmission hysteresis [1]", 1.0))
    return [InternalState(joint, kind, f"{name} {title}", scale) for kind, title, scale in states]


def rest_states(drive: JointDrive, q: float, v: float) -> list[float]:
    """States of a drive with zero current and twist at a joint's position and velocity."""
    states = [0.0] if drive.has_current else []
    if drive.coupling is None:
        return states
    error, ratio, position = drive.coupling.kinematic_error, drive.motor.gear_ratio, q
    if error:  # the motor position θ with θ + e(θ) = q, unique between q - A and q + A
        low, high = q - error.amplitude, q + error.amplitude
        while low < (position := 0.5 * (low + high)) < high:
            is_ahead = position + transmission.kinematic_error(ratio * position, error) > q
            low, high = (low, position) if is_ahead else (position, high)
    states += [position, v / (1.0 + _error_slope(error, ratio, position))]
    return [*states, 0.0] if drive.coupling.hysteresis else states


def drive_flow(drive: JointDrive, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
    """Equations of a drive, as ``Flow`` of its one joint at q and v, under the command u.

    Its states z are in the order of ``states_of``.
    """
    if drive.coupling is None:
        return _motor_flow(drive, q, v, z, u)
    first, ratio = int(drive.has_current), drive.motor.gear_ratio
    position, velocity = z[first], z[first + 1]
    source = _motor_flow(drive, position, velocity, z, u)
    link = _transmission_flow(drive.coupling, ratio, q, v, z[first:])
    error_slope = _error_slope(drive.coupling.kinematic_error, ratio, position)
    damping = drive.rotor_damping * velocity
    push = source.torque - damping - link.torque * (1.0 + error_slope)
    return Flow(
        link.torque,
        ca.vertcat(source.slope, velocity, push / drive.rotor_inertia, link.slope),
        source.stored + 0.5 * drive.rotor_inertia * velocity**2 + link.stored,
        source.supplied,
        source.lost + damping * velocity + link.lost,
    )


def _motor_flow(drive: JointDrive, position: ca.SX, velocity: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
    """The motor: torque of current and cogging on the rotor, reflected to the joint."""
    m = drive.motor
    if m.command == "torque" and m.torque_constant is None:
        flow = Flow(u, _NO_STATE, supplied=u * velocity)
    else:
        flow = _winding_flow(drive, velocity, z, u)
    if m.cogging is None:
        return flow
    rotor = m.gear_ratio * position
    poles = m.gear_ratio * motor.cogging_torque(rotor, m.cogging)
    energy = motor.cogging_energy(rotor, m.cogging)
    return replace(flow, torque=flow.torque + poles, stored=flow.stored + energy)


def _winding_flow(drive: JointDrive, velocity: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
    """The torque of the current, which is a state if a voltage acts through an inductance."""
    m, constant = drive.motor, drive.torque_constant
    emf, R = motor.back_emf(velocity, drive.back_emf_constant), m.resistance or 0.0
    if drive.has_current:
        current, limit, L = z[0], m.current_limit, m.inductance or 0.0
        voltage = motor.limited_voltage(u, current, emf, limit, R) if limit else u
        slope, stored = motor.current_slope(voltage, current, emf, L, R), 0.5 * L * current**2
    else:
        current, slope, stored = _ideal_current(drive, u, emf, R), _NO_STATE, ca.SX(0.0)
        voltage = R * current + emf
    unlimited = m.command == "torque" and not (m.current_limit or m.voltage_limit)
    torque, lost = u if unlimited else motor.torque(current, constant), R * current**2
    # The circuit gives K_e ω i, the rotor takes K_t i ω: the rest is lost, as in the iron. With
    # K_e < K_t data make power, which the account shows as a negative loss.
    if drive.back_emf_constant != constant:
        lost = lost + (drive.back_emf_constant - constant) * velocity * current
    return Flow(torque, slope, stored, voltage * current, lost)


def _ideal_current(drive: JointDrive, u: ca.SX, emf: ca.SX, R: float) -> ca.SX:
    """The current that acts at once, within the limits.

    A voltage without inductance drives it, or an ideal controller of current or torque.
    """
    m = drive.motor
    if m.command == "voltage":
        desired = motor.settled_current(u, emf, R)
    else:
        desired = u / drive.torque_constant if m.command == "torque" else u
    current = within(desired, -m.current_limit, m.current_limit) if m.current_limit else desired
    if not m.voltage_limit or m.command == "voltage":
        return current
    return motor.current_under(m.voltage_limit, current, emf, R, m.current_limit)


def _transmission_flow(c: Transmission, ratio: float, q: ca.SX, v: ca.SX, z: ca.SX) -> Flow:
    """The transmission: its torque on the link, its dissipated power, and w' of a hysteresis."""
    position, velocity, error = z[0], z[1], c.kinematic_error
    twist, rate = position - q, velocity - v
    if error:
        twist = twist + transmission.kinematic_error(ratio * position, error)
        rate = rate + velocity * _error_slope(error, ratio, position)
    engagement = transmission.engaged(twist, c.backlash) if c.backlash else twist
    elastic = transmission.elastic_torque(engagement, c.stiffness, c.stiffening)
    torque = elastic + c.damping * rate
    if c.backlash:
        torque = transmission.flank_torque(engagement, elastic, c.damping * rate)
    lost = (torque - elastic) * rate
    energy = transmission.elastic_energy(engagement, c.stiffness, c.stiffening)
    if c.hysteresis is None:
        return Flow(torque, _NO_STATE, energy, lost=lost)
    h, w = c.hysteresis, z[2]
    slope = transmission.hysteresis_slope(w, rate, h.deflection, h.sharpness)
    return Flow(
        torque + h.torque * w,
        slope,
        energy + transmission.hysteresis_energy(w, h.torque, h.deflection),
        lost=lost + h.torque * w * (rate - h.deflection * slope),
    )


def _error_slope(error: Wave | None, ratio: float, position: Quantity) -> Quantity:
    """de/dθ at a motor position reflected to the joint."""
    if error is None:
        return 0.0
    return ratio * transmission.kinematic_error_slope(ratio * position, error)


class Drives:
    """Conversion of commands to torques, for all joints of a scene that have an actuator.

    Its states are, joint by joint and where the scene has them: the motor's current if a voltage
    acts through an inductance; the motor's position and velocity reflected to the joint, and the
    state of the hysteresis, if the transmission is flexible.

    Attributes:
        title: Its name, for display.
        states: Its states.
        replaces_command: Joints that have a drive, shape (n,).
    """

    title = "motors and transmissions"

    def __init__(self, model: ArmModel) -> None:
        self._n = model.n
        self._joints = [(i, drive) for i, drive in enumerate(model.drives) if drive is not None]
        turning = model.turning.tolist()
        states = [states_of(d, i, model.joint_names[i], turning[i]) for i, d in self._joints]
        self.states: tuple[InternalState, ...] = tuple(chain(*states))
        self.replaces_command: NDArray[np.bool_] = np.array([bool(d) for d in model.drives])
        self._ends = np.cumsum([0, *map(len, states)]).tolist()

    def initial(self, q: Array, v: Array) -> Array:
        """Initial states at q, v: zero currents and twists; shape (nz,)."""
        states = [rest_states(drive, float(q[i]), float(v[i])) for i, drive in self._joints]
        return np.array([number for state in states for number in state], dtype=float)

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """Torques, rates and powers under commands u, shape (n,).

        Stored energy is magnetic, elastic, and the kinetic energy of rotors on flexible drives.
        Supplied power is voltage times current, or the mechanical power of a motor without torque
        constant. Dissipated power is the heat of windings, transmissions, and rotors on flexible
        drives.
        """
        parts = zip(self._joints, self._ends, self._ends[1:], strict=False)
        flows = [drive_flow(drive, q[i], v[i], z[a:b], u[i]) for (i, drive), a, b in parts]
        torque = ca.SX(self._n, 1)
        for (i, _), flow in zip(self._joints, flows, strict=True):
            torque[i] = flow.torque
        return Flow(
            torque,
            ca.vertcat(_NO_STATE, *(flow.slope for flow in flows)),
            total(flow.stored for flow in flows),
            total(flow.supplied for flow in flows),
            total(flow.lost for flow in flows),
        )
