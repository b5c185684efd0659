# SPDX-License-Identifier: Apache-2.0
"""Numerical inverse and forward dynamics of an arm, with or without constraints.

Pinocchio computes single points; batches of ``MANY`` run as generated code that is verified
against it. Depends on the model, its drives and friction, and the terms; on no controller, and not
on ROS.
"""

from arm_dynamics.dynamics.constrained import Constrained
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.terms.table import Term

__all__ = ["Constrained", "Dynamics", "Term"]
