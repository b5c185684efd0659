# SPDX-License-Identifier: Apache-2.0
"""Figures of an identification: measured and predicted torques, and friction over speed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics import ArmModel, Scene
from arm_dynamics.arrays import Array
from arm_sim.figures import COLORS, WIDTH, figure, joint_words, units
from arm_studies.identification.data import runs
from arm_studies.identification.result import Identification

NOTE: dict[str, Any] = {"loc": "right", "fontsize": 8.5, "fontweight": "normal"}
_POINTS = 2500  # of a curve


@contextmanager
def torque_panels(
    path: Path, scene: Scene, time: Array, measured: Array, others: Mapping[str, Array]
) -> Iterator[Any]:
    """A row for each joint: its torques, measured and others, and measured minus the others.

    Args:
        path: The figure.
        scene: The arm.
        time: In [s], shape (k,).
        measured: In [N m] or [N], shape (k, n).
        others: Other torques by label.

    Yields:
        The axes, shape (n, 2).
    """
    model = ArmModel(scene)
    n, unit = model.n, units(model.joint_types, "N m", "N")
    size = WIDTH, 1.05 * n + 0.9
    with figure(path, n, 2, size, squeeze=False, sharex=True, width_ratios=(1.5, 1)) as axes:
        for j, (left, right) in enumerate(axes):
            left.plot(time, measured[:, j], color="0.7", lw=3.0, label="measured")
            for (label, torque), color in zip(others.items(), COLORS, strict=False):
                left.plot(time, torque[:, j], color=color, lw=1.0, label=label)
                right.plot(time, measured[:, j] - torque[:, j], color=color, lw=0.8)
            left.set_ylabel(joint_words(model.joint_names)[j].replace(" ", "\n"))
            span = 1.05 * np.nanmax(abs(measured[:, j]))
            right.set_ylim(-span, span)
        for axis, title in zip(axes[0], ("torque", "residual"), strict=True):
            axis.annotate(f"{title} [{unit}]", (0, 1.34), xycoords="axes fraction", weight="bold")
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        yield axes


def draw_torques(found: Identification, path: Path) -> None:
    """Draw measured and predicted torques of each joint, and the residuals.

    Args:
        found: The identification.
        path: The figure, in any format of Matplotlib.
    """
    shown = found.torques
    rows = np.unique(np.linspace(0, len(shown.time) - 1, _POINTS).astype(int))
    order = np.arange(len(shown.time)) * float(np.median(np.diff(shown.time)))
    torques = {"nominal": shown.nominal[rows], "identified": shown.predicted[rows]}
    with torque_panels(path, found.scene, order[rows], shown.measured[rows], torques) as made:
        for name, (left, right) in zip(found.joint_names, made, strict=True):
            error = found.torque_error[name]
            known = "unknown" if np.isnan(error) else f"{100 * error:.1f} %"
            right.set_title(f"{known} on held-out data (shaded)", **NOTE)
            for axis in (left, right):
                for first, end in runs(shown.held_out):
                    axis.axvspan(order[first], order[end - 1], color="0.93", zorder=0)
        for axis in made[-1]:
            axis.set_xlabel("time without gaps [s]")


def draw_friction(found: Identification, path: Path) -> None:
    """Draw torques minus those of links and drives over speed, and the identified friction law.

    Args:
        found: The identification.
        path: The figure.
    """
    shown, n, types = found.torques, len(found.joint_names), ArmModel(found.scene).joint_types
    columns = min(4, n)
    lines = -(-n // columns)
    rows = np.unique(np.linspace(0, len(shown.time) - 1, _POINTS).astype(int))
    with figure(path, lines, columns, (WIDTH, 1.9 * lines + 0.4), squeeze=False) as axes:
        for j, (at, name) in enumerate(
            zip(axes.flat, joint_words(found.joint_names), strict=False)
        ):
            at.plot(
                shown.v[rows, j], shown.friction[rows, j], ".", color="0.7", ms=2, label="measured"
            )
            fit = found.friction[j]
            if fit is not None and fit.kinds:
                at.plot(*_law(found, j), color=COLORS[1], label="identified law")
            at.set_title(name)
        whole = axes[0, 0].figure
        whole.supylabel(f"friction [{units(types, 'N m', 'N')}]", fontsize=9.0)
        whole.supxlabel(f"velocity [{units(types, 'rad/s', 'm/s')}]", fontsize=9.0)


def _law(found: Identification, j: int) -> tuple[Array, Array]:
    """Friction over velocity under the joint's typical load, with a gap at rest."""
    fit, shown = found.friction[j], found.torques
    assert fit is not None
    most = float(np.nanmax(abs(shown.v[:, j])))
    half = np.geomspace(1e-4 * most, most, 200)
    v = np.concatenate([-half[::-1], [np.nan], half])
    load = np.full_like(v, float(np.sqrt(np.nanmean(shown.measured[:, j] ** 2))))
    return v, fit.torque(v, load)
