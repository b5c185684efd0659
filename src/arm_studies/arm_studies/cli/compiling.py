# SPDX-License-Identifier: Apache-2.0
"""What ``./arm build --derivatives`` compiles for the studies."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from arm_sim import Simulator


def of_optimization(simulator: Simulator) -> Iterator[tuple[str, Callable[[], object]]]:
    """The code of trajectory optimization, by name."""
    from arm_studies.optimization import prepare

    yield "trajectory optimization", lambda: prepare(simulator)
