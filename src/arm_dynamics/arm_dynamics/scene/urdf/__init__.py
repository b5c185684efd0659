# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions (URDF): read leniently, checked, and written anew for Pinocchio's parser.

``xml`` parses the text, ``plain`` reads the numbers that matter to the dynamics, ``description``
checks what they mean, ``units`` whether their units can be, ``inertial`` replaces inertias, and
``joint_names`` knows mimic joints by name. Depends on neither Pinocchio nor CasADi.
"""

from arm_dynamics.scene.urdf.description import JOINT, LINK, Mimic, Urdf, read_urdf
from arm_dynamics.scene.urdf.inertial import set_inertial, with_bodies
from arm_dynamics.scene.urdf.plain import MOVING, NO_LIMIT, SUPPORTED, floats
from arm_dynamics.scene.urdf.xml import xml_root

__all__ = [
    "JOINT", "LINK", "MOVING", "NO_LIMIT", "SUPPORTED", "Mimic", "Urdf", "floats", "read_urdf",
    "set_inertial", "with_bodies", "xml_root",
]  # fmt: skip
