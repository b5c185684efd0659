# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions (URDF): read leniently, checked, and written anew for Pinocchio's parser.

``xml`` parses the text, ``plain`` reads the numbers that matter to the dynamics, ``description``
checks what they mean, ``units`` whether their units can be, ``inertial`` replaces inertias, and
``joint_names`` knows mimic joints by name. Depends on neither Pinocchio nor CasADi.
"""
