# SPDX-License-Identifier: Apache-2.0
"""A simulated arm and loops over it, its plan, and the forces of its contacts.

Names are imported when they are first used, as those of ``arm_sim``, which has them too.
"""

from typing import TYPE_CHECKING

from arm_dynamics.lazy import on_demand

if TYPE_CHECKING:
    from arm_sim.simulation.closed_loop import ClosedLoop
    from arm_sim.simulation.contact_loads import contact_history
    from arm_sim.simulation.plan import Plan
    from arm_sim.simulation.simulated_arm import SimulatedArm
    from arm_sim.simulation.simulator import Simulator

__all__ = ["ClosedLoop", "Plan", "SimulatedArm", "Simulator", "contact_history"]
__getattr__, __dir__ = on_demand(__name__, __file__)
