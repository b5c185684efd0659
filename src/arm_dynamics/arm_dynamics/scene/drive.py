# SPDX-License-Identifier: Apache-2.0
"""What a scene says of the drive of a joint: its motor and what stands between motor and link.

What keys mean together is checked when the joint's own entry has been laid over that of ``"*"``:
see ``model.drive``.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator

from arm_dynamics.scene.types import Finite, NonNegative, Part, Positive


class Wave(Part):
    """Something that repeats with the motor's angle: amplitude · sin(order · angle + phase).

    Attributes:
        amplitude: In the unit of what it is a part of.
        order: How often it repeats in one turn of the motor.
        phase: In [rad].
    """

    amplitude: NonNegative
    order: Positive = 1.0
    phase: Finite = 0.0


class Actuator(Part):
    """A motor and its rigid gear. A gear of ratio N turns the motor N times as far as the joint.

    Attributes:
        command: What u is for this joint: the torque of the motor as it is at the joint in [N m]
            or [N], the motor's current in [A], or its voltage in [V].
        resistance: R of the winding in [Ω].
        inductance: L of the winding in [H]; none or 0: the current follows at once.
        torque_constant: K_t in [N m/A].
        back_emf_constant: K_e in [V s/rad]; in SI units the number is that of ``torque_constant``,
            which it is unless given.
        rotor_inertia: Of what turns with the motor in [kg m²].
        rotor_damping: Viscous friction of the motor's shaft in [N m s/rad].
        gear_ratio: N, in [rad/rad] or [rad/m]; negative where joint and motor turn opposite ways.
        efficiency: Part of the power that arrives, whichever way it flows through the gear.
        current_limit: Largest current in [A].
        voltage_limit: Largest voltage in [V].
        cogging: Torque on the rotor in [N m] from its poles.
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
    def _turns(cls, value: float) -> float:
        if value == 0.0:
            raise ValueError("any number but zero is allowed")
        return value


class Hysteresis(Part):
    """Torque that lags behind the twist of a transmission.

    Attributes:
        torque: Largest hysteretic torque in [N m] or [N].
        deflection: Twist in [rad] or [m] over which it builds up.
        sharpness: Exponent of the law; the larger, the sharper the bend.
    """

    torque: NonNegative
    deflection: Positive
    sharpness: Finite = Field(default=1.0, ge=1.0)


class Transmission(Part):
    """A flexible shaft, belt or harmonic drive between gear and link, seen at the joint.

    Attributes:
        stiffness: In [N m/rad] or [N/m].
        damping: In [N m s/rad] or [N s/m].
        stiffening: Cubic stiffness in [N m/rad³] or [N/m³].
        backlash: Width of the play in [rad] or [m].
        hysteresis: Torque that lags behind the twist.
        kinematic_error: Of the gear, at the joint, in [rad] or [m].
    """

    stiffness: Positive | None = None
    damping: NonNegative = 0.0
    stiffening: NonNegative = 0.0
    backlash: NonNegative = 0.0
    hysteresis: Hysteresis | None = None
    kinematic_error: Wave | None = None
