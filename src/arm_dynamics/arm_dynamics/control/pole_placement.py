# SPDX-License-Identifier: Apache-2.0
"""Gains that place the poles of a joint's error, ë + 2 ζ ω ė + ω² e = 0, and their margin."""

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, numbers, positive, vector
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.model.arm import postures

# Largest bandwidth in [rad/s], beyond anything that a torque can follow
TOP_BANDWIDTH = 1e6
# Gain margin that is sensible: with so many times its gains a loop is still stable
MARGIN = 2.0
_POSTURES = 200  # over which inertia is averaged
# Largest dt times the greatest eigenvalue of M⁻¹ K_d; from 2 on a held torque swings up
_LARGEST_DAMPING = 1.5


def gains(bandwidth: ArrayLike, damping_ratio: ArrayLike, n: int) -> tuple[Array, Array]:
    """K_p = ω² and K_d = 2 ζ ω of every joint.

    Args:
        bandwidth: ω in [rad/s], a number or shape (n,), not negative.
        damping_ratio: ζ, a number or shape (n,), not negative.
        n: Number of joints.

    Returns:
        K_p in [1/s²] and K_d in [1/s], each of shape (n,).

    Raises:
        InvalidInput: If a gain has a wrong shape or value.
    """
    omega = gain("bandwidth", bandwidth, n)
    if np.any(omega > TOP_BANDWIDTH):
        raise InvalidInput(f"bandwidth is {bandwidth!r}; allowed: at most {TOP_BANDWIDTH:g} rad/s")
    return omega**2, 2.0 * gain("damping_ratio", damping_ratio, n) * omega


def held_gains(
    bandwidth: ArrayLike, damping_ratio: ArrayLike, n: int, dt: float
) -> tuple[Array, Array]:
    """Gains of an acceleration that is held for dt: the error is to fall as with ``gains``.

    Held, u = -K_p e - K_d ė takes ë = u from tick to tick by a matrix whose eigenvalues are made
    those of the continuous equation, z = exp(λ dt) with λ² + 2 ζ ω λ + ω² = 0 (Åström and
    Wittenmark, Computer-Controlled Systems, 1997, section 4.3):

        K_p = (1 - z₁)(1 - z₂)/dt²,  K_d = (3 - z₁ - z₂ - z₁ z₂)/(2 dt).

    So the loop is stable for any bandwidth; for dt → 0 these are ω² and 2 ζ ω.

    Args, returns and errors as those of ``gains``, and ``dt``: time in [s] for which an
    acceleration is held, not negative.
    """
    kp, kd = gains(bandwidth, damping_ratio, n)
    if not 0.0 <= dt < np.inf:
        raise InvalidInput(f"dt is {dt}; a time of at least zero is expected")
    if dt == 0.0:
        return kp, kd
    root = np.sqrt((0.25 * kd**2 - kp).astype(complex))
    # 1 - z₁, 1 - z₂ and 1 - z₁ z₂, without cancellation for short ticks.
    first, second = -np.expm1((root - 0.5 * kd) * dt), -np.expm1(-(root + 0.5 * kd) * dt)
    product = -np.expm1(-kd * dt)
    return (first * second).real / dt**2, ((first + second).real + product) / (2.0 * dt)


def tuned(
    dynamics: Dynamics, bandwidth: ArrayLike, damping_ratio: ArrayLike = 1.0,
    q: ArrayLike | None = None, dt: float = 1e-3,
) -> tuple[Array, Array]:  # fmt: skip
    """Gains in units of torque: K_p = ω² m and K_d = 2 ζ ω m, less viscous friction.

    The inertia m of a joint is M_ii averaged over postures: that of one posture may be next to
    nothing, and its gains too weak for the weight elsewhere. Where joints are nearly aligned, the
    arm is much lighter against some motions than M_ii says. So all gains are lowered together
    until a torque that is held for dt cannot make it swing up in any of these postures: dt times
    the greatest eigenvalue of M⁻¹ K_d is 1.5 at most; from 2 on it would.

    Args:
        dynamics: The model.
        bandwidth: ω in [rad/s], a number or shape (n,).
        damping_ratio: ζ, likewise.
        q: A posture of shape (n,) whose M_ii is to be m as it is; None for the above.
        dt: Time in [s] for which a torque is held.

    Returns:
        K_p in [N m/rad] or [N/m] and K_d in [N m s/rad] or [N s/m], each of shape (n,).

    Raises:
        InvalidInput: If a number has a wrong shape or value.
    """
    (kp, kd), dt = gains(bandwidth, damping_ratio, dynamics.n), positive("dt", dt)
    if q is None:
        m, part = typical_inertia(dynamics, kd * dt)
        inertia = m * part
    else:
        inertia = dynamics.mass_matrix(vector("q", q, dynamics.n)).diagonal()
    return kp * inertia, np.maximum(kd * inertia - dynamics.model.viscous, 0.0)


def typical_inertia(dynamics: Dynamics, damping: ArrayLike) -> tuple[Array, float]:
    """The inertia m of ``tuned``, shape (n,), and the part s of the gains that is left of them.

    Args:
        dynamics: The model.
        damping: K_d dt/m without friction, a number or shape (n,).
    """
    M = dynamics.mass_matrix(postures(dynamics.model, _POSTURES))
    m = np.asarray(M.diagonal(0, 1, 2).mean(0))
    scale = np.sqrt(np.asarray(damping) * m)
    greatest = float(np.linalg.eigvalsh(scale[:, None] * np.linalg.inv(M) * scale).max())
    return m, min(1.0, _LARGEST_DAMPING / greatest) if greatest > 0.0 else 1.0


def gain(name: str, value: ArrayLike, n: int) -> Array:
    """Check a gain of every joint, a number or shape (n,), not negative; shape (n,)."""
    array = numbers(name, value)
    if array.shape not in ((), (1,), (n,)):
        raise InvalidInput(f"{name} has shape {array.shape}; allowed: a number or shape ({n},)")
    if np.any(array < 0.0):
        raise InvalidInput(f"{name} is {array}; allowed: numbers of at least 0")
    return np.array(np.broadcast_to(array, (n,)))


def largest_delay(stiffness: ArrayLike, damping: ArrayLike, margin: float = MARGIN) -> Array:
    """Largest time by which a torque may act late without the arm swinging up.

    The error obeys ë(t) = -k e(t - T) - c ė(t - T). The gain of this loop is 1 at the frequency w,
    w⁴ = c² w² + k², where damping leads by the phase atan(c w/k) and the delay takes w T of it
    (Åström and Murray, Feedback Systems, 2021, section 10.3).

    Args:
        stiffness: k by inertia in [1/s²].
        damping: c by inertia in [1/s].
        margin: Factor of both.

    Returns:
        T in [s]; infinite without damping, which is then left to others.
    """
    k, c = margin * np.asarray(stiffness, float), margin * np.asarray(damping, float)
    w = np.sqrt(0.5 * (c**2 + np.sqrt(c**4 + 4.0 * k**2)))
    return np.where(c > 0.0, np.arctan2(c * w, k) / np.where(w > 0.0, w, 1.0), np.inf)
