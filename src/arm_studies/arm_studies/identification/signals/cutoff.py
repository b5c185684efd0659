# SPDX-License-Identifier: Apache-2.0
"""The choice of a filter's cut-off frequency, from the noise in measured positions."""

import numpy as np

from arm_dynamics.arrays import Array

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
    high = _noise_level(power[frequency > 0.4 / dt])
    lower = _noise_level(power[(frequency > 0.2 / dt) & (frequency < 0.3 / dt)])
    floor = np.where(lower <= sloped * high, high, 0.0)
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
    level = factor * NOISE_RATIO * _noise_level(power[frequency > 0.35 / dt])
    edges, bands = _bins(len(frequency)), []
    widths = np.diff([*edges, len(frequency)])
    for column, noise in zip(power.T, level, strict=True):
        means = np.add.reduceat(column, edges) / widths
        # The lowest frequency from which the power of three bins is below the noise.
        quiet, peak = means <= noise, int(np.argmax(means))
        ends = [i for i in range(peak, len(quiet) - 2) if quiet[i : i + 3].all()]
        bands.append(float(frequency[edges[ends[0] if ends else -1]]))
    signal = np.maximum(power - level, 0.0) * (frequency <= max(bands))[:, None]
    best = min(PASSBAND_RATIO * max(bands), POWER_RATIO * _holding(frequency, signal))
    return float(min(WIDEST / dt, max(best, LEAST_PERIODS / (len(q) * dt))))


def _noise_level(power: Array) -> Array:
    """Mean power of white noise at some frequencies, which motion at a few of them leaves alone.

    Its power is distributed exponentially: the median is the mean times log 2.
    """
    return np.asarray(np.median(power, axis=0) / np.log(2.0))


def _bins(count: int) -> list[int]:
    """First indices of bins of a spectrum that widen with the frequency."""
    edges, at = [0], 2
    while at < count:
        edges.append(at)
        at = max(at + 3, int(at * BIN_GROWTH))
    return edges


def _holding(frequency: Array, power: Array) -> float:
    """The largest frequency below which a joint's accelerations have that much of their power."""
    sums = np.cumsum(power * frequency[:, None] ** 4, axis=0)
    moving = sums[-1] > 0.0
    if not moving.any():
        return np.inf
    places = [int(np.searchsorted(column, POWER_HELD * column[-1])) for column in sums.T[moving]]
    return float(frequency[max(places)])
