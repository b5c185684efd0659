# SPDX-License-Identifier: Apache-2.0
"""Figures of an identification: measured and predicted torques, and friction over speed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.figures import drawn
from arm_studies.identification.data import runs
from arm_studies.identification.result import Identification

_POINTS = 2500  # of a curve


def draw_torques(found: Identification, path: Path) -> None:
    """Draw measured and predicted torques of each joint, and the residuals.

    Args:
        found: The identification.
        path: The figure, in any format of Matplotlib.
    """
    shown, n = found.torques, len(found.joint_names)
    rows = np.unique(np.linspace(0, len(shown.time) - 1, _POINTS).astype(int))
    order = np.arange(len(shown.time)) * float(np.median(np.diff(shown.time)))
    t = order[rows]
    with drawn(path, n, 2, (13.0, 1.9 * n + 0.8)) as axes:
        for j, name in enumerate(found.joint_names):
            left, right = axes[j]
            left.plot(t, shown.nominal[rows, j], color="0.75", label="nominal", linewidth=1.0)
            left.plot(t, shown.measured[rows, j], color="C0", label="measured", linewidth=1.5)
            left.plot(t, shown.predicted[rows, j], color="C1", label="predicted", linewidth=1.0)
            left.set_ylabel(f"{name}\n[N m] or [N]", fontsize=8)
            residual = shown.measured[rows, j] - shown.predicted[rows, j]
            right.plot(t, residual, color="C3", linewidth=0.8)
            right.set_ylabel("residual", fontsize=8)
            error = found.torque_error[name]
            told = "unknown error" if np.isnan(error) else f"error {error:.1%}"
            right.set_title(f"{told} on held-out data", fontsize=8)
            for at in (left, right):
                _shade(at, order, shown.held_out)
        axes[0, 0].legend(ncols=3, fontsize=8, loc="lower right", bbox_to_anchor=(1, 0.98))
        for at in axes[-1]:
            at.set_xlabel("time [s], gaps removed; shaded: held out")


def draw_friction(found: Identification, path: Path) -> None:
    """Draw torques minus those of links and drives over speed, and the identified friction law.

    Args:
        found: The identification.
        path: The figure.
    """
    shown, n = found.torques, len(found.joint_names)
    columns = min(4, n)
    lines = -(-n // columns)
    rows = np.unique(np.linspace(0, len(shown.time) - 1, _POINTS).astype(int))
    with drawn(path, lines, columns, (3.4 * columns, 2.8 * lines + 0.3)) as axes:
        for j, at in enumerate(axes.ravel()):
            if j >= n:
                at.set_visible(False)
                continue
            at.plot(shown.v[rows, j], shown.friction[rows, j], ".", color="0.7", markersize=2)
            fit = found.friction[j]
            if fit is not None and fit.kinds:
                at.plot(*_law(found, j), color="C1")
            at.set_title(found.joint_names[j], fontsize=9)
            at.set_xlabel("velocity [rad/s] or [m/s]", fontsize=8)
            at.set_ylabel("friction [N m] or [N]", fontsize=8)


def _law(found: Identification, j: int) -> tuple[Array, Array]:
    """Friction over velocity under the joint's typical load, with a gap at rest."""
    fit, shown = found.friction[j], found.torques
    assert fit is not None
    most = float(np.nanmax(abs(shown.v[:, j])))
    half = np.geomspace(1e-4 * most, most, 200)
    v = np.concatenate([-half[::-1], [np.nan], half])
    load = np.full_like(v, float(np.sqrt(np.nanmean(shown.measured[:, j] ** 2))))
    return v, fit.torque(v, load)


def _shade(axes: Any, time: Any, held_out: Any) -> None:
    for first, end in runs(held_out):
        axes.axvspan(time[first], time[end - 1], color="0.93", zorder=0)
