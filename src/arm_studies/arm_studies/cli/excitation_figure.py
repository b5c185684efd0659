# SPDX-License-Identifier: Apache-2.0
"""The figure of an exciting motion: each joint relative to its limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.trajectory import Trajectory
from arm_dynamics.writing import warn_if_replaced
from arm_sim.figures import WIDTH, figure, joint_words
from arm_studies.identification.excitation import Room

_POINTS = np.linspace(0.0, 1.0, 6)[:-1]


def draw(motion: Trajectory, room: Room, path: Path) -> None:
    """Draw each joint's position within its range, and its speed and torque over limits."""
    times, curves = _curves(motion, room)
    names = joint_words(room.model.joint_names)
    rows = -(-len(names) // 2)
    warn_if_replaced(path)
    size = WIDTH, 1.3 * rows + 0.7
    with figure(path, rows, 2, size, sharex=True, sharey=True) as axes:
        for j, (axis, name) in enumerate(zip(axes.flat, names, strict=False)):
            for label, values in curves.items():
                axis.plot(times, values[:, j], lw=1.2, label=label)
            axis.axhspan(-1.0, 1.0, color="0.96", lw=0, zorder=0)
            axis.set(title=name, ylim=(-1.1, 1.1), xlim=(0.0, motion.duration))
        for axis in axes.flat[max(0, len(names) - 2) : len(names)]:
            axis.set_xlabel("time [s]")
            axis.tick_params(labelbottom=True)
        for axis in axes.flat[::2]:
            axis.set_ylabel("share of bound")


def _curves(motion: Trajectory, room: Room) -> tuple[Array, dict[str, Array]]:
    """Times, and quantities relative to their limits by name."""
    times, q, v, a = motion.table(_POINTS)
    tau = room.torques(q, v, a)
    lower, upper = room.limits.lower, room.limits.upper
    middle, half = (lower + upper) / 2.0, (upper - lower) / 2.0
    limited = np.isfinite(room.limits.acceleration).all()
    return times, {
        "position in its range": (q - middle) / half,
        "speed": v / _or_largest(room.limits.velocity, v),
        "acceleration" if limited else "acceleration, of its largest": a
        / _or_largest(room.limits.acceleration, a),
        "torque": tau / _or_largest(room.effort, tau),
    }


def _or_largest(limit: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The limit, or the largest value of a joint without a limit."""
    largest = np.maximum(abs(values).max(axis=0), 1e-300)
    return np.where(np.isfinite(limit), limit, largest)
