# SPDX-License-Identifier: Apache-2.0
"""The picture of a run: how many cycles were how late, in the node and in a bare thread."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from arm_sim.figures import figure


def draw(record: dict[str, Any], file: Path) -> None:
    """Draw the share of cycles that started later than a time, against that time."""
    loop = record["loop"]
    with figure(file, 1, 1, (6.4, 3.6)) as axis:
        for label, bars in (
            ("sim node, loop closed across three processes", loop["loop"]["bars"]),
            ("bare thread at the same time", loop["thread"]["bars"]),
        ):
            late, share = _later_than(bars)
            axis.step(1e6 * late, share, where="post", label=label)
        axis.axvline(1000.0, color="0.4", lw=0.9, ls="--", label="one cycle")
        axis.set(xscale="log", yscale="log", xlabel="lateness [µs]",
                 ylabel="share of cycles that are later")  # fmt: skip


def _later_than(bars: Sequence[Sequence[float]]) -> tuple[np.ndarray, np.ndarray]:
    late, counts = np.array(bars, float).T
    total = counts.sum()
    return np.maximum(late, 1e-6), (total - np.cumsum(counts) + counts) / total
