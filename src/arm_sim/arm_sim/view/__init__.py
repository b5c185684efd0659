# SPDX-License-Identifier: Apache-2.0
"""Arms to look at in a browser: motions to play, simulations to touch, running arms to follow.

What to draw (shapes, marks: numbers by Pinocchio) knows nothing of how it is drawn (stage, charts:
viser), and neither of what moves it (player, bench, follower). Knows the model of the arm and how
a simulation is used, and not the simulator itself, which has a method ``view`` that leads here.
"""

from arm_sim.view.bench import Rig
from arm_sim.view.charts import Chart
from arm_sim.view.film import Film, looks
from arm_sim.view.follower import News
from arm_sim.view.marks import Instant
from arm_sim.view.view import View, show_films, show_followed, show_rigs

__all__ = [
    "Chart", "Film", "Instant", "News", "Rig", "View", "looks", "show_films", "show_followed",
    "show_rigs",
]  # fmt: skip
