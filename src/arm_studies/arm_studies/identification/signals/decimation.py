# SPDX-License-Identifier: Apache-2.0
"""Fewer samples, without the frequencies that would fold."""

from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from arm_dynamics.arrays import Array
from arm_studies.identification.data import MeasuredMotion, arrays_at, joined
from arm_studies.identification.signals.filtering import ZeroPhase

PER_BAND = 10.0  # Rows per period of the band that ``thinned`` keeps.
# Rows on either side that ``spread`` averages over, and its window's parameter: up to a tenth of
# the rows' rate, its gain is within 2e-6 of one, and what folds there is below 2e-6.
REACH, KAISER = 6, 12.0


def decimated(x: Array, stride: int) -> Array:
    """Every ``stride``-th of samples of shape (k, …), without the frequencies that would fold.

    Low-pass filtered by a windowed sinc (Oppenheim, Schafer, Discrete-Time Signal Processing,
    2010, sections 4.6 and 7.5).
    """
    return np.asarray(spread(x, stride).sum(axis=-1))


def spread(x: Array, stride: int) -> Array:
    """Weights w of products with a factor f that is linear between rows, ``stride`` samples apart.

    Row i of the product, ``decimated``, is Σ_d w[i, …, d] f[i - REACH + d]. For many factors of
    one x, only the weights are computed from all samples.

    Args:
        x: Samples, shape (k, …).
        stride: Samples from row to row.

    Returns:
        Shape (rows, …, 2 REACH + 1).
    """
    near, width = np.arange(-REACH, REACH + 1), REACH * stride
    at = np.arange(-width, width + 1) / stride
    low_pass = np.sinc(at) * np.kaiser(len(at), KAISER)
    linear = np.maximum(0.0, 1.0 - abs(at[:, None] - near))
    long = np.pad(x, [(width, width), *[(0, 0)] * (x.ndim - 1)], mode="edge")
    windows = sliding_window_view(long, len(at), axis=0)[::stride]
    return np.asarray(windows @ (low_pass[:, None] / low_pass.sum() * linear))


def thinned(motion: MeasuredMotion) -> tuple[MeasuredMotion, int]:
    """The motion with only as many rows as its band needs, ``PER_BAND`` per period.

    Returns:
        The motion, and the stride of the rows that it keeps.
    """
    stride = max(1, int(1.0 / (PER_BAND * motion.band * motion.dt) + 1e-9))
    if stride == 1:
        return motion, 1
    dt = stride * motion.dt
    low_pass = ZeroPhase(motion.band, dt)
    parts = []
    for stretch in motion.stretches:
        part, rows = motion.span(stretch), slice(0, None, stride)
        values = arrays_at(part, rows) | {"effort": decimated(part.effort, stride)}
        stretches = (slice(0, len(values["time"])),)
        values |= {"valid": part.valid[rows], "dt": dt, "low_pass": low_pass}
        parts.append(replace(part, stretches=stretches, **values))
    return joined(parts, motion.notes), stride
