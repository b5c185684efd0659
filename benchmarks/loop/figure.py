# SPDX-License-Identifier: Apache-2.0
"""The picture of a run: how many ticks were how late, in the node and in a bare thread."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")

from matplotlib import pyplot as plt  # noqa: E402 - the backend is chosen first

COLORS = ("#2c6fbb", "#9aa1ab")


def draw(record: dict[str, Any], file: Path) -> None:
    """Draw the share of ticks that were later than a time, against that time."""
    figure, axis = plt.subplots(figsize=(8.2, 4.0), layout="constrained")
    loop = record["loop"]
    for label, bars, color in (
        ("sim node, loop closed across three processes", loop["loop"]["bars"], COLORS[0]),
        ("bare thread beside it, doing nothing", loop["thread"]["bars"], COLORS[1]),
    ):
        late, share = _later_than(bars)
        axis.step(1e6 * late, share, where="post", label=label, color=color, linewidth=1.8)
    axis.axvline(1000.0, color="#c0392b", linewidth=0.9, dashes=(4, 3))
    axis.text(1050.0, 0.3, "a tick", color="#c0392b", fontsize=9)
    axis.set(
        xscale="log", yscale="log", xlabel="lateness [µs]", ylabel="share of ticks that are later",
        title=f"Ticks of {loop['seconds']:.0f} s at 1 kHz",
    )  # fmt: skip
    axis.grid(color="#e4e6ea")
    axis.legend(frameon=False)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=130)
    plt.close(figure)


def _later_than(bars: Sequence[Sequence[float]]) -> tuple[np.ndarray, np.ndarray]:
    late, counts = np.array(bars, float).T
    total = counts.sum()
    return np.maximum(late, 1e-6), (total - np.cumsum(counts) + counts) / total
