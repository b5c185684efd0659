# SPDX-License-Identifier: Apache-2.0
"""Task space: kinematics, inertia and forces of an arm at one of its frames.

Depends on the dynamics of the joints, and on no controller.
Names are imported when they are first used.
"""

from typing import TYPE_CHECKING

from arm_dynamics.lazy import on_demand

if TYPE_CHECKING:
    from arm_dynamics.task_space.inertia import quaternions
    from arm_dynamics.task_space.inverse_kinematics import InverseKinematics, Solution
    from arm_dynamics.task_space.task_space import (
        EffectiveMass,
        MassEllipsoid,
        Pose,
        TaskSpace,
        TaskTerms,
    )

__all__ = [
    "EffectiveMass", "InverseKinematics", "MassEllipsoid", "Pose", "Solution", "TaskSpace",
    "TaskTerms", "quaternions",
]  # fmt: skip
__getattr__, __dir__ = on_demand(__name__, __file__)
