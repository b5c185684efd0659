# SPDX-License-Identifier: Apache-2.0
"""``python -m arm_sim.cli``, which is what ``./arm`` runs."""

from arm_dynamics.exceptions import ARM
from arm_sim.cli.completion import VARIABLE
from arm_sim.cli.main import main

main(prog_name=ARM, complete_var=VARIABLE)
