# SPDX-License-Identifier: Apache-2.0
"""Trial motions: whether steps of fixed length keep a scene's accuracy.

Each motion is made with the tick and with twice the tick; their difference, divided by 2^p - 1 for
a method of order p, estimates the error (Hairer, Nørsett, Wanner, Solving Ordinary Differential
Equations I, 1993, section II.4).
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.model.arm import postures
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.stepping.stepper import Stepper

# Length of a motion in [s], and the largest number of its ticks
DURATION, MOST_TICKS = 1.0, 1000
# Motions from other postures, and the largest speed in them in [rad/s] or [m/s], unless the
# joint's limit is lower.
POSTURES, SPEED = 3, 5.0


def keeps_accuracy(plant: Plant, stepper: Stepper, choice: Choice) -> bool:
    """Whether motions without command are right to the scene's accuracy.

    Args:
        plant: The scene's equation of motion.
        stepper: Its ticks.
        choice: Its method, with steps of fixed length.
    """
    fine, coarse = stepper.twin(), stepper.twin(replace(choice, dt=2.0 * choice.dt))
    ticks = min(MOST_TICKS, max(2, round(DURATION / choice.dt))) // 2
    allowed = plant.model.scene.sim.accuracy * max(1.0, 2 * ticks * choice.dt)
    return all(
        _error(fine, coarse, x, ticks, plant.model.n, choice.method.order) <= allowed
        for x in _starts(plant)
    )


def _starts(plant: Plant) -> Iterator[Array]:
    """The initial state and, where any posture may be taken, some others in motion."""
    model = plant.model
    yield np.concatenate([model.q0, model.v0, plant.laws.initial(model.q0, model.v0)])
    if model.scene.constraints:
        return
    rng = np.random.default_rng(model.n)
    for q in postures(model, POSTURES):
        v = rng.uniform(-1.0, 1.0, model.n) * np.minimum(model.velocity_limit, SPEED)
        yield np.concatenate([q, v, plant.laws.initial(q, v)])


def _error(fine: Stepper, coarse: Stepper, x: Array, ticks: int, n: int, order: int) -> float:
    """Largest scaled error of q and v at the ends of double ticks; infinite if one fails."""
    ends = []
    for stepper, ratio in ((fine, 2), (coarse, 1)):
        trace = np.empty((ticks * ratio, len(x)))
        effort, notes = np.empty((ticks * ratio, n)), np.empty((ticks * ratio, 2))
        stepper.restart()
        if stepper.advance(x.copy(), np.zeros(n), trace, effort, notes) < len(trace):
            return np.inf
        ends.append(trace[ratio - 1 :: ratio, : 2 * n])
    apart = abs(ends[0] - ends[1]) / (1.0 + abs(ends[0])) / (2.0**order - 1.0)
    return float(persistent_errors(apart, n).max())


def persistent_errors(error: Array, n: int) -> Array:
    """Errors of q and v, those of v as far as they last for two rows, shape (k, 2n).

    An event that ends a tick is in one motion before that, and in the other after it.
    """
    rows = error.copy()
    if len(rows) > 1:
        rows[:, n:] = np.minimum(error[:, n:], np.vstack([error[1:, n:], error[-2, n:]]))
    return rows
