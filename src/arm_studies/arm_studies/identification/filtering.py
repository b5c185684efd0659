# SPDX-License-Identifier: Apache-2.0
"""A zero-phase low-pass filter, derivatives by it, and the choice of its cut-off frequency."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import count

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from arm_dynamics.arrays import Array

# Order of the Butterworth filter whose squared gain is applied: within 1.6e-4 of one below a third
# of the cut-off frequency, within 1e-8 below a tenth.
ORDER = 4
# Periods of the cut-off frequency after which the transient of an end has decayed to 1e-4: the
# slowest pole decays by exp(-2π sin(π/4p)) in each.
SETTLING_PERIODS = 4.0
# Noise bandwidth over the cut-off frequency: ∫ 1/(1 + x⁸)² dx; and for accelerations of motions
# that are filtered twice, over its fifth power: ∫ x⁴/(1 + x⁸)⁴ dx.
FLAT_NOISE, BENT_NOISE = 0.898, 0.087
MOST_LEFT_OUT = 0.06  # Largest fraction of a stretch that is discarded at each end.
# Periods of the cut-off frequency after which the transient has decayed to rounding.
TRANSIENT_PERIODS = 12.0
# Samples that are always discarded, so that at wide bands it has decayed to rounding.
LEAST_MARGIN = 25
NOISE_RATIO = 3.0  # Ratio to the noise above which the smoothed power is motion.
# Cut-off frequency over the highest frequency at which the motion exceeds the noise, for positions
# as for efforts: there the gain is within 4e-3 of one.
PASSBAND_RATIO = 2.0
LEAST_PERIODS = 45.0  # Smallest number of periods of the cut-off frequency in a recording.
BIN_GROWTH = 1.15  # Growth of the bins of the spectrum.
# The cut-off is at most ``POWER_RATIO`` times the frequency below which ``POWER_HELD`` of the
# power of accelerations lies.
POWER_HELD, POWER_RATIO = 0.999, 10.0
WIDEST = 0.4  # Largest cut-off frequency as a fraction of the sampling frequency.
# Rows on either side that ``spread`` averages over, and its window's parameter: up to a tenth of
# the rows' rate, its gain is within 2e-6 of one, and what folds there is below 2e-6.
REACH, KAISER = 6, 12.0


@dataclass(frozen=True)
class ZeroPhase:
    """A forward-backward Butterworth filter over samples at a constant rate.

    Its gain 1/(1 + (f/f_c)^(2p)) is applied to the spectrum, which also yields derivatives
    (Oppenheim, Schafer, Discrete-Time Signal Processing, 2010, sections 5.7 and 8.7). At both ends
    the samples are extended by point reflection, so that value and slope are continuous.

    Attributes:
        band: Cut-off frequency f_c in [Hz], where the gain is one half; inf for no filter.
        dt: Time between samples in [s].
        order: Order p.
    """

    band: float
    dt: float
    order: int = ORDER

    def __call__(self, x: Array, derivative: int = 0, before: float = 0.0) -> Array:
        """Low-pass filter, and differentiate.

        Args:
            x: Samples, shape (k, …), k > 1.
            derivative: How many times to differentiate with respect to time.
            before: Time in [s] before each sample for which its value is computed.

        Returns:
            Of the shape of ``x``.
        """
        if not np.isfinite(self.band) and not derivative and not before:
            return np.array(x, dtype=float)
        band = min(self.band, 0.5 / self.dt)
        k, shape = len(x), (-1, *[1] * (x.ndim - 1))
        pad = min(k - 1, max(64, math.ceil(TRANSIENT_PERIODS / (band * self.dt))))
        size = _fast_length(k + 2 * pad)
        head, tail = 2.0 * x[0] - x[pad:0:-1], 2.0 * x[-1] - x[-2 : -pad - 2 : -1]
        rest = np.broadcast_to(tail[-1:], (size - k - 2 * pad, *x.shape[1:]))
        long = np.concatenate([head, x, tail, rest])
        # Without the line through both ends it begins and ends at zero, as if it were periodic.
        slope = (long[-1] - long[0]) / (size - 1)
        line = long[0] + np.arange(size).reshape(shape) * slope
        response = _response(size, self.dt, band, self.order, derivative, before)
        spectrum = np.fft.rfft(long - line, axis=0) * response.reshape(shape)
        filtered = np.fft.irfft(spectrum, size, axis=0)
        filtered += (line - before / self.dt * slope, slope / self.dt, 0.0)[min(derivative, 2)]
        return np.asarray(filtered[pad : pad + k])

    def margin(self, count: int) -> int:
        """Number of samples to discard at each end of a stretch of ``count``."""
        if not np.isfinite(self.band):
            return 1
        settled = math.ceil(SETTLING_PERIODS / (self.band * self.dt))
        return max(LEAST_MARGIN, min(settled, int(MOST_LEFT_OUT * count)))


@lru_cache(maxsize=16)  # columns are filtered thousands of times, all of one length
def _response(
    count: int, dt: float, band: float, order: int, derivative: int, before: float
) -> NDArray[np.complexfloating]:
    """Gains of the filter at the frequencies of a real spectrum."""
    frequency = np.fft.rfftfreq(count, dt)
    gain = 1.0 / (1.0 + (frequency / band) ** (2 * order))
    turn = 2j * np.pi * frequency
    response = gain * turn**derivative * np.exp(-before * turn)
    response.setflags(write=False)
    return response


@lru_cache(maxsize=16)
def _fast_length(least: int) -> int:
    """The smallest number of at least ``least`` whose only factors are 2, 3 and 5."""
    return next(n for n in count(least) if 60**30 % n == 0)


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


def spectrum(x: Array, dt: float) -> tuple[Array, Array]:
    """Frequencies in [Hz] and power at each, of samples without their trend, windowed (Hann).

    Args:
        x: Samples, shape (k, n).
        dt: Time between them in [s].

    Returns:
        Shapes (m,) and (m, n).
    """
    k = len(x)
    ramp = np.linspace(0.0, 1.0, k)[:, None]
    level = x - x[0] - ramp * (x[-1] - x[0])
    window = np.hanning(k)[:, None]
    power = np.square(abs(np.fft.rfft(level * window, axis=0)), dtype=float)
    return np.fft.rfftfreq(k, dt), np.asarray(power)


def white_noise(x: Array, dt: float, sloped: float = np.inf) -> Array:
    """Standard deviation of the white noise in samples, by their highest frequencies.

    Or by fifth differences, if these show less.

    Args:
        x: Samples, shape (k, n).
        dt: Time between them in [s].
        sloped: Ratio of power at lower frequencies to that at the highest from which it is no
            noise, but motion, and zero is returned.
    """
    frequency, power = spectrum(x, dt)
    high = np.median(power[frequency > 0.4 / dt], axis=0)
    lower = np.median(power[(frequency > 0.2 / dt) & (frequency < 0.3 / dt)], axis=0)
    floor = np.where(lower <= sloped * high, high, 0.0) / np.log(2.0)
    # Jumps, which friction makes in efforts, are in few of the fifth differences, and smooth
    # motion is in none; of white noise, they have 252 times the power.
    typical = 1.4826 * np.median(abs(np.diff(x, 5, axis=0)), axis=0) / np.sqrt(252.0)
    return np.asarray(np.minimum(np.sqrt(floor / np.sum(np.hanning(len(x)) ** 2)), typical))


def chosen_band(q: Array, dt: float, factor: float = 1.0) -> float:
    """The cut-off frequency that balances loss of acceleration against noise.

    The noise of a position sensor is white, so the power near half the sampling frequency is its
    level at all frequencies. Above the frequency where the motion falls below it, a wider band
    adds more noise than motion to the acceleration; a narrower band loses motion (Wiener's
    argument; both are weighted by the same power of the frequency).

    Args:
        q: Positions, shape (k, n).
        dt: Time between samples in [s].
        factor: Additional factor by which the motion must exceed the noise.

    Returns:
        In [Hz], at most ``WIDEST`` of the sampling frequency.
    """
    frequency, power = spectrum(q, dt)
    floor = np.median(power[frequency > 0.35 / dt], axis=0) / np.log(2.0)
    level, edges, at = factor * NOISE_RATIO * floor, [0], 2  # of bins that widen with frequency
    while at < len(frequency):
        edges.append(at)
        at = max(at + 3, int(at * BIN_GROWTH))
    widths, bands = np.diff([*edges, len(frequency)]), []
    for column, noise in zip(power.T, level, strict=True):
        means = np.add.reduceat(column, edges) / widths
        # The lowest frequency from which the power of three bins is below the noise.
        quiet, first = means <= noise, int(np.argmax(means))
        three = [i for i in range(first, len(quiet) - 2) if quiet[i : i + 3].all()]
        bands.append(float(frequency[edges[three[0] if three else -1]]))
    signal = np.maximum(power - level, 0.0) * (frequency <= max(bands))[:, None]
    best = min(PASSBAND_RATIO * max(bands), POWER_RATIO * _holding(frequency, signal))
    return float(min(WIDEST / dt, max(best, LEAST_PERIODS / (len(q) * dt))))


def _holding(frequency: Array, power: Array) -> float:
    """The largest frequency below which a joint's accelerations have that much of their power."""
    sums = np.cumsum(power * frequency[:, None] ** 4, axis=0)
    moving = sums[-1] > 0.0
    if not moving.any():
        return np.inf
    places = [int(np.searchsorted(column, POWER_HELD * column[-1])) for column in sums.T[moving]]
    return float(frequency[max(places)])
