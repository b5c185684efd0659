# SPDX-License-Identifier: Apache-2.0
"""The equations of motion as expressions: each module reads like the equation in its source.

They know trees of links, frames and types of the scene, and no model, no numbers of an arm, no
solver. Most functions take CasADi expressions and NumPy arrays alike.
"""

from arm_dynamics.equations import (
    constraint,
    contact,
    elementary,
    forward_dynamics,
    frame,
    friction,
    interpolation,
    lugre,
    motor,
    projection,
    rigid_body,
    sticking,
    transmission,
    tree,
)

__all__ = [
    "constraint", "contact", "elementary", "forward_dynamics", "frame", "friction",
    "interpolation", "lugre", "motor", "projection", "rigid_body", "sticking", "transmission",
    "tree",
]  # fmt: skip
