# SPDX-License-Identifier: Apache-2.0
"""Figures in tests: drawn in memory and closed afterwards, or kept when they are written."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import pytest
from matplotlib import pyplot as plt
from matplotlib.figure import Figure


@contextmanager
def unseen() -> Iterator[None]:
    """Within this block figures are drawn to memory; its end closes them and keeps no setting."""
    with mpl.rc_context({"backend": "Agg"}):
        try:
            yield
        finally:
            plt.close("all")


@contextmanager
def written() -> Iterator[list[Any]]:
    """Figures that are written to files meanwhile."""
    figures, write = list[Any](), Figure.savefig

    def save(figure: Any, *where: Any, **how: Any) -> None:
        figures.append(figure)
        write(figure, *where, **how)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", save)
        yield figures
