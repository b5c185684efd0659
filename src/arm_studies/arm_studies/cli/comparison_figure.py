# SPDX-License-Identifier: Apache-2.0
"""The figure of a comparison: measured and computed torques of each joint, and their errors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from arm_dynamics.writing import warn_if_replaced

if TYPE_CHECKING:
    from arm_studies.identification import Comparison

_COLORS = ("C1", "C0")
_ABOVE: dict[str, Any] = {  # its axes, so that it hides no curve
    "loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "fontsize": 7, "ncols": 3,
    "borderaxespad": 0.2,
}  # fmt: skip


def draw(found: Sequence[Comparison], scenes: Sequence[str], path: Path) -> None:
    """Draw measured and computed torques, and their difference."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from arm_sim.figures import STYLE

    n = len(found[0].joint_names)
    labels = [Path(scene).stem for scene in scenes]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 1.5 * n + 1.2), layout="constrained")
        axes = figure.subplots(n, 2, sharex=True, squeeze=False, width_ratios=(1.6, 1.0))
        for i in range(n):
            _draw_joint(*axes[i], i, found, labels)
        axes[0, 0].set_title("torque [N m or N]", pad=22)
        axes[0, 1].set_title("measured minus computed", pad=22)
        axes[0, 0].legend(**_ABOVE)
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        warn_if_replaced(path)
        try:
            figure.savefig(path, dpi=120)
        except ValueError as error:
            raise click.ClickException(f"'{path}': {error}") from None


def _draw_joint(
    left: Any, right: Any, i: int, found: Sequence[Comparison], labels: Sequence[str]
) -> None:
    """Draw torques of a joint to the left, and what of the measured ones is left to the right."""
    first = found[0]
    left.plot(first.time, first.measured[:, i], color="0.25", lw=1.8, label="measured")
    for made, label, color in zip(found, labels, _COLORS, strict=False):
        left.plot(made.time, made.computed[:, i], color=color, lw=1.0, label=label)
        rest = made.measured[:, i] - made.computed[:, i]
        share = f"{100.0 * made.relative[i]:.1f} %"
        right.plot(made.time, rest, color=color, lw=0.8, label=f"{label}: {share}")
    left.set_ylabel(first.joint_names[i], fontsize=8)
    span = np.nanmax(abs(first.measured[:, i]))
    right.set_ylim(-span, span)
    right.legend(**_ABOVE)
