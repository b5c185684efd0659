# SPDX-License-Identifier: Apache-2.0
"""Arms in a browser: playback of motions, interactive simulations, running arms.

The content of a picture (shapes, marks: computed by Pinocchio) is independent of its drawing
(stage, charts: viser), and both are independent of the source of motion (player, bench, follower).
Depends on simulators and recordings, which know nothing of it; not on ROS.
"""

from arm_sim.view.charts import Chart
from arm_sim.view.film import Film
from arm_sim.view.follower import News
from arm_sim.view.marks import Instant
from arm_sim.view.view import View, show, show_followed

__all__ = ["Chart", "Film", "Instant", "News", "View", "show", "show_followed"]
