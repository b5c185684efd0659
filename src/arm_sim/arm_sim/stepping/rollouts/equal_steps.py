# SPDX-License-Identifier: Apache-2.0
"""Whether arms side by side take the same steps."""

from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant


def takes_equal_steps(plant: Plant, choice: Choice) -> bool:
    """Whether arms in any states take the same steps away from stops.

    That is so without events, switches and error control.
    """
    smooth = choice.tolerance is None and not (plant.free or plant).eventful
    return smooth and not has_unmonitored_switches(plant)


def has_unmonitored_switches(plant: Plant) -> bool:
    """Whether drives or cords switch, which lanes of arms away from their stops do not monitor."""
    return plant.free is not None and plant.layout.switches > 0
