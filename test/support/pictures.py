# SPDX-License-Identifier: Apache-2.0
"""Figures of pyplot in tests: drawn in memory, and closed afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import matplotlib as mpl
from matplotlib import pyplot as plt


@contextmanager
def unseen() -> Iterator[None]:
    """Within this block figures are drawn to memory; its end closes them and keeps no setting."""
    with mpl.rc_context({"backend": "Agg"}):
        try:
            yield
        finally:
            plt.close("all")
