# SPDX-License-Identifier: Apache-2.0
"""Arms in a browser: playback of recordings, interactive simulations, running arms.

The content of a picture (shapes, marks: computed by Pinocchio) is independent of its drawing
(drawn_arm, charts: viser), and both are independent of the source of motion (player, interactive).
Depends on simulators and recordings, which know nothing of it; not on ROS.
"""

from arm_sim.view.page import View
from arm_sim.view.view import show

__all__ = ["View", "show"]
