# SPDX-License-Identifier: Apache-2.0
"""A gear that passes on only a part of the power: a dry friction that grows with the load.

Of a motor's torque τ, as it is seen at the joint, η τ arrives where the motor drives, and the load
must bring τ / η where it drives the motor: η of the power arrives whichever way it flows. At rest
anything between holds (Giberti, Cinquemani and Legnani, "Effects of transmission mechanical
characteristics on the choice of a motor-reducer", Mechatronics 20(5), 2010, with one efficiency
for both ways). The functions take numbers, numpy arrays and CasADi expressions.
"""

from __future__ import annotations

from arm_dynamics.equations.elementary import Quantity, choose, size


def loss(direction: Quantity, torque: Quantity, efficiency: Quantity) -> Quantity:
    """Friction of the gear in [N m] or [N], of the sign of ``direction``.

    Args:
        direction: Which way the joint moves or is about to move, -1 or 1; 0 gives nothing.
        torque: Of the motor as it is seen at the joint in [N m] or [N].
        efficiency: η, above zero, at most one.
    """
    part = choose(direction * torque > 0.0, 1.0 - efficiency, 1.0 / efficiency - 1.0)
    return direction * size(torque) * part


def motor_torque(direction: Quantity, wanted: Quantity, efficiency: Quantity) -> Quantity:
    """The motor's torque of which ``wanted`` arrives; without a direction that torque itself."""
    push = direction * wanted
    less = choose(push < 0.0, wanted * efficiency, wanted)
    return choose(push > 0.0, wanted / efficiency, less)
