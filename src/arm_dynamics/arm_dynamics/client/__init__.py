# SPDX-License-Identifier: Apache-2.0
"""The services of running nodes as functions of Python.

Knows the interfaces and the service caller of ``ros``, so importing it needs ROS 2 and the built
workspace. It knows no equations: numbers go out and come in.
"""

from arm_dynamics.client.client import (
    ALL_TERMS,
    ArmClient,
    ConstrainedMotion,
    ModelFacts,
    NotReached,
    Postures,
    Terms,
)

__all__ = [
    "ALL_TERMS",
    "ArmClient",
    "ConstrainedMotion",
    "ModelFacts",
    "NotReached",
    "Postures",
    "Terms",
]
