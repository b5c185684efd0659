# SPDX-License-Identifier: Apache-2.0
"""What the figures have in common: marks and Matplotlib's settings."""

from __future__ import annotations

MARKS = "osD^vP*Xhp"
STYLE = {
    "figure.dpi": 130, "font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "grid.linewidth": 0.5,
    "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False,
    "legend.fontsize": 7.5, "svg.hashsalt": "benchmarks",
}  # fmt: skip
