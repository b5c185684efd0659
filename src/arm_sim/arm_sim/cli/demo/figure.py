# SPDX-License-Identifier: Apache-2.0
"""The figure of a demo run: position, tracking error and torque over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.ticker import EngFormatter

from arm_sim.cli.demo.observer import Seen
from arm_sim.figures import COLORS, WIDTH, figure, joint_words, most_moved, units

_DOTS = 45  # number of service answers that are drawn
_BEHIND: dict[str, Any] = {"color": "0.8", "lw": 3.5, "zorder": 1.5}
_CIRCLES: dict[str, Any] = {"ls": "", "marker": "o", "mfc": "white", "ms": 3.0, "mew": 0.8}


def draw(
    file: Path, seen: Seen, names: Sequence[str], types: Sequence[str], duration: float, title: str
) -> None:
    """Draw a PNG; ``types`` are the joint types, ``duration`` is that of the motion in [s]."""
    joints = most_moved(seen.position)
    short = [joint_words(names)[i] for i in joints]
    with figure(file, 3, 1, (WIDTH, 6.2), sharex=True) as (position, error, torque):
        position.plot(seen.time, seen.position[:, joints], label=short)
        position.plot(seen.time, seen.reference[:, joints], label="reference", **_BEHIND)
        position.set(title=title, ylabel=f"position [{units(types, 'rad', 'm')}]")
        error.plot(seen.time, seen.error[:, joints], lw=1.0)
        error.yaxis.set_major_formatter(EngFormatter(units(types, "rad", "m")))  # as 5 µrad
        error.set_ylabel("tracking error")
        torque.plot(seen.time, seen.effort[:, joints])
        for color, answers in zip(COLORS, seen.asked_effort.T[joints], strict=False):
            every = max(1, len(answers) // _DOTS)
            torque.plot(seen.asked_time[::every], answers[::every], color=color, **_CIRCLES)
        torque.plot([], [], color="0.4", label="answer of the dynamics service", **_CIRCLES)
        torque.set(xlabel="time [s]", xlim=(0.0, max(duration, float(seen.time[-1]))))
        torque.set_ylabel(f"torque [{units(types, 'N m', 'N')}]")
