# SPDX-License-Identifier: Apache-2.0
"""A zero-phase low-pass filter, and derivatives by it."""

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import count

import numpy as np
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
