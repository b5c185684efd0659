# SPDX-License-Identifier: Apache-2.0
"""Two accounts that a recording gives of itself, without knowing the true motion.

The energy balance says how much energy came from nowhere. It is blind to a light link on a heavy
arm, whose energy is lost in the sum. The impulse balance looks at every joint by itself: does its
speed change by what the torques give it?
"""

from __future__ import annotations

import numpy as np

from arm_dynamics import ArmError
from arm_sim import Recording

SAMPLES = 500  # ticks looked at in a long run
ROUNDING = 1e-9  # of the potential energy: less is not an exchange


def energy_balance(run: Recording) -> float:
    """Largest energy from nowhere, relative to the energy exchanged by then.

    Exchanged are kinetic energy, work of the drives and weight lifted or lowered.

    Returns:
        A ratio; infinite where energies overflow.
    """
    with np.errstate(all="ignore"):
        work = np.cumsum(np.abs(np.sum(run.tau[:-1] * np.diff(run.q, axis=0), axis=1)))
        lifted = np.abs(run.potential - run.potential[0])
        exchanged = np.maximum.accumulate(run.kinetic) + np.maximum.accumulate(lifted)
        exchanged[1:] += work
        least = ROUNDING * np.abs(run.potential).max() + np.finfo(float).tiny
        ratio = float(np.max(np.abs(run.balance) / (exchanged + least)))
    return ratio if np.isfinite(ratio) else np.inf


def impulse_balance(run: Recording) -> float:
    """Speed from nowhere, summed over the ticks, relative to a joint's top speed; the worst joint.

    Over a tick of length h, v changes by the integral of the acceleration, here by Simpson's rule
    with the state in the middle from the cubics through both ends (Hermite). It tells a wrong
    motion only where ticks are short enough for the motion to be smooth in them.

    Ticks in which a joint with dry friction starts or stops tell nothing and are left out; joints
    that rest throughout are held.

    Args:
        run: recording with one step a tick.

    Returns:
        A ratio; infinite where accelerations overflow, zero if no tick tells anything.
    """
    ticks = len(run) - 1
    k = np.arange(0, ticks, max(1, ticks // SAMPLES))
    dry = run.dynamics.model.friction.level > 0.0
    k = k[(np.sign(run.v[k][:, dry]) == np.sign(run.v[k + 1][:, dry])).all(axis=1)]
    if not len(k):
        return 0.0
    with np.errstate(all="ignore"):
        try:
            missing = _speed_from_nowhere(run, k)
        except (ArmError, ValueError):
            return np.inf
        top = np.abs(run.v).max(axis=0) + np.finfo(float).tiny
        ratio = float(np.max(ticks / len(k) * missing.sum(axis=0) / top))
    return ratio if np.isfinite(ratio) else np.inf


def _speed_from_nowhere(run: Recording, k: np.ndarray) -> np.ndarray:
    h = run.time[1] - run.time[0]
    (q0, q1), (v0, v1), tau = run.q[[k, k + 1]], run.v[[k, k + 1]], run.tau[k]
    free = (run.dynamics.model.friction.level == 0.0) | (v0 != 0.0) | (v1 != 0.0)
    a0, a1 = (_accelerations(run, q, v, tau, free) for q, v in ((q0, v0), (q1, v1)))
    q, v = (q0 + q1) / 2 + h / 8 * (v0 - v1), (v0 + v1) / 2 + h / 8 * (a0 - a1)
    a = _accelerations(run, q, v, tau, free)
    return np.abs(v1 - v0 - h / 6 * (a0 + 4 * a + a1))


def _accelerations(
    run: Recording, q: np.ndarray, v: np.ndarray, tau: np.ndarray, free: np.ndarray
) -> np.ndarray:
    """Accelerations of joints that are ``free``; the others are held. All of shape (k, n)."""
    if free.all():
        return run.dynamics.forward(q, v, tau)
    load = tau - run.dynamics.inverse(q, v, np.zeros_like(q))
    M, a = run.dynamics.mass_matrix(q), np.zeros_like(q)
    for k, moves in enumerate(free):
        a[k, moves] = np.linalg.solve(M[k][np.ix_(moves, moves)], load[k, moves])
    return a
