# SPDX-License-Identifier: Apache-2.0
"""The figure of a comparison: measured and computed torques of each joint, and their errors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from arm_dynamics import load_scene
from arm_dynamics.writing import warn_if_replaced
from arm_studies.identification import Comparison


def draw(found: Sequence[Comparison], scenes: Sequence[str], path: Path) -> None:
    """Draw measured and computed torques, and their difference."""
    from arm_studies.identification.figures import NOTE, torque_panels

    first, names = found[0], [Path(scene).stem for scene in scenes]
    torques = {name: each.computed for name, each in zip(names, found, strict=True)}
    warn_if_replaced(path)
    with torque_panels(path, load_scene(scenes[0]), first.time, first.measured, torques) as axes:
        for i, right in enumerate(axes[:, 1]):
            each = zip(names, found, strict=True)
            shares = [f"{name} {100 * one.relative[i]:.1f} %" for name, one in each]
            right.set_title(", ".join(shares), **NOTE)
