# SPDX-License-Identifier: Apache-2.0
"""The DC motor: L di/dt + R i + K_e ω = V and τ = K_t i.

Also for brushless motors, which behave like one under current control. Source: Krause, Wasynczuk,
Sudhoff, Analysis of Electric Machinery, 2002, section 2.3. All functions accept numbers, NumPy
arrays and CasADi expressions; angles, speeds and torques are those of the rotor.
"""

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
    """Steady-state current, i = (V - K_e ω) / R in [A]."""
    return (voltage - emf) / resistance


def current_under(
    voltage_limit: Quantity, current: Quantity, emf: Quantity, resistance: Quantity,
    current_limit: float | None = None,
) -> Quantity:  # fmt: skip
    """The desired current limited to what the voltage can drive: |R i + K_e ω| ≤ V_max.

    With a limited current it gives the torque-speed curve: constant torque up to the corner speed,
    then a straight line through the no-load speed V_max / K_e. Beyond that speed the current
    brakes. From (V_max + R I) / K_e on, a current limit I, which the desired current keeps, leaves
    the voltage above V_max.
    """
    low, high = (settled_current(V, emf, resistance) for V in (-voltage_limit, voltage_limit))
    if current_limit:
        low, high = smaller(low, current_limit), larger(high, -current_limit)
    return within(current, low, high)


def limited_voltage(
    voltage: Quantity, current: Quantity, emf: Quantity, current_limit: Quantity,
    resistance: Quantity,
) -> Quantity:  # fmt: skip
    """The voltage of an amplifier that limits the current, in [V].

    At the limit, the voltage keeps the current constant, V = R i + K_e ω.
    """
    steady = resistance * current + emf
    below = choose(current >= current_limit, smaller(voltage, steady), voltage)
    return choose(current <= -current_limit, larger(voltage, steady), below)


def cogging_torque(angle: Quantity, wave: Wave) -> Quantity:
    """Cogging torque on the rotor, -A sin(m θ + φ) in [N m], for an angle θ in [rad].

    It has a potential, hence dissipates no energy (Hanselman, Brushless Permanent Magnet Motor
    Design, 2003, chapter 5). It is stable where m θ + φ is a multiple of 2π.
    """
    return -wave.amplitude * sin(wave.order * angle + wave.phase)


def cogging_energy(angle: Quantity, wave: Wave) -> Quantity:
    """Potential energy of ``cogging_torque`` in [J], zero at its stable positions."""
    return wave.amplitude / wave.order * (1.0 - cos(wave.order * angle + wave.phase))
