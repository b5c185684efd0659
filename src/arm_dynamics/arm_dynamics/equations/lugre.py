# SPDX-License-Identifier: Apache-2.0
"""The LuGre model: dry friction as the deflection of bristles.

Canudas de Wit, Olsson, Åström, Lischinsky, "A new model for control of systems with friction",
IEEE Trans. Automatic Control 40(3), 1995, equations (2) to (4); Åström, Canudas de Wit,
"Revisiting the LuGre friction model", IEEE Control Systems Magazine 28(6), 2008:

    z' = v - σ0 |v| z / g(v),   F = σ0 z + σ1(v) z' + σ2 v,   g(v) = Fc + (Fs - Fc) exp(-(v/vs)²)

g(v), the friction of a steady motion at v, is that of joints without bristles, see
``friction.dry``. It may differ by direction, and by the position and load of a joint: |v| z / g(v)
stays continuous where v changes its sign, whatever the levels of the two sides. σ2 v is viscous
friction, see ``friction.viscous``. The damping of the bristles may fade with speed, σ1(v) = σ1
exp(-(v/vd)²) (Olsson, Control systems with friction, thesis, Lund 1996, section 4.3), which keeps
the model passive. All functions accept NumPy arrays and CasADi expressions alike.
"""

import math

from arm_dynamics.equations.elementary import Quantity, exponential, size

# Largest σ1 vd / Fc of a passive model with fading damping; see ``is_passive``
FADING = 4.0 * math.sqrt(2.0 * math.e)


def bending(v: Quantity, z: Quantity, sigma0: Quantity, level: Quantity) -> Quantity:
    """Rate z' of the bristle deflection in [rad/s] or [m/s].

    Args:
        v: Velocity in [rad/s] or [m/s].
        z: Deflection in [rad] or [m].
        sigma0: Stiffness in [N m/rad] or [N/m].
        level: g(v) in [N m] or [N], positive.
    """
    return v - sigma0 * size(v) * z / level


def faded(v: Quantity, sigma1: Quantity, velocity: Quantity | None) -> Quantity:
    """σ1(v) in [N m s/rad] or [N s/m]; constant without ``velocity``."""
    return sigma1 if velocity is None else sigma1 * exponential(-((v / velocity) ** 2))


def torque(z: Quantity, rate: Quantity, sigma0: Quantity, sigma1: Quantity) -> Quantity:
    """Torque of the bristles against the motion, σ0 z + σ1 z', in [N m] or [N]."""
    return sigma0 * z + sigma1 * rate


def heat(
    v: Quantity, z: Quantity, rate: Quantity, sigma0: Quantity, sigma1: Quantity, level: Quantity
) -> Quantity:
    """Dissipated power in [W]: F v less the rate of the stored energy σ0 z²/2.

    F v - σ0 z z' = σ0² |v| z² / g + σ1 z' v.
    """
    return (sigma0 * z) ** 2 * size(v) / level + sigma1 * rate * v


def is_passive(
    sigma1: float, sigma2: float, coulomb: float, static: float, velocity: float | None
) -> bool:
    """Whether the model is passive in one direction: it returns only energy that it stored.

    With y = σ0 z and w = |v|, the dissipated power is w (y²/g - σ1 w y/g + σ1 w + σ2 w) for y
    along the motion, the worst case. Bristles deflect along it by motion in that direction alone,
    so y <= Fs and g >= Fc of that direction. Where g has a factor, Fs is the highest resulting
    static level and Fc the lowest Coulomb level: bristles may move from one position to another
    while deflected.

    - At constant σ1 the bracket is at least w (σ1 (1 - Fs/Fc) + σ2), since y <= Fs and g >= Fc:
      σ2 >= σ1 (Fs - Fc)/Fc suffices, and at high speed it is necessary (Barahona, Canudas de Wit,
      in Åström, Canudas de Wit, 2008).
    - With b = σ1(w) w the bracket is (y² - b y + b g)/g + σ2 w, never negative if b <= 4 g. The
      largest b is σ1 vd / sqrt(2 e), so σ1 vd <= 4 sqrt(2 e) Fc suffices.
    """
    if sigma2 * coulomb >= sigma1 * (static - coulomb):
        return True
    return velocity is not None and sigma1 * velocity <= FADING * coulomb
