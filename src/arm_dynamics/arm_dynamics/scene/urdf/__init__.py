# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions (URDF): read leniently, checked, and written anew for Pinocchio's parser.

``xml`` parses the text, ``plain`` reads the numbers that matter to the dynamics, ``description``
checks what they mean. Depends on neither Pinocchio nor CasADi.
"""

from arm_dynamics.scene.urdf.description import Mimic, Urdf, read_urdf
from arm_dynamics.scene.urdf.plain import MOVING, NO_LIMIT, SUPPORTED, floats
from arm_dynamics.scene.urdf.xml import xml_root

__all__ = ["MOVING", "NO_LIMIT", "SUPPORTED", "Mimic", "Urdf", "floats", "read_urdf", "xml_root"]
