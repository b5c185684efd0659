# SPDX-License-Identifier: Apache-2.0
"""A case by the simulator of ``test/reference/independent``, which shares no line with the suite.

It knows neither backlash nor current limits, and takes seconds to minutes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from benchmarks.missed_events.cases import Case

TEST = str(Path(__file__).parents[2] / "test")
sys.path[:0] = [path for path in (TEST,) if path not in sys.path]

from reference.independent import simulate  # noqa: E402

MOST_LOOKS = 20_000  # ten seconds or so


def solve(case: Case, start: tuple[np.ndarray, np.ndarray]) -> np.ndarray | str:
    """Positions at every tick, shape (ticks + 1, n), or why there are none.

    Args:
        case: The case.
        start: Positions and speeds at its beginning, shapes (n,).
    """
    names = [f"j{i}" for i in range(len(start[0]))]
    position, velocity = (dict(zip(names, part.tolist(), strict=True)) for part in start)
    scene = case.scene | {"initial": {"position": position, "velocity": velocity}}
    times = case.dt * np.arange(len(case.command) + 1)
    try:
        return np.asarray(simulate(scene, case.command, times, most_looks=MOST_LOOKS).q)
    except (NotImplementedError, RuntimeError) as error:
        return f"{error}"[:160]
