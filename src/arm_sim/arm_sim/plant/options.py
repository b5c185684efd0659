# SPDX-License-Identifier: Apache-2.0
"""Options of a scene's equation of motion."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Options:
    """What the equations of a scene contain: the key of all that is built for them.

    Attributes:
        stops: Whether joints may be at their stops, and the comparisons of cords and drives are
            modes. If not, joints are away from stops, and the equations compare.
        drives: Whether there are drives and friction models with states; if not, commands are
            torques.
        sliding: Whether all joints slide and nothing touches, whatever the modes in p.
        regularization: Speed s in [rad/s] or [m/s] of dry friction regularized by v / √(v² + s²),
            without events; 0 for a direction that is a mode.
        energies: Whether energy flows are integrated as additional states, see ``EnergyFlows``.
    """

    stops: bool = True
    drives: bool = True
    sliding: bool = False
    regularization: float = 0.0
    energies: bool = False


# The equations of a scene as it is
SCENE = Options()
