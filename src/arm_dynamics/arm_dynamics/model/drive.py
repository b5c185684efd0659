# SPDX-License-Identifier: Apache-2.0
"""Parameters of the drive of one joint, validated together."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from arm_dynamics.exceptions import SceneError
from arm_dynamics.scene.drive import Actuator, Transmission
from arm_dynamics.scene.schema import Joint, Scene


@dataclass(frozen=True)
class JointDrive:
    """A motor with its gear and an optional flexible transmission.

    Attributes:
        motor: Motor and gear.
        coupling: Flexible transmission between gear and link; None for a rigid drive, whose rotor
            turns with the joint.
    """

    motor: Actuator
    coupling: Transmission | None

    @property
    def rotor_inertia(self) -> float:
        """Rotor inertia reflected to the joint, J N², in [kg m²] or [kg]."""
        return self.motor.rotor_inertia * self.motor.gear_ratio**2

    @property
    def rotor_damping(self) -> float:
        """Rotor damping reflected to the joint, b N², in [N m s/rad] or [N s/m]."""
        return self.motor.rotor_damping * self.motor.gear_ratio**2

    @property
    def armature(self) -> float:
        """Rotor inertia added to the joint in [kg m²] or [kg]; 0 with a flexible transmission."""
        return 0.0 if self.coupling else self.rotor_inertia

    @property
    def viscous(self) -> float:
        """Rotor damping added to the joint's viscous friction; 0 with a flexible transmission."""
        return 0.0 if self.coupling else self.rotor_damping

    @property
    def torque_constant(self) -> float:
        """Torque constant reflected to the joint, N K_t, in [N m/A] or [N/A]."""
        return (self.motor.torque_constant or 1.0) * self.motor.gear_ratio

    @property
    def back_emf_constant(self) -> float:
        """Back-EMF constant reflected to the joint, N K_e, in [V s/rad] or [V s/m]."""
        motor = self.motor
        return (motor.back_emf_constant or motor.torque_constant or 0.0) * motor.gear_ratio

    @property
    def has_current(self) -> bool:
        """Whether the current is a state: a voltage drives the motor through an inductance."""
        return self.motor.command == "voltage" and bool(self.motor.inductance)

    @property
    def transmission(self) -> str:
        """The transmission between motor and link, for display."""
        if self.coupling is None:
            return "rigid"
        keys = ("stiffening", "backlash", "hysteresis", "kinematic_error")
        details = [key.replace("_", " ") for key in keys if getattr(self.coupling, key)]
        return ", ".join([f"flexible, {self.coupling.stiffness:g}", *details])

    @property
    def torque_limit(self) -> float:
        """Largest torque at rest that current and voltage limits allow, in [N m] or [N].

        A motor that brakes may give more: the back-EMF helps the voltage.
        """
        stall = (self.motor.voltage_limit or np.inf) / (self.motor.resistance or 1.0)
        return min(self.current_torque, abs(self.torque_constant) * stall)

    @property
    def overspeed(self) -> float:
        """Speed of the joint from which the current limit leaves the voltage above its limit.

        In [rad/s] or [m/s]; inf without both limits.
        """
        motor, emf = self.motor, abs(self.back_emf_constant)
        if not (motor.voltage_limit and motor.current_limit and emf):
            return np.inf
        return (motor.voltage_limit + (motor.resistance or 0.0) * motor.current_limit) / emf

    @property
    def current_torque(self) -> float:
        """Largest torque that the current limit allows at any speed, in [N m] or [N]."""
        return abs(self.torque_constant) * (self.motor.current_limit or np.inf)

    @property
    def passes_torque(self) -> bool:
        """Whether the command is the joint's torque and the motor has nothing but inertia."""
        plain = self.motor.command == "torque" and self.motor.torque_constant is None
        return plain and self.motor.cogging is None and self.coupling is None

    def command_limit(self, effort: float) -> float:
        """Largest command at any speed, in the command's unit.

        A voltage limit bounds torques and currents by the speed, see ``motor.current_under``: not
        the command, but what acts. The largest torque of the joint, inf for none, does not limit a
        voltage.
        """
        motor = self.motor
        if motor.command == "voltage":
            return motor.voltage_limit or np.inf
        if motor.command == "torque":
            return min(effort, self.current_torque)
        return min(motor.current_limit or np.inf, effort / abs(self.torque_constant))

    def command_unit(self, torque: str) -> str:
        """Unit of the command; ``torque`` is the unit of the joint's torque."""
        return {"torque": torque, "current": "A", "voltage": "V"}[self.motor.command]


def drives_of(
    scene: Scene, free: Iterable[str], followers: Iterable[str]
) -> list[JointDrive | None]:
    """Drives of the independent joints (``free``), None for joints without one.

    Raises:
        SceneError: If the keys of a drive contradict one another, or a mimic joint has a drive.
    """
    for name in followers:
        if (own := scene.joints.get(name)) is None:
            continue
        servo = own.servo if own.servo.model_fields_set else None
        for key, part in (("actuator", own.actuator or own.transmission), ("servo", servo)):
            if part:
                raise SceneError(
                    f"scene: 'joints.{name}.{key}': a mimic joint has none of its own; "
                    "the joint that it follows may have one"
                )
    return [_drive(f"scene: 'joints.{name}", scene.joint(name)) for name in free]


def _drive(where: str, joint: Joint) -> JointDrive | None:
    motor, coupling = joint.actuator, joint.transmission
    if motor is None and coupling is None:
        return None
    if motor is None or (coupling and motor.rotor_inertia == 0.0):
        inertia = "is missing" if motor is None else f"= {motor.rotor_inertia}"
        raise SceneError(
            f"{where}.actuator.rotor_inertia' {inertia}: a flexible transmission carries the "
            "rotor on a spring, so the rotor needs an inertia of more than zero"
        )
    direct, limit = motor.command == "torque", motor.voltage_limit
    for key, is_required, limit_key in (
        ("torque_constant", not direct or motor.current_limit or limit, "current_limit"),
        ("resistance", motor.command == "voltage" or limit, "voltage_limit"),
    ):
        if is_required and getattr(motor, key) is None:
            reason = limit_key if direct else f"command: {motor.command}"
            raise SceneError(
                f"{where}.actuator.{key}' is missing: '{reason}' requires a positive number"
            )
    if coupling is None:
        return JointDrive(motor, None)
    if coupling.hysteresis and coupling.hysteresis.torque == 0.0:
        coupling = coupling.model_copy(update={"hysteresis": None})
    if coupling.stiffness is None:
        raise SceneError(
            f"{where}.transmission.stiffness' is missing: a positive number is expected; "
            "a rigid drive has no 'transmission'"
        )
    if coupling.backlash and coupling.hysteresis:
        raise SceneError(
            f"{where}.transmission.backlash' = {coupling.backlash}: not allowed with "
            "'hysteresis', since teeth without contact transmit no torque"
        )
    error = coupling.kinematic_error
    if error and error.amplitude * error.order * abs(motor.gear_ratio) >= 1.0:
        raise SceneError(
            f"{where}.transmission.kinematic_error.amplitude' = {error.amplitude}: amplitude · "
            f"order · |gear_ratio| = {error.amplitude * error.order * abs(motor.gear_ratio):g} "
            "must stay below 1, or the output would reverse while the motor continues"
        )
    return JointDrive(motor, coupling)
