# SPDX-License-Identifier: Apache-2.0
"""Joint friction torques F in τ = M q̈ + C q̇ + G + F.

All functions accept NumPy arrays and CasADi expressions alike.
"""

from arm_dynamics.equations.elementary import Quantity, exponential, size


def viscous(v: Quantity, coefficient: Quantity, skew: Quantity | None = None) -> Quantity:
    """Viscous friction F = b v + s |v|: coefficient b + s forwards, b - s backwards.

    Args:
        v: Joint velocities in [rad/s] or [m/s], shape (…, n).
        coefficient: b in [N m s/rad] or [N s/m], shape (n,).
        skew: s, half the difference of the two directions, |s| ≤ b; None for zero.

    Returns:
        Torques in [N m] or [N], of the sign of ``v``.
    """
    return coefficient * v if skew is None else coefficient * v + skew * size(v)


def dry(
    v: Quantity,
    direction: Quantity,
    coulomb: Quantity,
    excess: Quantity,
    stribeck_velocity: Quantity,
) -> Quantity:
    """Dry friction of sliding joints: F = s (Fc + ΔF exp(-(v/vs)²)), s the sliding direction.

    Coulomb friction with the Stribeck effect, or, with ΔF < 0, a saturating rise from the level at
    rest; the exponent 2 is from Armstrong-Hélouvry, Dupont and Canudas de Wit, "A survey of
    models, analysis tools and compensation methods for the control of machines with friction",
    Automatica 30(7), 1994, equation (4). With ΔF = 0 it is Coulomb's law.

    Args:
        v: Joint velocities in [rad/s] or [m/s], shape (…, n).
        direction: Sign of the motion, or of the motion about to begin; 0 gives no torque.
        coulomb: Fc in [N m] or [N], shape (n,).
        excess: ΔF = Fs - Fc in [N m] or [N], more than -Fc.
        stribeck_velocity: vs in [rad/s] or [m/s], positive.

    Returns:
        Torques in [N m] or [N], of the sign of ``direction``.
    """
    return direction * (coulomb + excess * exponential(-((v / stribeck_velocity) ** 2)))
