# SPDX-License-Identifier: Apache-2.0
"""The services of running nodes as functions: numpy in, numpy out, no spinning.

Needs ROS 2 and the built workspace, which are imported when a client is made.
"""

from __future__ import annotations

from arm_dynamics.client_orders import Orders
from arm_dynamics.client_questions import ALL_TERMS, Questions
from arm_dynamics.client_values import ConstrainedMotion, ModelFacts, Postures, Terms

__all__ = ["ALL_TERMS", "ArmClient", "ConstrainedMotion", "ModelFacts", "Postures", "Terms"]


class ArmClient(Questions, Orders):
    """Asks a dynamics node and commands a sim node; one instance for each thread.

    Every method waits for the node and for its answer, each at most ``timeout``. The reply to a
    first call may get lost while the two ends find each other, so a first call is repeated where
    that does no harm. Errors: ``NoAnswer`` when no node is there or answers, ``Refused`` with the
    node's words when it will not do it, ``InvalidInput`` for arguments that cannot be sent.

    Example:
        >>> with ArmClient() as arm:
        ...     tau = arm.inverse_dynamics(q, v, a)  # q of shape (n,), or (k, n) for k points
    """
