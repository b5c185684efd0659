# SPDX-License-Identifier: Apache-2.0
"""The direct-current motor: L di/dt + R i + K_e ω = V and τ = K_t i.

Also for brushless motors, whose current controller makes them look like one. Source: Krause,
Wasynczuk, Sudhoff, Analysis of Electric Machinery, 2002, section 2.3. All functions take numbers,
numpy arrays and CasADi expressions; angles, speeds and torques are those of the rotor.
"""

from __future__ import annotations

from arm_dynamics.equations.elementary import Quantity, choose, cos, larger, sin, smaller, within
from arm_dynamics.scene.drive import Wave


def torque(current: Quantity, constant: Quantity) -> Quantity:
    """K_t i in [N m], for a current in [A] and K_t in [N m/A]."""
    return constant * current


def back_emf(speed: Quantity, constant: Quantity) -> Quantity:
    """K_e ω in [V], for a speed in [rad/s] and K_e in [V s/rad]."""
    return constant * speed


def current_slope(
    voltage: Quantity, current: Quantity, emf: Quantity, inductance: Quantity, resistance: Quantity
) -> Quantity:
    """di/dt = (V - R i - K_e ω) / L in [A/s].

    Args:
        voltage: V in [V].
        current: i in [A].
        emf: K_e ω in [V].
        inductance: L in [H], not zero.
        resistance: R in [Ω].
    """
    return (voltage - resistance * current - emf) / inductance


def settled_current(voltage: Quantity, emf: Quantity, resistance: Quantity) -> Quantity:
    """The current without inductance, i = (V - K_e ω) / R in [A]."""
    return (voltage - emf) / resistance


def current_under(
    voltage_limit: Quantity, current: Quantity, emf: Quantity, resistance: Quantity
) -> Quantity:
    """The part of a desired current that a limited voltage can drive: |R i + K_e ω| ≤ V_max.

    With a limited current it makes the torque-speed curve: constant torque up to the corner, then
    a straight line through the no-load speed V_max / K_e. Beyond that speed the current brakes.
    """
    low = settled_current(-voltage_limit, emf, resistance)
    return within(current, low, settled_current(voltage_limit, emf, resistance))


def limited_voltage(
    voltage: Quantity, current: Quantity, emf: Quantity, current_limit: Quantity,
    resistance: Quantity,
) -> Quantity:  # fmt: skip
    """The voltage of an amplifier that limits the current, in [V].

    At the limit it gives only so much that the current does not grow, V = R i + K_e ω.
    """
    steady = resistance * current + emf
    below = choose(current >= current_limit, smaller(voltage, steady), voltage)
    return choose(current <= -current_limit, larger(voltage, steady), below)


def cogging_torque(angle: Quantity, wave: Wave) -> Quantity:
    """Torque on the rotor from its poles, -A sin(m θ + φ) in [N m], for an angle θ in [rad].

    It has a potential, hence takes no energy in a turn (Hanselman, Brushless Permanent Magnet
    Motor Design, 2003, chapter 5). It is stable where m θ + φ is a whole number of turns.
    """
    return -wave.amplitude * sin(wave.order * angle + wave.phase)


def cogging_energy(angle: Quantity, wave: Wave) -> Quantity:
    """The potential of ``cogging_torque`` in [J], zero in its stable positions."""
    return wave.amplitude / wave.order * (1.0 - cos(wave.order * angle + wave.phase))
