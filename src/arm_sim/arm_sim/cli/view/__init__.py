# SPDX-License-Identifier: Apache-2.0
"""``./arm view``: arms in the browser, and pictures of them.

``command`` opens scenes and recordings, ``live`` follows running arms. ROS and the library that
draws are imported when it runs.
"""

from arm_sim.cli.view.command import view

__all__ = ["view"]
