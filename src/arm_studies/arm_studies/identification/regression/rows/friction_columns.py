# SPDX-License-Identifier: Apache-2.0
"""Columns of friction at the rows of a regression, from the velocities at all measured times."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.data import MeasuredMotion
from arm_studies.identification.regression.friction import DRY, EXCESS, JointFit, Shape
from arm_studies.identification.signals import decimation

# Number of columns of each joint that are kept: of every kind, and some Stribeck velocities.
CACHE_SIZE = 8


class FrictionColumns:
    """Columns of friction, decimated but not yet filtered.

    Friction jumps with the velocity: what depends on it is computed at all measured times, and
    once. The growth with the load, which depends on the fit, is computed at the rows.
    """

    def __init__(
        self, motions: Sequence[MeasuredMotion], strides: Sequence[int], rows: Sequence[slice]
    ) -> None:
        """Take motions at all measured times, and the rows of each of their stretches."""
        self._stretches = [
            (motion.v[stretch], stride)
            for motion, stride in zip(motions, strides, strict=True)
            for stretch in motion.stretches
        ]
        reach = np.arange(-decimation.REACH, decimation.REACH + 1)
        self._near = np.concatenate([
            np.clip(np.arange(s.start, s.stop)[:, None] + reach, s.start, s.stop - 1) for s in rows
        ])  # fmt: skip
        self.weights = lru_cache(CACHE_SIZE * motions[0].n)(self._weights)

    def __call__(self, fit: JointFit, joint: int, load: Array) -> Array:
        """Columns of a joint's friction, shape (k, kinds).

        Args:
            fit: Kinds and shape.
            joint: Index of the joint.
            load: Torque of its drive in each row, shape (k,).
        """
        columns, fall = np.empty((len(load), len(fit.kinds))), fit.shape.stribeck_velocity
        growth = fit.shape.growth(load)[self._near]
        for column, kind in zip(columns.T, fit.kinds, strict=True):
            weights = self.weights(joint, kind, fall if kind == EXCESS else None)
            grows = kind in DRY
            column[:] = np.einsum("kd,kd->k", weights, growth) if grows else weights.sum(axis=1)
        return columns

    def _weights(self, joint: int, kind: str, stribeck_velocity: float | None) -> Array:
        """Weights of a column for factors in the rows nearby; see ``decimation.spread``."""
        shape = Shape(stribeck_velocity)
        columns = ((shape.unloaded(kind, v[:, joint]), stride) for v, stride in self._stretches)
        return np.concatenate([decimation.spread(*column) for column in columns])
