# SPDX-License-Identifier: Apache-2.0
"""Figures of identifications, of comparisons and of exciting motions."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics import ArmModel, Scene, load_scene
from arm_dynamics.arrays import Array
from arm_dynamics.trajectory import Trajectory
from arm_sim.figures import COLORS, WIDTH, figure, joint_words, units
from arm_studies.identification.comparison import Comparison
from arm_studies.identification.data import runs
from arm_studies.identification.excitation import Room
from arm_studies.identification.result import Identification

_NOTE: dict[str, Any] = {"loc": "right", "fontsize": 8.5, "fontweight": "normal"}
_POINTS = 2500  # of a curve
_INSTANTS = np.linspace(0.0, 1.0, 6)[:-1]  # of every segment of a motion


@contextmanager
def torque_panels(
    path: Path, scene: Scene, time: Array, measured: Array, predictions: Mapping[str, Array]
) -> Iterator[Any]:
    """A row for each joint: its torques, measured and predicted, and the residuals.

    Args:
        path: The figure.
        scene: The arm.
        time: In [s], shape (k,).
        measured: In [N m] or [N], shape (k, n).
        predictions: Other torques by label.

    Yields:
        The axes, shape (n, 2).
    """
    model = ArmModel(scene)
    n, unit = model.n, units(model.joint_types, "N m", "N")
    size = WIDTH, 1.05 * n + 0.9
    with figure(path, n, 2, size, squeeze=False, sharex=True, width_ratios=(1.5, 1)) as axes:
        for j, (left, right) in enumerate(axes):
            left.plot(time, measured[:, j], color="0.7", lw=3.0, label="measured")
            for (label, torque), color in zip(predictions.items(), COLORS, strict=False):
                left.plot(time, torque[:, j], color=color, lw=1.0, label=label)
                right.plot(time, measured[:, j] - torque[:, j], color=color, lw=0.8)
            left.set_ylabel(joint_words(model.joint_names)[j].replace(" ", "\n"))
            span = 1.05 * np.nanmax(abs(measured[:, j]))
            right.set_ylim(-span, span)
        titles = f"torque [{unit}]", f"residual [{unit}], relative RMS"
        for axis, title in zip(axes[0], titles, strict=True):
            axis.annotate(title, (0, 1.34), xycoords="axes fraction", weight="bold")
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        yield axes


def draw_torques(identification: Identification, path: Path) -> None:
    """Draw measured and predicted torques of each joint, and the residuals."""
    shown = identification.torques
    rows = np.unique(np.linspace(0, len(shown.time) - 1, _POINTS).astype(int))
    order = np.arange(len(shown.time)) * float(np.median(np.diff(shown.time)))
    torques = {"URDF": shown.nominal[rows], "identified": shown.predicted[rows]}
    drawn = identification.scene, order[rows], shown.measured[rows], torques
    with torque_panels(path, *drawn) as panels:
        for joint, (left, right) in zip(identification.joints, panels, strict=True):
            error = joint.errors.identified
            percent = "unknown" if np.isnan(error) else f"{100 * error:.1f} %"
            right.set_title(f"held out: {percent}", **_NOTE)
            for axis in (left, right):
                for a, b in runs(shown.held_out):
                    axis.axvspan(order[a], order[b - 1], color="0.93", zorder=0, label="held out")
        for axis in panels[-1]:
            axis.set_xlabel("time, gaps left out [s]")


def draw_comparison(comparisons: Sequence[Comparison], scenes: Sequence[str], path: Path) -> None:
    """Draw measured torques, those computed by each scene, and their difference."""
    first, names = comparisons[0], [Path(scene).stem for scene in scenes]
    torques = {name: each.computed for name, each in zip(names, comparisons, strict=True)}
    with torque_panels(path, load_scene(scenes[0]), first.time, first.measured, torques) as axes:
        for i, right in enumerate(axes[:, 1]):
            each = zip(names, comparisons, strict=True)
            shares = [f"{name} {100 * one.relative[i]:.1f} %" for name, one in each]
            right.set_title(", ".join(shares), **_NOTE)


def draw_friction(identification: Identification, path: Path) -> None:
    """Draw torques minus those of links and drives over speed, and the identified friction law.

    The law is drawn under the joint's typical load.
    """
    shown, types = identification.torques, ArmModel(identification.scene).joint_types
    names = joint_words(identification.joint_names)
    columns = min(4, len(names))
    lines = -(-len(names) // columns)
    rows = np.unique(np.linspace(0, len(shown.time) - 1, _POINTS).astype(int))
    with figure(path, lines, columns, (WIDTH, 1.9 * lines + 0.4), squeeze=False) as axes:
        for j, (at, name) in enumerate(zip(axes.flat, names, strict=False)):
            measured = shown.v[rows, j], shown.friction[rows, j]
            at.plot(*measured, ".", color="0.7", ms=2, label="measured")
            law = identification.joints[j].friction
            if law is not None and law.kinds:
                largest = float(np.nanmax(abs(shown.v[:, j])))
                half = np.geomspace(1e-4 * largest, largest, 200)
                v = np.concatenate([-half[::-1], [np.nan], half])  # with a gap at rest
                load = np.full_like(v, float(np.sqrt(np.nanmean(shown.measured[:, j] ** 2))))
                at.plot(v, law.torque(v, load), color=COLORS[1], label="identified law")
            at.set_title(name)
        whole = axes[0, 0].figure
        whole.supylabel(f"friction [{units(types, 'N m', 'N')}]", fontsize=9.0)
        whole.supxlabel(f"velocity [{units(types, 'rad/s', 'm/s')}]", fontsize=9.0)


def draw_excitation(motion: Trajectory, room: Room, path: Path) -> None:
    """Draw each joint's position within its range, and its speed and torque over limits."""
    times, curves = _curves(motion, room)
    names = joint_words(room.model.joint_names)
    rows = -(-len(names) // 2)
    size = WIDTH, 1.3 * rows + 0.7
    with figure(path, rows, 2, size, sharex=True, sharey=True) as axes:
        for j, (axis, name) in enumerate(zip(axes.flat, names, strict=False)):
            for label, values in curves.items():
                axis.plot(times, 100.0 * values[:, j], lw=1.2, label=label)
            axis.axhspan(-100.0, 100.0, color="0.96", lw=0, zorder=0)
            axis.set(title=name, ylim=(-110.0, 110.0), xlim=(0.0, 1.03 * motion.duration))
        for axis in axes.flat[max(0, len(names) - 2) : len(names)]:
            axis.set_xlabel("time [s]")
            axis.tick_params(labelbottom=True)
            axis.xaxis.set_in_layout(axis in [*axes.flat[-2:]])  # above nothing, it has room
        for axis in axes.flat[::2]:
            axis.set_ylabel("% of limit")


def _curves(motion: Trajectory, room: Room) -> tuple[Array, dict[str, Array]]:
    """Times, and quantities relative to their limits by name."""
    times, q, v, a = motion.table(_INSTANTS)
    tau = room.torques(q, v, a)
    lower, upper = room.limits.lower, room.limits.upper
    middle, half = (lower + upper) / 2.0, (upper - lower) / 2.0
    limited = np.isfinite(room.limits.acceleration).all()
    return times, {
        "position": (q - middle) / half,
        "velocity": v / _or_largest(room.limits.velocity, v),
        "acceleration" if limited else "acceleration, of its largest": a
        / _or_largest(room.limits.acceleration, a),
        "torque": tau / _or_largest(room.effort, tau),
    }


def _or_largest(limit: Array, values: Array) -> Array:
    """The limit, or the largest value of a joint without a limit."""
    largest = np.maximum(abs(values).max(axis=0), 1e-300)
    return np.where(np.isfinite(limit), limit, largest)
