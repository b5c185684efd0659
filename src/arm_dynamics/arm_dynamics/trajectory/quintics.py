# SPDX-License-Identifier: Apache-2.0
"""Mathematics of quintic segments: coefficients, minimum-jerk knots, exact extremes.

A segment runs over τ = (t − tᵢ)/hᵢ in [0, 1]: q(τ) = Σ c_k τᵏ, k = 0…5.
"""

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from arm_dynamics.arrays import Array

_BISECTIONS = 10  # then Newton: τ to 1e-3, 1e-6, 1e-12
_NEWTON_STEPS = 2


def segment_coefficients(h: Array, q: Array, v: Array, a: Array) -> Array:
    """Fit every segment to position, velocity and acceleration at its ends.

    Source: Craig, Introduction to Robotics, section 7.3, with time scaled to τ.

    Args:
        h: Durations in [s], shape (w − 1,).
        q: Positions at the knots, shape (w, n).
        v: Velocities, likewise.
        a: Accelerations, likewise.

    Returns:
        Coefficients of shape (w − 1, n, 6).
    """
    h = h[:, None]
    d = np.diff(q, axis=0)
    v0, v1 = v[:-1] * h, v[1:] * h
    a0, a1 = a[:-1] * h**2, a[1:] * h**2
    c3 = 10 * d - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15 * d + 8 * v0 + 7 * v1 + 1.5 * a0 - a1
    c5 = 6 * d - 3 * v0 - 3 * v1 - 0.5 * a0 + 0.5 * a1
    return np.stack((q[:-1], v0, a0 / 2, c3, c4, c5), axis=-1)


def knot_derivatives(h: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
    """Choose free velocities and accelerations that minimize ∫ jerk² dt.

    Stationarity in an open velocity is continuity of snap there, in an open acceleration that of
    jerk (Flash and Hogan 1985). The equations are symmetric positive definite, block tridiagonal
    with 2 × 2 blocks, and solved by block elimination in time proportional to w.

    Args are those of ``segment_coefficients``, v and a with NaN in the rows that are open.

    Returns:
        Velocities and accelerations without NaN, each of shape (w, n).
    """
    open_v, open_a = np.isnan(v[:, 0]), np.isnan(a[:, 0])
    if not (open_v.any() or open_a.any()):
        return v, a
    # Blocks below, on and above the diagonal, (w, 2, 2), and the right side, (w, 2, n), for the
    # unknowns (vᵢ, aᵢ): continuity of snap in first rows, of jerk in second rows, at inner knots.
    w, n = q.shape
    lower, middle, upper = np.zeros((3, w, 2, 2))
    right = np.zeros((w, 2, n))
    b, f = 1 / h[:-1], 1 / h[1:]  # of the durations before and after every inner knot
    lower[1:-1] = _block(168 * b**3, 24 * b**2, -24 * b**2, -3 * b)
    upper[1:-1] = _block(168 * f**3, -24 * f**2, 24 * f**2, -3 * f)
    cross = 36 * (f**2 - b**2)
    middle[1:-1] = _block(192 * (b**3 + f**3), cross, cross, 9 * (b + f))
    d, b, f = np.diff(q, axis=0), b[:, None], f[:, None]
    right[1:-1, 0] = 360 * (d[1:] * f**4 + d[:-1] * b**4)
    right[1:-1, 1] = 60 * (d[1:] * f**3 - d[:-1] * b**3)
    fixed = np.stack((~open_v, ~open_a), axis=1)
    for block in (lower, middle, upper):
        block[fixed] = 0.0
    middle[:, (0, 1), (0, 1)] += fixed
    right = np.where(fixed[..., None], np.nan_to_num(np.stack((v, a), axis=1)), right)
    x = _solve_block_tridiagonal(lower, middle, upper, right)
    return x[:, 0], x[:, 1]


def _block(vv: Array, va: Array, av: Array, aa: Array) -> Array:
    """Blocks of the matrix from their entries at w knots, shape (w, 2, 2)."""
    return np.stack((vv, va, av, aa), axis=-1).reshape(-1, 2, 2)


def _solve_block_tridiagonal(lower: Array, middle: Array, upper: Array, right: Array) -> Array:
    """Eliminate downwards, substitute upwards (the block Thomas algorithm)."""
    x, gains = np.empty_like(right), np.empty_like(upper)
    reduced, rest = middle[0], right[0]
    for i in range(len(right)):
        if i:
            reduced = middle[i] - lower[i] @ gains[i - 1]
            rest = right[i] - lower[i] @ x[i - 1]
        (p, q), (r, s) = reduced.tolist()
        inverse = np.array(((s, -q), (-r, p))) / (p * s - q * r)
        gains[i] = inverse @ upper[i]
        x[i] = inverse @ rest
    for i in range(len(right) - 2, -1, -1):
        x[i] -= gains[i] @ x[i + 1]
    return x


def extremes(coefficients: Array) -> Array:
    """The smallest and largest position, velocity and acceleration of every segment.

    Between neighbouring extremes a derivative is monotone, so each holds at most one root of it:
    roots of the jerk follow from that of the snap, those of the acceleration from them, and so on.

    Args:
        coefficients: Polynomials in τ, shape (s, n, 6).

    Returns:
        Smallest and largest values of the three, derivatives by τ, shape (2, 3, s, n).
    """
    derivatives = [np.asarray(polyder(coefficients, k, axis=-1), float) for k in range(6)]
    points = np.broadcast_to([0.0, 1.0], (*coefficients.shape[:2], 2))
    least_and_most = np.empty((2, 3, *coefficients.shape[:2]))
    for order in (4, 3, 2, 1):
        points = _roots_between(derivatives[order], derivatives[order + 1], points)
        if order <= 3:
            values = _evaluate(derivatives[order - 1], points)
            least_and_most[:, order - 1] = values.min(-1), values.max(-1)
    return least_and_most


def _evaluate(polynomial: Array, points: Array) -> Array:
    return np.asarray(polyval(points, np.moveaxis(polynomial, -1, 0)[..., None], tensor=False))


def _roots_between(polynomial: Array, slope: Array, points: Array) -> Array:
    """Bracket a root between all neighbouring points and polish it; the ends 0 and 1 are kept."""
    low, high = points[..., :-1], points[..., 1:]
    sign = np.signbit(_evaluate(polynomial, low))
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        before = np.signbit(_evaluate(polynomial, middle)) == sign
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    root = 0.5 * (low + high)
    for _ in range(_NEWTON_STEPS):
        rise = _evaluate(slope, root)
        step = _evaluate(polynomial, root) / np.where(rise == 0.0, np.inf, rise)
        root = np.clip(root - step, low, high)
    return np.concatenate((points[..., :1], root, points[..., -1:]), axis=-1)
