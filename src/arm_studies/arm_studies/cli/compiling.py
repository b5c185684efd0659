# SPDX-License-Identifier: Apache-2.0
"""What ``./arm build --derivatives`` compiles for the studies."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from arm_sim import Simulator


def of_optimization(simulator: Simulator) -> Iterator[tuple[str, Callable[[], object]]]:
    """The code of trajectory optimization and of the receding horizon, by name."""
    from arm_dynamics import InvalidInput
    from arm_studies.optimization import RecedingHorizon, prepare

    def horizon() -> None:
        with suppress(InvalidInput):  # a model with events has none
            RecedingHorizon(simulator.dynamics)

    yield "trajectory optimization", lambda: prepare(simulator)
    yield "receding horizon", horizon
