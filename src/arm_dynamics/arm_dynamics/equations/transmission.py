# SPDX-License-Identifier: Apache-2.0
"""Transmissions between motor and link: gears with losses, and flexible shafts and belts.

The motor's angle is reflected to the joint, θ = θ_motor / N, so a rigid transmission has θ = q;
the twist is δ = θ + e(θ) - q. Two coordinates for a joint: Spong, "Modeling and control of elastic
joint robots", ASME J. Dyn. Sys. Meas. Control 109, 1987. All functions accept numbers, NumPy
arrays and CasADi expressions.

A gear transmits only a fraction η of the power: a dry friction that grows with the load. Of a
motor's torque τ, reflected to the joint, η τ reaches the load where the motor drives it, and the
load must supply τ / η where it drives the motor, so the fraction is η in either direction of power
flow. At rest any value in between is possible (Giberti, Cinquemani and Legnani, "Effects of
transmission mechanical characteristics on the choice of a motor-reducer", Mechatronics 20(5),
2010, with one efficiency for both directions). The torque that accelerates the rotor itself does
not pass through the teeth; with a rigid gear this is neglected, within the bound of
``docs/concepts/drives.md``.
"""

from arm_dynamics.equations.elementary import (
    Quantity,
    choose,
    cos,
    larger,
    sign,
    sin,
    smaller,
    within,
)
from arm_dynamics.scene.drive import Wave


def engaged(twist: Quantity, backlash: Quantity) -> Quantity:
    """The part of a twist beyond the backlash: zero within it, a dead zone.

    Source: Nordin and Gutman, "Controlling mechanical systems with backlash - a survey",
    Automatica 38(10), 2002, section 2.

    Args:
        twist: δ in [rad] or [m].
        backlash: Width of the backlash in [rad] or [m].
    """
    return twist - within(twist, -backlash / 2.0, backlash / 2.0)


def elastic_torque(twist: Quantity, stiffness: Quantity, stiffening: Quantity) -> Quantity:
    """Torque k δ + k₃ δ³ in [N m] or [N].

    The cubic stiffness of harmonic drives: Tuttle and Seering, "A nonlinear model of a harmonic
    drive gear transmission", IEEE Trans. Robotics and Automation 12(3), 1996.
    """
    return stiffness * twist + stiffening * twist**3


def elastic_energy(twist: Quantity, stiffness: Quantity, stiffening: Quantity) -> Quantity:
    """Energy k δ²/2 + k₃ δ⁴/4 in [J]."""
    return (0.5 * stiffness + 0.25 * stiffening * twist**2) * twist**2


def flank_torque(engagement: Quantity, elastic: Quantity, damping: Quantity) -> Quantity:
    """Torque between teeth with backlash: a flank pushes and never pulls.

    The damper acts with the spring, and only as far as their sum keeps the teeth together (Nordin,
    Galić and Gutman, "New models for backlash and gear play", Int. J. Adaptive Control 11, 1997,
    without the state of the separated damper). It never supplies energy.

    Args:
        engagement: The twist beyond the backlash in [rad] or [m].
        elastic: Torque of the spring in [N m] or [N], of the same sign.
        damping: Torque of the damper, d δ'.
    """
    whole = elastic + damping
    pushing = choose(engagement > 0.0, larger(whole, 0.0), 0.0)
    return choose(engagement < 0.0, smaller(whole, 0.0), pushing)


def hysteresis_slope(
    state: Quantity, twist_rate: Quantity, deflection: Quantity, sharpness: Quantity
) -> Quantity:
    """Rate w' of the Bouc-Wen model for a hysteretic torque H w with |w| ≤ 1.

    w' = (δ' - ½ (δ' |w|ⁿ + |δ'| w |w|ⁿ⁻¹)) / D (Wen, "Method for random vibration of hysteretic
    systems", ASCE J. Eng. Mech. 102, 1976, with β = γ). With this choice, w moves away from zero
    as 1 - |w|ⁿ and towards zero as a spring, and H D w²/2 is its stored energy: the model is
    passive (Ismail, Ikhouane and Rodellar, "The hysteresis Bouc-Wen model, a survey", Arch. Comp.
    Methods Eng. 16, 2009, section 3). It is rate-independent.

    Args:
        state: w.
        twist_rate: δ' in [rad/s] or [m/s].
        deflection: D in [rad] or [m].
        sharpness: n, at least 1.
    """
    size = larger(state, -state)
    speed = larger(twist_rate, -twist_rate)
    bent = twist_rate * size + speed * state
    return (twist_rate - 0.5 * bent * size ** (sharpness - 1.0)) / deflection


def hysteresis_energy(state: Quantity, torque: Quantity, deflection: Quantity) -> Quantity:
    """Energy H D w²/2 in [J], recovered in unloading."""
    return 0.5 * torque * deflection * state**2


def kinematic_error(angle: Quantity, wave: Wave) -> Quantity:
    """Lead of the gear's output over the motor: e = A sin(m θ_motor + φ) in [rad] or [m].

    It is a property of the geometry, not a torque: it twists the transmission, and by virtual work
    the transmission's torque acts on the motor times 1 + de/dθ. Source: Tuttle and Seering, as
    above; a harmonic drive's main component repeats twice per revolution of the wave generator, m
    = 2.
    """
    return wave.amplitude * sin(wave.order * angle + wave.phase)


def kinematic_error_slope(angle: Quantity, wave: Wave) -> Quantity:
    """de/dθ_motor."""
    return wave.amplitude * wave.order * cos(wave.order * angle + wave.phase)


def gear_loss(
    direction: Quantity, torque: Quantity, efficiency: Quantity, forward: Quantity = None
) -> Quantity:
    """Friction of the gear in [N m] or [N], of the sign of ``direction``.

    Args:
        direction: Direction in which the joint moves or is about to move, -1 or 1; 0 gives zero.
        torque: Torque of the motor, reflected to the joint, in [N m] or [N].
        efficiency: η, above zero, at most one.
        forward: Whether the torque is positive, 1 or 0, in place of its own sign.
    """
    push = sign(torque) if forward is None else 2.0 * forward - 1.0
    part = choose(direction * push > 0.0, 1.0 - efficiency, 1.0 / efficiency - 1.0)
    return direction * (push * torque) * part


def gear_input(direction: Quantity, required: Quantity, efficiency: Quantity) -> Quantity:
    """Motor torque that delivers ``required``; without a direction, ``required`` itself."""
    push = direction * required
    less = choose(push < 0.0, required * efficiency, required)
    return choose(push > 0.0, required / efficiency, less)
