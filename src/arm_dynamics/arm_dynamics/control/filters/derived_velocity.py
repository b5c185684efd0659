# SPDX-License-Identifier: Apache-2.0
"""Velocities of a robot that measures positions only."""

import numpy as np

from arm_dynamics.arrays import Array, positive
from arm_dynamics.control.filters.low_pass import LowPass
from arm_dynamics.exceptions import InvalidInput


class DerivedVelocity:
    """Filtered differences of positions, as the sensors of a scene compute them.

    Example:
        >>> velocity = DerivedVelocity(7, dt=1e-3, cutoff=50.0)
        >>> v = velocity(stamp, q)

    Attributes:
        last: The last velocities in [rad/s] or [m/s], shape (n,); zero at the start.
        delay: Time in [s] by which slow changes of the velocity come late.
    """

    def __init__(self, n: int, dt: float, cutoff: float) -> None:
        """Choose the filter.

        Args:
            n: Number of joints.
            dt: Usual time between positions in [s].
            cutoff: Cut-off frequency of a Butterworth filter of first order in [Hz]; 0: no filter.

        Raises:
            InvalidInput: If a number is out of range.
        """
        step = positive("dt", dt)
        if not 0.0 <= cutoff * step < 0.5:
            raise InvalidInput(
                f"velocity_cutoff = {cutoff:g} Hz; allowed: 0 (no filter) to less than "
                f"{0.5 / step:g} Hz, half of the {1.0 / step:g} states per second"
            )
        self._filter = LowPass(1, [cutoff] * n, step) if cutoff else None
        lag = 0.5 * step / np.tan(np.pi * cutoff * step) if cutoff else 0.0
        self.last, self.delay = np.zeros(n), float(0.5 * step + lag)
        self._before: tuple[int, Array] | None = None

    def restart(self) -> None:
        """Forget all positions: the next velocity is zero."""
        self._before = None
        self.last = np.zeros_like(self.last)
        if self._filter is not None:
            self._filter.settle(self.last)

    def __call__(self, stamp: int, q: Array) -> Array:
        """Velocities at positions q, shape (n,), at a stamp in [ns]; zero at the first."""
        if self._before is None:
            self.restart()
        elif stamp > self._before[0]:
            stamp_before, q_before = self._before
            v = (q - q_before) / (1e-9 * (stamp - stamp_before))
            self.last = v if self._filter is None else self._filter.filtered(v).copy()
        self._before = stamp, q
        return self.last
