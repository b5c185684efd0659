# SPDX-License-Identifier: Apache-2.0
"""Arms in a browser: playback of motions, interactive simulations, running arms.

The content of a picture (shapes, marks: computed by Pinocchio) is independent of its drawing
(stage, charts: viser), and both are independent of the source of motion (player, bench, follower).
Depends on the arm model and on the interface of a simulation, but not on the simulator itself,
whose method ``view`` calls this package.
"""

from arm_sim.view.bench import Rig
from arm_sim.view.charts import Chart
from arm_sim.view.film import Film, looks
from arm_sim.view.follower import News
from arm_sim.view.live_account import LiveAccount
from arm_sim.view.marks import Instant
from arm_sim.view.view import View, show_films, show_followed, show_rigs

__all__ = [
    "Chart", "Film", "Instant", "LiveAccount", "News", "Rig", "View", "looks", "show_films",
    "show_followed", "show_rigs",
]  # fmt: skip
