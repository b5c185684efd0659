# SPDX-License-Identifier: Apache-2.0
"""Inverse and forward dynamics, for an arm with numbers and with expressions alike."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from arm_dynamics.terms.arm import Arm


def inverse(arm: Arm, q: Any, v: Any, a: Any, chosen: Any = None, external: Any = None) -> Any:
    """Torques of a motion: the sum of all terms, or of each times its factor in ``chosen``."""
    if chosen is None:
        tau = arm.rigid.frictionless(q, v, a)
    else:
        inertia, coriolis, gravity, friction, spring = (chosen[i] for i in range(5))
        tau = arm.rigid.inverse(q, coriolis * v, inertia * a, gravity)
        if arm.has_springs:
            tau = tau + spring * arm.rigid.spring(q, v)
    if external is not None:
        tau = tau - external
    if not arm.has_friction:
        return tau
    total = arm.with_friction(v, q, tau)
    return total if chosen is None else friction * total + (1.0 - friction) * tau


def forward(arm: Arm, q: Any, v: Any, tau: Any, external: Any = None) -> Any:
    """Accelerations under joint torques."""
    net = tau - arm.friction(v, q, tau) if arm.has_friction else tau
    if external is not None:
        net = net + external
    return arm.rigid.forward(q, v, net - arm.rigid.spring(q, v) if arm.has_springs else net)
