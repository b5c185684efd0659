# SPDX-License-Identifier: Apache-2.0
"""Keys of a joint's drive in a scene: motor, transmission between motor and link, and servo.

Combinations of keys are checked after the joint's own entry has been merged with that of ``"*"``:
see ``model.drive``.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator, model_validator

from arm_dynamics.scene.types import Finite, NonNegative, Part, Positive


class Wave(Part):
    """A periodic function of the motor's angle: amplitude · sin(order · angle + phase).

    Attributes:
        amplitude: Amplitude, in the unit of the quantity that it is part of.
        order: Periods per revolution of the motor.
        phase: Phase in [rad].
    """

    amplitude: NonNegative
    order: Positive = 1.0
    phase: Finite = 0.0


class Actuator(Part):
    """A motor and its rigid gear. With gear ratio N, the motor turns N times as far as the joint.

    Attributes:
        command: Quantity commanded at this joint: the motor's torque reflected to the joint in [N
            m] or [N], its current in [A], or its voltage in [V].
        resistance: Resistance R of the winding in [Ω]; required where a voltage is commanded or
            limited.
        inductance: Inductance L of the winding in [H]; without it, the current follows the voltage
            immediately.
        torque_constant: Torque constant K_t in [N m/A]; required where a current or a voltage is
            commanded or limited.
        back_emf_constant: Back-EMF constant K_e in [V s/rad]; by default equal to
            ``torque_constant``.
        rotor_inertia: Inertia of the rotor in [kg m²]; reflected to the joint by the gear ratio
            squared.
        rotor_damping: Viscous friction of the rotor in [N m s/rad], reflected likewise.
        gear_ratio: Gear ratio N, motor over joint, in [rad/rad] or [rad/m]; negative where they
            turn in opposite directions. Not zero.
        efficiency: Efficiency of the gear, in both directions of power flow.
        current_limit: Largest current in [A].
        voltage_limit: Largest voltage in [V]; with a current limit, it gives the torque–speed
            curve.
        cogging: Cogging torque on the rotor in [N m].
    """

    command: Literal["torque", "current", "voltage"] = "torque"
    resistance: Positive | None = None
    inductance: NonNegative | None = None
    torque_constant: Positive | None = None
    back_emf_constant: Positive | None = None
    rotor_inertia: NonNegative = 0.0
    rotor_damping: NonNegative = 0.0
    gear_ratio: Finite = 1.0
    efficiency: Positive = Field(default=1.0, le=1.0)
    current_limit: Positive | None = None
    voltage_limit: Positive | None = None
    cogging: Wave | None = None

    @field_validator("gear_ratio")
    @classmethod
    def _check_ratio(cls, value: float) -> float:
        if value == 0.0:
            raise ValueError("allowed: any number but zero")
        return value


class Hysteresis(Part):
    """Torque that lags behind the twist of a transmission.

    Attributes:
        torque: Largest hysteretic torque in [N m] or [N].
        deflection: Twist in [rad] or [m] over which it builds up.
        sharpness: Exponent of the Bouc–Wen model; the larger, the sharper the transition.
    """

    torque: NonNegative
    deflection: Positive
    sharpness: Finite = Field(default=1.0, ge=1.0)


class Transmission(Part):
    """A flexible shaft, belt or harmonic drive between gear and link, in joint coordinates.

    Attributes:
        stiffness: Stiffness in [N m/rad] or [N/m]; required.
        damping: Damping in [N m s/rad] or [N s/m].
        stiffening: Cubic stiffness in [N m/rad³] or [N/m³].
        backlash: Width of the backlash in [rad] or [m]; not together with ``hysteresis``.
        hysteresis: Hysteresis of the torque over the twist, by Bouc and Wen.
        kinematic_error: Lead of the output, at the joint, in [rad] or [m].
    """

    stiffness: Positive | None = None
    damping: NonNegative = 0.0
    stiffening: NonNegative = 0.0
    backlash: NonNegative = 0.0
    hysteresis: Hysteresis | None = None
    kinematic_error: Wave | None = None


class Servo(Part):
    """The servo of one joint, used where the joint is commanded a position or velocity.

    Attributes:
        bandwidth: ω in [rad/s] of the error dynamics ë + 2 ζ ω ė + ω² e = 0; by default 100, lower
            for long ticks and flexible transmissions.
        damping_ratio: Damping ratio ζ; 1 is critical.
        stiffness: Stiffness in [N m/rad] or [N/m], in place of a bandwidth.
        damping: Damping in [N m s/rad] or [N s/m], with a stiffness; by default by the damping
            ratio and the inertia of the joint at the start.
    """

    bandwidth: Positive | None = None
    damping_ratio: Positive = 1.0
    stiffness: Positive | None = None
    damping: Positive | None = None

    @model_validator(mode="after")
    def _check_kind(self) -> Servo:
        if self.stiffness is not None and self.bandwidth is not None:
            raise ValueError("a servo has a bandwidth or a stiffness, not both")
        if self.damping is not None and self.stiffness is None:
            raise ValueError(
                "damping belongs to a stiffness; with a bandwidth it is damping_ratio"
            )
        return self
