# SPDX-License-Identifier: Apache-2.0
"""The equation of motion of a scene, x' = f(x, u, p), with only what the scene asks for.

Holds how drives, friction, bilateral constraints and contacts are put together, what is tunable,
and which states are allowed. Knows the equations and the model, and nothing of integration.
"""

from arm_sim.plant.actuation import CompiledControl, computed_torque
from arm_sim.plant.parameters import Parameter, Parameters
from arm_sim.plant.plant import Plant

__all__ = ["CompiledControl", "Parameter", "Parameters", "Plant", "computed_torque"]
