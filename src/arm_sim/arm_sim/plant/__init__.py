# SPDX-License-Identifier: Apache-2.0
"""The equation of motion of a scene, x' = f(x, u, p), with only the terms that it needs.

Combines drives, friction, bilateral constraints and contacts, and defines tunable parameters and
admissible states. Depends on the equations and the model, and not on integration.
"""

from arm_sim.plant.actuation import CompiledControl, computed_torque
from arm_sim.plant.options import Options
from arm_sim.plant.parameters import Parameter, Parameters
from arm_sim.plant.plant import Plant

__all__ = ["CompiledControl", "Options", "Parameter", "Parameters", "Plant", "computed_torque"]
