# SPDX-License-Identifier: Apache-2.0
"""Draws the animation of the README: ./arm python tools/draw_motion.py. Needs ./arm setup view.

A Panda moves through four postures under computed torque, as ``./arm demo`` does.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from arm_dynamics.trajectory import Waypoint
from arm_sim import ClosedLoop
from arm_sim.view import show

FILM = Path(__file__).parents[1] / "docs/figures/arm.gif"
POSTURES = (  # of the seven joints, in [rad]
    (0.9, -0.2, 0.2, -2.0, 0.2, 1.9, 1.2),
    (0.3, 0.5, -0.3, -1.4, 0.0, 2.2, 0.4),
    (-0.9, -0.1, 0.1, -2.2, -0.3, 2.0, 0.2),
)
PACE = 1.1  # [s] from one to the next


def main() -> None:
    """Simulate it, and film it."""
    pair = ClosedLoop("panda")
    start = pair.simulator.state.q
    goals = [*map(np.array, POSTURES), start]
    pair.follow([Waypoint(PACE * (i + 1), goal) for i, goal in enumerate(goals)])
    with show(pair.run(PACE * len(goals)), name="panda", port=0) as page:
        print(page.film(FILM, size=(540, 360), rate=10.0))


if __name__ == "__main__":
    main()
