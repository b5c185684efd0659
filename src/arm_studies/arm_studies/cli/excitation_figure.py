# SPDX-License-Identifier: Apache-2.0
"""The figure of an exciting motion: the motion of its joints relative to their limits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from arm_dynamics.writing import warn_if_replaced

if TYPE_CHECKING:
    from arm_dynamics.arrays import Array
    from arm_dynamics.trajectory import Trajectory
    from arm_studies.identification.excitation import Room

_POINTS = np.linspace(0.0, 1.0, 6)[:-1]


def draw(motion: Trajectory, room: Room, path: Path) -> None:
    """Draw positions within their range, and speeds and torques over their limits."""
    from matplotlib.figure import Figure

    from arm_sim.figures import legend_at_right

    times, panels = _panels(motion, room)
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    axes = figure.subplots(4, 1, sharex=True)
    for axis, (name, values) in zip(axes, panels.items(), strict=True):
        for i, joint in enumerate(room.model.joint_names):
            axis.plot(times, values[:, i], lw=1.2, color=f"C{i % 10}", label=joint)
        axis.axhspan(-1.0, 1.0, color="0.95", lw=0)
        axis.set(ylabel=name, ylim=(-1.1, 1.1))
        axis.spines[["top", "right"]].set_visible(False)
    axes[-1].set(xlabel="time [s]", xlim=(0.0, motion.duration))
    legend_at_right(figure, *axes[0].get_legend_handles_labels())
    warn_if_replaced(path)
    try:
        figure.savefig(path, dpi=130)
    except ValueError as error:
        raise click.ClickException(f"'{path}': {error}") from None


def _panels(motion: Trajectory, room: Room) -> tuple[Array, dict[str, Array]]:
    """Times, and quantities relative to their limits by name."""
    times, q, v, a = motion.table(_POINTS)
    tau = room.torques(q, v, a)
    lower, upper = room.limits.lower, room.limits.upper
    middle, half = (lower + upper) / 2.0, (upper - lower) / 2.0
    limited = np.isfinite(room.limits.acceleration).all()
    return times, {
        "position in its range": (q - middle) / half,
        "speed / limit": v / _or_largest(room.limits.velocity, v),
        f"acceleration / {'limit' if limited else 'largest'}": a
        / _or_largest(room.limits.acceleration, a),
        "torque / limit": tau / _or_largest(room.effort, tau),
    }


def _or_largest(limit: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The limit, or the largest value of a joint without a limit."""
    largest = np.maximum(abs(values).max(axis=0), 1e-300)
    return np.where(np.isfinite(limit), limit, largest)
