# SPDX-License-Identifier: Apache-2.0
"""A scene as a C library: a folder that needs nothing of the suite.

Contains the terms of the equation of motion as C source, with a test program, a build file and a
description. Depends on the simulator; nothing but the command line depends on it. Public:
``export``, what it returns, and the names of the terms.
"""

from arm_sim.export.export import Exported, export
from arm_sim.export.terms import DERIVATIVES, TERMS

__all__ = ["DERIVATIVES", "TERMS", "Exported", "export"]
