# SPDX-License-Identifier: Apache-2.0
"""How the states of a rollout change, to first order."""

from __future__ import annotations

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.derivatives.linearization import Linearizer
from arm_sim.derivatives.tangents import Arms
from arm_sim.plant.plant import Plant
from arm_sim.stepping.rollout import Batch


def rollout_change(
    plant: Plant, linearizer: Linearizer, batch: Batch, dx0: Array, dtau: Array,
    threads: int | None, lanes: int | None, side: int | None,
) -> Array:  # fmt: skip
    """How the states of a rollout change, to first order, with its initial states and torques.

    Args:
        plant: The scene's equations.
        linearizer: Derivatives of its ticks.
        batch: The arms; ``out`` is not used.
        dx0: Changes of the initial (q, v), shape (b, 2n).
        dtau: Changes of the torques, shape (b, ticks, n).
        threads: Cores to use; None for all that the work is worth.
        lanes: Arms in a vector register; None for the widest there is.
        side: See ``Motion``.

    Returns:
        Changes of (q, v), shape (b, ticks + 1, 2n).
    """
    if plant.nz:
        of_start = zip(batch.x0, dx0, strict=True)
        dz0 = [initial_slope(plant, x[: dx0.shape[1]]) @ dx for x, dx in of_start]
        dx0 = np.hstack([dx0, np.array(dz0)])
    initial, ticks = np.ascontiguousarray(dx0)[:, :, None], batch.steps
    arms = Arms(batch.x0, batch.tau[:, :ticks], batch.p, initial, dtau[:, :ticks, :, None])
    moved = linearizer.jvps(arms, threads, lanes, every=True, side=side)
    changes = np.concatenate([initial[:, None], moved], axis=1)[..., 0]
    return changes[..., : 2 * plant.model.n]


def initial_slope(plant: Plant, x: Array) -> Array:
    """Derivative of the initial internal states by (q, v), shape (nz, 2n).

    They are those at rest and nearly linear, so fourth-order differences are accurate.
    """
    n, h = plant.model.n, 2.0**-10

    def at(place: Array) -> Array:
        return plant.laws.initial(place[:n], place[n:])

    columns = [
        (8.0 * (at(x + e) - at(x - e)) - (at(x + 2 * e) - at(x - 2 * e))) / (12.0 * h)
        for e in h * np.eye(2 * n)
    ]
    return np.column_stack(columns)
