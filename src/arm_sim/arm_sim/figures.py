# SPDX-License-Identifier: Apache-2.0
"""Figures that look alike: made in one place, written to a file, with a word where it is."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

FOLDER = Path("reports/examples")
STYLE = {
    "font.size": 10.0, "axes.titlesize": 11.0, "axes.titleweight": "bold", "axes.grid": True,
    "axes.spines.top": False, "axes.spines.right": False, "axes.axisbelow": True,
    "grid.color": "0.9", "lines.linewidth": 1.7, "legend.frameon": False, "figure.dpi": 110.0,
}  # fmt: skip


@contextmanager
def figure(
    name: str,
    rows: int = 1,
    columns: int = 1,
    size: tuple[float, float] | None = None,
    folder: Path = FOLDER,
    **axes: Any,
) -> Iterator[Any]:
    """A figure to draw in, which is written at the end of the ``with`` block.

    Args:
        name: Of the file, without suffix.
        rows: Of axes.
        columns: Of axes.
        size: In inches; None for one that suits.
        folder: Where the file goes.
        **axes: As for ``matplotlib.figure.Figure.subplots``.

    Yields:
        The axes: one, or an array of them.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        made = Figure(
            figsize=size or (4.6 * columns + 0.4, 3.1 * rows + 0.5), layout="constrained"
        )
        yield made.subplots(rows, columns, **axes)
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{name}.png"
        made.savefig(path)
        print(f"figure: {path}")
