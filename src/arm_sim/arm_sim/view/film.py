# SPDX-License-Identifier: Apache-2.0
"""A recorded motion, to be shown."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, replace

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.model.arm import ArmModel
from arm_sim.exceptions import ViewError
from arm_sim.view.charts import Chart
from arm_sim.view.marks import Instant

LOOKS = 4000  # largest number of instants at which forces are computed


@dataclass(frozen=True)
class Film:
    """An arm's motion.

    Attributes:
        name: Its name on the page.
        model: The arm.
        time: In [s], shape (k,), increasing.
        q: Joint positions in [rad] or [m], shape (k, n).
        stills: Instants at which forces are known, in order of time.
        charts: Plots beside it.

    Raises:
        ViewError: If shapes of times and positions do not match each other or the arm.
    """

    name: str
    model: ArmModel
    time: Array
    q: Array
    stills: tuple[Instant, ...] = ()
    charts: tuple[Chart, ...] = ()

    def __post_init__(self) -> None:
        """Check shapes."""
        if self.q.shape != (len(self.time), self.model.n) or not len(self.time):
            raise ViewError(
                f"{self.name}: positions of shape {self.q.shape} at {len(self.time)} times; an "
                f"arm of {self.model.n} joints needs ({max(len(self.time), 1)}, {self.model.n})"
            )

    def at(self, time: float) -> Instant:
        """The picture at a time: the last state up to then, and the nearest forces."""
        row = max(0, bisect_right(self.time, time + 1e-9) - 1)
        instant = Instant(float(self.time[row]), self.q[row])
        if not self.stills:
            return instant
        i = bisect_right(self.stills, instant.time, key=lambda still: still.time)
        near = self.stills[max(0, i - 1) : i + 1]
        still = min(near, key=lambda still: abs(still.time - instant.time))
        return replace(still, time=instant.time, q=instant.q)


def looks(count: int) -> Array:
    """Rows of a recording at which forces are computed."""
    return np.unique(np.linspace(0, count - 1, min(count, LOOKS)).astype(int))
