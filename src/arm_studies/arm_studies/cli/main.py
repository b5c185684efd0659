# SPDX-License-Identifier: Apache-2.0
"""The command group of the suite with its studies."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from arm_sim.cli.main import SECTIONS, suite
from arm_studies.cli.compare import compare
from arm_studies.cli.excite import excite
from arm_studies.cli.identify import identify
from arm_studies.cli.identify_drive import identify_drive
from arm_studies.cli.sweep import sweep

if TYPE_CHECKING:
    from arm_sim import Simulator

_STUDIES = {"Studies": (sweep,), "Identification": (excite, identify, identify_drive, compare)}


def compiled_for_optimization(simulator: Simulator) -> Iterator[tuple[str, Callable[[], object]]]:
    """What ``./arm build --derivatives`` compiles for the studies, by name."""
    from arm_studies.optimization import prepare

    yield "trajectory optimization", lambda: prepare(simulator)


_sections = SECTIONS | _STUDIES
_sections["Shell"] = _sections.pop("Shell")  # it comes last, as without the studies
main = suite(_sections, [compiled_for_optimization])
