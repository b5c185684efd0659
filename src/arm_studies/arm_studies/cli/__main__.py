# SPDX-License-Identifier: Apache-2.0
"""``python -m arm_studies.cli``, which is what ``./arm`` runs."""

from arm_sim.cli.interrupts import begin

begin()

from arm_dynamics.exceptions import ARM  # noqa: E402
from arm_sim.cli.completion import VARIABLE  # noqa: E402
from arm_studies.cli.main import main  # noqa: E402

main(prog_name=ARM, complete_var=VARIABLE)
