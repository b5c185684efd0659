# SPDX-License-Identifier: Apache-2.0
"""Services of running nodes as Python functions.

Depends on the interfaces and the service caller of ``ros``, so importing it needs ROS 2 and the
built workspace. It contains no equations.
"""

from arm_dynamics.client.client import ArmClient
from arm_dynamics.client.results import ConstrainedMotion, ModelFacts, NotReached, Postures, Terms

__all__ = ["ArmClient", "ConstrainedMotion", "ModelFacts", "NotReached", "Postures", "Terms"]
