# SPDX-License-Identifier: Apache-2.0
"""Motors and transmissions (docs/concepts/drives.md, Actuation)."""

from collections.abc import Mapping
from math import cos, sin
from typing import Any

import numpy as np
from scipy.optimize import brentq

from .description import only
from .flow import Flow, Law

Array = np.ndarray


class Torque(Law):
    """A joint without actuator: the command is its torque."""

    def __init__(self, joint: int) -> None:
        self.joint = joint

    def flow(self, q: float, v: float, z: Array, u: float, signs: Array) -> Flow:
        return Flow(u, supplied=u * v)


class Motor(Law):
    """A motor on a rigid gear, or the motor's half of a flexible drive."""

    def __init__(self, joint: int, said: Mapping[str, Any]) -> None:
        only(said, "actuator", "command", "resistance", "inductance", "torque_constant",
             "rotor_inertia", "gear_ratio", "efficiency")  # fmt: skip
        self.joint = joint
        self.command = said.get("command", "torque")
        self.R, self.L = said.get("resistance", 0.0), said.get("inductance", 0.0)
        self.ratio = said.get("gear_ratio", 1.0)
        self.constant = said.get("torque_constant", 0.0) * self.ratio  # [N m/A] at the joint
        self.inertia = said.get("rotor_inertia", 0.0) * self.ratio**2
        self.size = int(self.command == "voltage" and self.L > 0.0)

    def flow(self, q: float, v: float, z: Array, u: float, signs: Array) -> Flow:
        """V = L di/dt + R i + K v at the joint, torque K i with K = N K_t."""
        if self.command == "torque" and not self.constant:
            return Flow(u, supplied=u * v)
        slope: tuple[float, ...] = ()
        stored = 0.0
        if self.command == "voltage" and self.size:
            i, volts = z[0], u
            slope, stored = ((u - self.R * i - self.constant * v) / self.L,), 0.5 * self.L * i * i
        else:
            i = u / self.constant if self.command == "torque" else u
            if self.command == "voltage":
                i = (u - self.constant * v) / self.R
            volts = self.R * i + self.constant * v
        return Flow(self.constant * i, slope, stored, volts * i, self.R * i * i)


class Flexible(Law):
    """A motor whose rotor is tied to the link by a spring, a damper and a hysteresis.

    States: those of the motor, its angle and speed as seen at the joint, and w.
    """

    def __init__(self, motor: Motor, said: Mapping[str, Any]) -> None:
        only(said, "transmission", "stiffness", "damping", "stiffening", "hysteresis",
             "kinematic_error")  # fmt: skip
        self.motor, self.joint = motor, motor.joint
        self.k, self.d = said["stiffness"], said.get("damping", 0.0)
        self.k3 = said.get("stiffening", 0.0)
        wave = said.get("kinematic_error", {})
        self.wave = wave.get("amplitude", 0.0), wave.get("order", 1.0), wave.get("phase", 0.0)
        self.lag = said.get("hysteresis")
        if self.lag and self.lag.get("sharpness", 1.0) != 1.0:
            raise NotImplementedError("sharpness is 1 here")
        self.size = motor.size + 2 + bool(self.lag)

    def _error(self, angle: float) -> tuple[float, float]:
        """e(θ) and de/dθ for the motor's angle as seen at the joint."""
        A, order, phase = self.wave
        turn, rate = order * self.motor.ratio * angle + phase, order * self.motor.ratio
        return A * sin(turn), A * rate * cos(turn)

    def initial(self, q: float, v: float) -> tuple[float, ...]:
        room = 1.5 * self.wave[0]
        angle = q
        if room:
            angle = brentq(lambda x: x + self._error(x)[0] - q, q - room, q + room, xtol=1e-16)
        states = angle, v / (1.0 + self._error(angle)[1])
        return (*self.motor.initial(q, v), *states, *([0.0] if self.lag else []))

    def _twist(self, q: float, v: float, z: Array) -> tuple[float, float, float]:
        """δ, its rate, and de/dθ."""
        angle, speed = z[self.motor.size], z[self.motor.size + 1]
        error, slope = self._error(angle)
        return angle + error - q, speed * (1.0 + slope) - v, slope

    def kinks(self, q: float, v: float, z: Array) -> tuple[float, ...]:
        return (self._twist(q, v, z)[1], z[-1]) if self.lag else ()

    def flow(self, q: float, v: float, z: Array, u: float, signs: Array) -> Flow:
        m = self.motor
        twist, rate, slope = self._twist(q, v, z)
        angle, speed = z[m.size], z[m.size + 1]
        made = m.flow(angle, speed, z[: m.size], u, signs)
        torque = self.k * twist + self.k3 * twist**3 + self.d * rate
        stored = 0.5 * self.k * twist**2 + 0.25 * self.k3 * twist**4 + 0.5 * m.inertia * speed**2
        lost, bent = self.d * rate**2, ()
        if self.lag:
            H, D, w = self.lag["torque"], self.lag["deflection"], z[-1]
            size, turned = signs[1] * w, signs[0] * rate
            dw = (rate - 0.5 * (rate * size + turned * w)) / D
            torque, bent = torque + H * w, (dw,)
            stored, lost = stored + 0.5 * H * D * w * w, lost + H * w * (rate - D * dw)
        push = (made.torque - torque * (1.0 + slope)) / m.inertia
        return Flow(
            torque, (*made.slope, speed, push, *bent),
            stored + made.stored, made.supplied, lost + made.lost,
        )  # fmt: skip


def drive(joint: int, settings: Mapping[str, Any]) -> Law:
    """What stands between the command and the joint."""
    if "actuator" not in settings:
        return Torque(joint)
    motor = Motor(joint, settings["actuator"])
    return Flexible(motor, settings["transmission"]) if "transmission" in settings else motor


def rotor_at_joint(settings: Mapping[str, Any]) -> float:
    """Inertia that a motor on a rigid gear adds to M."""
    rigid = "actuator" in settings and "transmission" not in settings
    return Motor(0, settings["actuator"]).inertia if rigid else 0.0
