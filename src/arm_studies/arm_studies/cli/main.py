# SPDX-License-Identifier: Apache-2.0
"""The command group of the suite with its studies."""

from __future__ import annotations

from arm_sim.cli.main import SECTIONS, suite
from arm_studies.cli.compare import compare
from arm_studies.cli.compiling import of_optimization
from arm_studies.cli.excite import excite
from arm_studies.cli.identify import identify
from arm_studies.cli.identify_drive import identify_drive
from arm_studies.cli.sweep import sweep

_STUDIES = {"Studies": (sweep,), "Identification": (excite, identify, identify_drive, compare)}

*_others, _shell = SECTIONS.items()
main = suite(dict([*_others, *_STUDIES.items(), _shell]), [of_optimization])
